"""Estimation of parameters from impacting motion, measured or simulated: `estimate_impacts`.

The displacement of a body that hits a stop is cut at its impacts, found from the signal alone. Energy balance, weak
form and a fit of whole trajectories then give restitution, damping, natural frequency and forcing. Their estimates
stand side by side with 95 % intervals; docs/estimation.md explains them. Use `estimate_bounces` for bounces without
a force, and `estimate_modes` for bodies with several modes.

Examples
--------
>>> import numpy as np
>>> from vibroimpact.analysis.recording import Channel, TimeAxis
>>> from vibroimpact.fmus.core import Oscillator, motion
>>> body = Oscillator(damping=1.0, stiffness=400.0, amplitude=600.0, angular_frequency=35.0)
>>> time = np.arange(0.0, 3.0, 0.002)
>>> displacement, _ = motion(body, (-1.0, 0.0), time, position=0.4, restitution=0.8)
>>> tip = Channel("tip", displacement, "m", TimeAxis(time, 0.002), np.zeros(len(time), np.uint8))
>>> found = estimate_impacts(tip, Forcing(35.0, phase=0.0), methods=["weak_form"])
>>> round(found.values["weak_form"]["restitution"].value, 3)
0.8
"""

from vibroimpact.analysis.estimation.estimates import (
    METHODS,
    QUANTITIES,
    Doubt,
    ImpactEstimates,
    MethodEstimate,
    Refusal,
    print_impacts,
)
from vibroimpact.analysis.estimation.flight_times import estimate_bounces
from vibroimpact.analysis.estimation.impacts import estimate_impacts
from vibroimpact.analysis.estimation.modal import (
    ModalEstimates,
    estimate_modes,
    modal_coordinates,
    restitution_from_energy,
)
from vibroimpact.analysis.estimation.physics import Forcing, Known

__all__ = [
    "METHODS",
    "QUANTITIES",
    "Doubt",
    "Forcing",
    "ImpactEstimates",
    "Known",
    "MethodEstimate",
    "ModalEstimates",
    "Refusal",
    "estimate_bounces",
    "estimate_impacts",
    "estimate_modes",
    "modal_coordinates",
    "print_impacts",
    "restitution_from_energy",
]

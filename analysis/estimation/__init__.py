"""Estimation of parameters from impacting motion, measured or simulated: `estimate_impacts`.

A displacement that hits a stop is cut at its impacts, found from the signal alone; then energy balance, weak form and
a fit of whole trajectories each say what restitution, damping, natural frequency and forcing are, side by side with
95 % intervals. docs/estimation.md says how to read them.
"""

from vibroimpact.analysis.estimation.estimates import (
    METHODS,
    QUANTITIES,
    Estimate,
    ImpactEstimates,
    Refusal,
)
from vibroimpact.analysis.estimation.impacts import estimate_impacts
from vibroimpact.analysis.estimation.physics import Forcing, Known
from vibroimpact.analysis.estimation.report import print_impacts

__all__ = [
    "METHODS",
    "QUANTITIES",
    "Estimate",
    "Forcing",
    "ImpactEstimates",
    "Known",
    "Refusal",
    "estimate_impacts",
    "print_impacts",
]

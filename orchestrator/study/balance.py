"""The energy balance of a run: its relative error when all work and all losses are counted."""

from __future__ import annotations

import math

import numpy as np

from vibroimpact.fmus.errors import ComponentError, SceneError
from vibroimpact.orchestrator.run import open_runner
from vibroimpact.orchestrator.run.parameters import float_parameters
from vibroimpact.orchestrator.run.window import recorded_window
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.study.observation import Floats

BALANCED = (
    *("energy.kinetic", "energy.potential"),
    *("energy.forcing_work", "energy.damping_loss", "energy.contact_loss"),
)
"""Variables of the time series from which the balance follows, in this order."""
SAMPLES = 64
"""Number of samples of the time series, evenly over the recording."""


def off_balance(samples: Floats) -> Floats:
    """Return the error of the energy balance at each sample, over the largest energy turned over until then.

    Parameters
    ----------
    samples : ndarray, shape (sample, 6)
        Time, s, and `BALANCED`, J.

    Returns
    -------
    ndarray, shape (sample - 1,)
        From the second sample on.
    """
    _, kinetic, potential, work, damping, contact = samples.T
    energy = kinetic + potential
    turned = np.maximum.accumulate(energy + np.abs(work) + damping + np.abs(contact))
    off = np.abs(energy - energy[0] - work + damping + contact)
    with np.errstate(invalid="ignore"):
        found: Floats = np.where(turned > 0.0, off / turned, 0.0)[1:]
    return found


def balance_of(scene: Scene) -> float:
    """Return the largest relative error of the energy balance of a run; NaN where the body has no energies.

    The scene has no sweep. It runs once more with a time series, since the samples of energies take time.
    """
    if not scene.is_lone_body or not scene.body.IS_STRUCTURE:
        return math.nan
    begin, end = recorded_window(scene, float_parameters(scene, None))
    series = {"rate": SAMPLES / (end - begin), "variables": list(BALANCED)}
    try:
        runner = open_runner(scene.with_values({"record.time_series": series}), scene.execution.how)
        try:
            samples = runner.run({}).samples
        finally:
            runner.close()
    except (ComponentError, SceneError):  # the way fails too, and its own row has the message
        return math.nan
    return math.nan if samples is None or len(samples) < 2 else float(off_balance(samples).max())

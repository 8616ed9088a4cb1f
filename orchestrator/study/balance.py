"""The balance of energy of a run: what is left of it when all that went in and out is counted."""

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
"""What a time series has for it, in this order."""
SAMPLES = 64
"""Over a run, at which it is looked at."""


def off_balance(samples: Floats) -> Floats:
    """Return how far energy is off its balance, over all that has been turned over by then.

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
    """Return the largest relative error of the balance of a run; NaN of a body that does not follow its energies.

    The scene, of the short form and without a sweep, is run once more, since energies take time.
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
    except (ComponentError, SceneError):  # the way itself has failed, and says so
        return math.nan
    return math.nan if samples is None or len(samples) < 2 else float(off_balance(samples).max())

"""The energy balance of a run: its relative error when all work and all losses are counted."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from vibroimpact.analysis.dataset import Outcome
from vibroimpact.fmus.errors import ComponentError, SceneError
from vibroimpact.orchestrator.run import open_runner
from vibroimpact.orchestrator.run.parameters import float_parameters
from vibroimpact.orchestrator.run.window import recorded_window
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.body_models.structure import MOTIONS
from vibroimpact.orchestrator.scene.sampled_names import each_of
from vibroimpact.orchestrator.study.observation import Floats

BALANCED = (
    *("energy.kinetic", "energy.potential"),
    *("energy.forcing_work", "energy.damping_loss", "energy.contact_loss"),
)
"""Variables of the time series from which the balance follows, in this order."""
SAMPLES, SAMPLES_OF_MEAN = 64, 512
"""Numbers of samples of the time series, evenly over the recording: of the balance, and of a mean energy."""


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
    samples = _samples_of(scene, BALANCED, SAMPLES)
    return float(off_balance(samples).max()) if len(samples) > 1 else math.nan


def mean_energy_of(scene: Scene) -> float:
    """Return the mean energy of the modes of a structure over the recording of a run, J; NaN where the run fails.

    It follows from the sampled motion of the modes: samples of energies take the losses of each flight, too.
    """
    body: Any = scene.body
    names = (name for motion in MOTIONS for name in each_of(f"modal_{motion}", body.size))
    samples = _samples_of(scene, tuple(names), SAMPLES_OF_MEAN)
    if not len(samples):
        return math.nan
    displacements, velocities = np.split(samples[:, 1:], 2, axis=1)
    return 0.5 * float(((displacements * body.assembly.frequencies) ** 2 + velocities**2).sum(axis=1).mean())


def _samples_of(scene: Scene, variables: Sequence[str], count: int) -> Floats:
    """Return samples of a run, the time first, shape (sample, variable); none where it fails or is given up."""
    none = np.empty((0, 1 + len(variables)))
    begin, end = recorded_window(scene, float_parameters(scene, None))
    series = {"rate": count / (end - begin), "variables": list(variables)}
    try:
        runner = open_runner(scene.with_values({"record.time_series": series}), scene.execution.how)
        try:
            record = runner.run({})
        finally:
            runner.close()
    except (ComponentError, SceneError):  # the way fails too, and its own row has the message
        return none
    samples = record.samples
    return none if samples is None or record.outcome == Outcome.timeout else samples

"""The observation of one run of a scene: its results and its time, in the same form for all ways."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset import Outcome, RunRecord
from vibroimpact.analysis.dataset.schema import OrbitClass

Floats = NDArray[np.float64]

LATE = "did not finish"
"""Failure of a run that was given up."""
IMPACT_TIME, IMPACT_VELOCITY, IMPACT_CONTACT = 0, 2, 4
"""Columns of the impacts of a `RunRecord`."""


def _no_impacts() -> Floats:
    return np.empty((0, 3))


@dataclass(frozen=True, slots=True)
class Observation:
    """The results of one run while it was recorded."""

    impacts: Floats = field(default_factory=_no_impacts)
    """Time (s), velocity (m/s), contact (1-based) of each impact, shape (impact, 3)."""
    lowest: float = math.nan
    """Smallest displacement, m; NaN where the way has none."""
    highest: float = math.nan
    """Largest displacement, m; NaN where the way has none."""
    final: tuple[float, float] = (math.nan, math.nan)
    """Displacement (m) and velocity (m/s) at the end."""
    energy_residual: float = math.nan
    """Energy that the exchange of a contact's force added, J; NaN where nothing is exchanged."""
    energy_balance: float = math.nan
    """Largest relative error of the energy balance of a body; NaN where its energies were not followed."""
    mean_energy: float = math.nan
    """Mean of kinetic and potential energy over the recording, J; NaN where it was not followed."""
    samples: Floats | None = None
    """Sampled variables of a general scene, or readings of a replay, without the time, shape (sample, variable)."""
    sample_times: Floats | None = None
    """Times of the readings of a replay, s, shape (sample,); None where all ways sample at the same instants."""
    seconds: float = math.nan
    """Wall time, s."""
    failure: str = ""
    """Why the run has no result, or why the result is invalid; empty for a valid result."""
    variance: float = math.nan
    """Least variance accounted for among the channels that a replay is compared with, percent; else NaN."""
    reached: float = math.nan
    """Simulated part of the time of a run that was given up, 0 to 1; NaN where the way does not give it."""
    held: OrbitClass = OrbitClass.unknown
    """`sticking` with infinitely many impacts (a complete chatter, or a rest on a stop), `rest` where the body rests
    for good, else `unknown`. The class of the run follows from it.
    """

    @property
    def displacement_range(self) -> float:
        """Largest minus smallest displacement, m."""
        return self.highest - self.lowest


def observation_of(record: RunRecord) -> Observation:
    """Return the observation in the record of a run, for scenes of both forms."""
    failure = ""
    if record.outcome == Outcome.timeout:
        failure = LATE
    elif record.outcome not in (Outcome.ok, Outcome.stuck):
        failure = f"{record.outcome.name}: {record.message.removeprefix(f'{record.outcome.name}: ')}"
    impacts, periods = _no_impacts(), record.periods
    if record.impacts is not None:
        impacts = record.impacts[:, [IMPACT_TIME, IMPACT_VELOCITY, IMPACT_CONTACT]]
    lowest = highest = residual = math.nan
    if periods is not None and len(periods):
        highest, lowest = float(periods[:, 0].max()), float(periods[:, 1].min())
    if record.energy_residual is not None and len(record.energy_residual):
        residual = float(np.abs(record.energy_residual).sum())
    samples = None if record.samples is None else record.samples[:, 1:]
    final = (record.final_displacement, record.final_velocity)
    return Observation(
        *(impacts, lowest, highest, final, residual),
        samples=samples,
        seconds=record.seconds,
        failure=failure,
        held=_held(record),
    )


def _held(record: RunRecord) -> OrbitClass:
    """Return the class of a run that rests for good or has infinitely many impacts, as `classify` does."""
    if record.outcome == Outcome.stuck:
        return OrbitClass.rest
    sticks = record.sticks is not None and len(record.sticks) > 0
    chatters = record.periods is not None and bool(np.isinf(record.periods[:, 4]).any())
    return OrbitClass.sticking if sticks or chatters else OrbitClass.unknown

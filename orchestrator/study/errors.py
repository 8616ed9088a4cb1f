"""Relative error of one way against the reference, per quantity; missing impacts are counted."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from vibroimpact.orchestrator.study.observation import Floats, Observation

QUANTITIES = (
    *("impact_time", "impact_velocity", "displacement_range", "final_state", "samples"),
    *("interface_energy", "energy_balance", "mean_energy"),
)
"""Quantities that have an error."""
FIRST_IMPACTS = 10
"""Number of impacts over which the growth of errors is shown where the motion is chaotic."""
CONSTANT_SPREAD = 1e-6
"""Spread of a sampled variable over its size, up to which it is constant but for rounding; above, it moves."""
LEAST_SPEED = 1e-3
"""Speed of an impact over the fastest speed, below which it is not compared: ways end a chatter differently."""


@dataclass(frozen=True, slots=True)
class Scales:
    """Scales to which errors are relative."""

    time: float
    """The forcing period, or the recorded time of an unforced scene, s."""
    window: tuple[float, float]
    """Start and end of the recording, s: one way may have an impact at an edge that another way lacks."""
    masses: tuple[float, ...] = ()
    """Mass that hits each stop, kg: energy errors are relative to the energy of the impacts; empty if unknown."""


@dataclass(frozen=True, slots=True)
class Errors:
    """The errors of a way."""

    of: Mapping[str, float]
    """Relative error by quantity; NaN where the way or the reference has no value."""
    failure: str
    """Failure of the way, or its missing and extra impacts, in words; empty where all impacts match."""
    growth: Floats
    """Relative error of the velocity of each compared impact, in their order, shape (impact,)."""
    remark: str = ""
    """Numbers of impacts, in words, where motions are compared as a whole; else empty."""

    def worst(self, quantity: str = "all") -> float:
        """Return the error of a quantity, or the largest of all known errors; NaN where none is known."""
        if quantity != "all":
            return self.of[quantity]
        known = [error for error in self.of.values() if not math.isnan(error)]
        return max(known, default=math.nan)


def no_errors(failure: str) -> Errors:
    """Return the errors of a way that has no results."""
    return Errors(dict.fromkeys(QUANTITIES, math.nan), failure, np.empty(0))


def errors_of(
    found: Observation, reference: Observation, scales: Scales, *, impacts: int | None = None
) -> Errors:
    """Return the errors of the observation of a way against the reference.

    `impacts` is the number of first impacts to compare, without the motion: chaos leaves only these comparable.
    """
    if found.failure:
        return no_errors(found.failure)
    pairs, failure = matched(found.impacts, reference.impacts, scales, impacts)
    own, other = found.impacts[pairs[:, 0]], reference.impacts[pairs[:, 1]]
    errors = dict.fromkeys(QUANTITIES, math.nan)
    growth = np.empty(0)
    if len(pairs):
        speed = float(np.abs(reference.impacts[:, 1]).max())
        errors["impact_time"] = float(np.abs(own[:, 0] - other[:, 0]).max()) / scales.time
        growth = np.abs(own[:, 1] - other[:, 1]) / speed if speed > 0.0 else growth
        errors["impact_velocity"] = float(growth.max()) if growth.size else math.nan
    if impacts is None:
        errors |= _errors_of_motion(found, reference, scales)
    errors["interface_energy"] = _error_of_energy(found, reference, scales)
    errors["energy_balance"] = found.energy_balance
    return Errors(errors, failure, growth)


def errors_as_a_whole(found: Observation, reference: Observation) -> Errors:
    """Return the errors of range and mean energy alone, for motions whose impacts do not correspond."""
    if found.failure:
        return no_errors(found.failure)
    errors = dict.fromkeys(QUANTITIES, math.nan)
    for name in ("displacement_range", "mean_energy"):
        size = getattr(reference, name)
        if size > 0.0:
            errors[name] = abs(getattr(found, name) - size) / size
    counts = f"{len(found.impacts)} impacts, {len(reference.impacts)} of the reference"
    return Errors(errors, "", np.empty(0), counts)


def _errors_of_motion(found: Observation, reference: Observation, scales: Scales) -> dict[str, float]:
    size, errors = reference.displacement_range, {}
    rate = 2.0 * math.pi / scales.time
    if size > 0.0:
        errors["displacement_range"] = abs(found.displacement_range - size) / size
    else:  # an unforced scene has no extremes; its final state gives the size of the motion
        size = math.hypot(reference.final[0], reference.final[1] / rate)
    if 0.0 < size < math.inf:
        off = np.abs(np.subtract(found.final, reference.final)) / (size, size * rate)
        errors["final_state"] = float(off.max())
    samples, expected = found.samples, _at_the_instants_of(found, reference)
    if samples is not None and expected is not None and expected.size and samples.shape == expected.shape:
        spread, size = np.ptp(expected, axis=0), np.abs(expected).max(axis=0)
        scale = np.where(spread > CONSTANT_SPREAD * size, spread, size)  # size of a constant variable
        off = np.abs(samples - expected).max(axis=0)
        moving = scale > 0.0
        errors["samples"] = float((off[moving] / scale[moving]).max()) if moving.any() else math.nan
    return errors


def _error_of_energy(found: Observation, reference: Observation, scales: Scales) -> float:
    """Return the energy that the exchange of forces added, over the kinetic energy of all impacts."""
    impacts = reference.impacts
    if not len(impacts) or impacts[:, 2].max() > len(scales.masses):
        return math.nan
    masses = np.array(scales.masses)[impacts[:, 2].astype(int) - 1]
    energy = 0.5 * float(masses @ impacts[:, 1] ** 2)
    return found.energy_residual / energy if energy > 0.0 else math.nan


def _at_the_instants_of(found: Observation, reference: Observation) -> Floats | None:
    """Return the samples of the reference at the instants of `found`, by linear interpolation."""
    own, times, samples = reference.sample_times, found.sample_times, reference.samples
    if samples is None or own is None or times is None or np.array_equal(own, times):
        return samples
    return np.column_stack([np.interp(times, own, column) for column in samples.T])


def matched(
    found: Floats, reference: Floats, scales: Scales, most: int | None = None
) -> tuple[np.ndarray, str]:
    """Return the pairs of equal impacts, as places in both, and the missing and extra impacts, in words.

    Impacts are in the order of time, shape (impact, 3): time, velocity, contact. `most` limits the comparison to the
    first impacts of each.
    """
    own, other = _compared(found), _compared(reference)
    if most is not None:
        other = other[:most]
        own = own[:most]
    pairs: list[tuple[int, int]] = []
    if len(other):
        gap = _reach(reference[other], scales)
        taken, times = 0, found[own, 0]
        for j in other:
            time = reference[j, 0]
            first = max(taken, int(np.searchsorted(times, time - gap, "left")))
            last = int(np.searchsorted(times, time + gap, "right"))
            same = [place for place in range(first, last) if found[own[place], 2] == reference[j, 2]]
            if same:
                best = min(same, key=lambda place: abs(times[place] - time))
                pairs.append((int(own[best]), int(j)))
                taken = best + 1
    margin = max((abs(found[i, 0] - reference[j, 0]) for i, j in pairs), default=0.0) * 2.0 + 1e-9
    missed = _inside(reference, other, {j for _, j in pairs}, scales, margin)
    extra = 0 if most is not None else _inside(found, own, {i for i, _ in pairs}, scales, margin)
    words = []
    if missed:
        words.append(f"missed {missed} of {len(other)} impacts")
    if extra:
        words.append(f"{extra} impact{'s' if extra > 1 else ''} that {'are' if extra > 1 else 'is'} none")
    return np.array(pairs, dtype=int).reshape(-1, 2), ", ".join(words)


def _compared(impacts: Floats) -> np.ndarray:
    if not len(impacts):
        return np.empty(0, dtype=int)
    speeds = np.abs(impacts[:, 1])
    if np.isnan(speeds).all():
        return np.arange(len(impacts))
    return np.flatnonzero(speeds >= LEAST_SPEED * np.nanmax(speeds))


def _reach(impacts: Floats, scales: Scales) -> float:
    """Return the largest time between two equal impacts: half of the shortest interval, s."""
    intervals = np.diff(impacts[:, 0])
    intervals = intervals[intervals > 1e-9 * scales.time]
    return 0.5 * min(float(intervals.min()) if intervals.size else math.inf, scales.time)


def _inside(impacts: Floats, places: np.ndarray, known: set[int], scales: Scales, margin: float) -> int:
    begin, end = scales.window
    return sum(1 for i in places if int(i) not in known and begin + margin < impacts[i, 0] < end - margin)

"""Successive extremes of two signals, compared one by one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

PROMINENCE = 0.5
"""Smallest prominence of an extreme, relative to the largest value in the window; ripple is less prominent."""
NEIGHBOUR = 0.25
"""Smallest distance of two extremes of one sign, and largest distance of a pair, in periods."""
REACH = 0.125
"""Distance up to which samples contribute to the height of an extreme, in periods."""


@dataclass(frozen=True, slots=True)
class PeakErrors:
    """Extremes of a measured and of a simulated signal, paired by their instants.

    Attributes
    ----------
    time : ndarray of float, shape (peak,)
        Instants of the measured extremes, s, maxima and minima in order.
    measured, simulated : ndarray of float, shape (peak,)
        Heights above the rest value: the vertex of the best parabola through the samples within an eighth of a period
        on either side. The highest sample alone would be too high by the ripple on it.
    delay : ndarray of float, shape (peak,)
        Instant of the simulated minus that of the measured extreme, s.
    unpaired : int
        Number of measured extremes without a simulated one.
    """

    time: Floats
    measured: Floats
    simulated: Floats
    delay: Floats
    unpaired: int

    @property
    def relative_error(self) -> Floats:
        """Error of each simulated extreme relative to the measured one, shape (peak,)."""
        return self.simulated / self.measured - 1.0

    @property
    def worst(self) -> float:
        """Largest absolute relative error; NaN without peaks."""
        return float(np.max(np.abs(self.relative_error), initial=-np.inf)) if len(self.time) else float("nan")


def compare_peaks(
    time: Floats,
    measured: Floats,
    simulated: Floats,
    good: Flags,
    window: tuple[float, float],
    period: float,
    level: float = 0.0,
) -> PeakErrors:
    """Compare the extremes within a window.

    A measured extreme at or next to a sample that is not good is left out: a clipped peak has no height.

    Parameters
    ----------
    time, measured, simulated : ndarray of float, shape (sample,)
        s; two signals in one unit.
    good : ndarray of bool, shape (sample,)
        Measured samples that count.
    window : tuple of float
        Start and stop, s.
    period : float
        Dominant period, s.
    level : float
        Rest value of the measured signal, from which heights are measured.
    """
    measured, simulated = measured - level, simulated - level
    finite = np.isfinite(measured) & np.isfinite(simulated)
    # one period more on either side, so that an extreme next to the edge is found
    wide = finite & (time >= window[0] - period) & (time <= window[1] + period)
    rows = np.flatnonzero(wide)
    if len(rows) < 3:
        return PeakErrors(np.empty(0), np.empty(0), np.empty(0), np.empty(0), 0)
    clock = time[rows]
    inside = (clock >= window[0]) & (clock <= window[1])
    found = _extremes(clock, measured[rows], inside, period)
    usable = good[rows]
    trusted = [place for place in found if np.all(usable[max(place - 1, 0) : place + 2])]
    others = _extremes(clock, simulated[rows], np.ones(len(rows), bool), period)
    columns = _pairs(
        [_vertex(clock, measured[rows], usable, place, period) for place in trusted],
        [_vertex(clock, simulated[rows], usable, place, period) for place in others],
        NEIGHBOUR * period,
    )
    return PeakErrors(
        columns[:, 0],
        columns[:, 1],
        columns[:, 3],
        columns[:, 2] - columns[:, 0],
        len(trusted) - len(columns),
    )


def _pairs(points: list[tuple[float, float]], others: list[tuple[float, float]], tolerance: float) -> Floats:
    """Return rows of instant and value of a point, and of the nearest other of its sign, shape (pair, 4)."""
    pairs = []
    for when, value in points:
        alike = [other for other in others if other[1] * value > 0.0 and abs(other[0] - when) <= tolerance]
        if alike:
            pairs.append((when, value, *min(alike, key=lambda other: abs(other[0] - when))))
    return np.array(pairs).reshape(-1, 4)


def _extremes(time: Floats, values: Floats, inside: Flags, period: float) -> list[int]:
    """Return the rows of maxima above and minima below zero, in order."""
    from scipy.signal import find_peaks

    if not np.any(inside):
        return []
    interval = float(np.median(np.diff(time)))
    distance = max(1, round(NEIGHBOUR * period / interval))
    prominence = PROMINENCE * float(np.max(np.abs(values[inside])))
    found: list[int] = []
    for sign in (1.0, -1.0):
        places, _ = find_peaks(sign * values, prominence=prominence, distance=distance)
        found += [int(place) for place in places if inside[place] and sign * values[place] > 0.0]
    return sorted(found)


def _vertex(time: Floats, values: Floats, usable: Flags, place: int, period: float) -> tuple[float, float]:
    """Return instant and value of the vertex of the parabola nearest to the usable samples around an extreme."""
    interval = float(np.median(np.diff(time)))
    reach = max(1, round(REACH * period / interval))
    near = np.arange(max(place - reach, 0), min(place + reach + 1, len(time)))
    near = near[usable[near]]
    if len(near) < 3:
        return float(time[place]), float(values[place])
    age = (time[near] - time[place]) / (reach * interval)
    bend, slope, height = np.polyfit(age, values[near], 2)
    if bend * values[place] >= 0.0 or abs(slope) > 2.0 * abs(bend):
        # no extreme of the samples' own sign, or one outside the samples
        return float(time[place]), float(values[place])
    shift = -0.5 * slope / bend
    return float(time[place] + shift * reach * interval), float(height + 0.5 * slope * shift)

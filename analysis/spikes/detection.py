"""Excursions of a signal past a threshold, and their groups: one spike with the ringing that it caused.

Thesis sections 5.2.2 and 5.2.5; equations (5.2) and (5.3).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

#: Distance, in lengths of the main excursion, below which an excursion less than half as high is its ringing. Contacts
#: this close would fill a tenth of the time, four times the limit of the rigid-impact model (thesis section 5.2.4).
RINGING_LENGTHS = 10.0
#: Distance, in the same lengths, below which an excursion of comparable height is ringing; smallest comparable ratio.
_AT_ONCE, _COMPARABLE = 2.0, 0.5
#: Longest pause of beating ringing, relative to the group's duration, and the height below which it is allowed.
_BEATS, _BEATS_BELOW = 0.5, 0.1


@dataclass(frozen=True, slots=True)
class Excursions:
    """Stretches in which a statistic passed a threshold, in order.

    Attributes
    ----------
    first, last : ndarray of int, shape (excursion,)
        First and last sample above the lower threshold.
    up, down : ndarray of float, shape (excursion,)
        First upward and last downward crossing of the threshold, s, linear between samples.
    peak : ndarray of float, shape (excursion,)
        Largest value of the statistic.
    samples : ndarray of int, shape (excursion,)
        Samples above the threshold.
    """

    first: Indices
    last: Indices
    up: Floats
    down: Floats
    peak: Floats
    samples: Indices

    def __len__(self) -> int:
        """Return the number of excursions."""
        return len(self.first)


@dataclass(frozen=True, slots=True)
class Group:
    """Excursions that form one spike: numbers of the first, the largest and the last of them."""

    first: int
    main: int
    last: int


def find_excursions(time: Floats, statistic: Floats, threshold: float, hysteresis: float) -> Excursions:
    """Return the excursions past a threshold.

    An excursion begins where the statistic rises past `threshold`. It ends where the statistic falls below
    `hysteresis * threshold`, so that noise on its flank does not split it, or where the sign changes. The statistic is
    signed, and its magnitude is compared; time is in s.
    """
    magnitude = np.abs(statistic)
    low = (magnitude > hysteresis * threshold) * np.where(statistic < 0.0, -1, 1)
    edges = np.flatnonzero(np.diff(low)) + 1
    starts = np.concatenate(([0], edges)).astype(np.intp)
    stops = np.concatenate((edges, [len(low)])).astype(np.intp)
    above = np.concatenate(([0], np.cumsum(magnitude > threshold)))
    samples = np.where(low[starts] != 0, above[stops] - above[starts], 0)
    chosen = samples > 0
    starts, stops, samples = starts[chosen], stops[chosen], samples[chosen]
    rows = [
        _crossings(time, magnitude, int(a), int(b), threshold) for a, b in zip(starts, stops, strict=True)
    ]
    up, down, peak = np.array(rows, dtype=np.float64).reshape(-1, 3).T
    return Excursions(starts, stops - 1, up, down, peak, samples)


def _crossings(
    time: Floats, magnitude: Floats, start: int, stop: int, threshold: float
) -> tuple[float, float, float]:
    """Return the crossings of the threshold (s) and the peak of one excursion."""
    part = magnitude[start:stop]
    high = np.flatnonzero(part > threshold)
    first, last = start + int(high[0]), start + int(high[-1])
    up = crossing(time, magnitude, first - 1, first, threshold)
    down = crossing(time, magnitude, last, last + 1, threshold)
    return up, down, float(part.max())


def crossing(time: Floats, values: Floats, before: int, after: int, level: float) -> float:
    """Return the time at which the line between two neighbouring samples crosses a level, s; record ends are crossings.

    >>> crossing(np.array([0.0, 1.0]), np.array([0.0, 4.0]), 0, 1, 1.0)
    0.25
    """
    if before < 0:
        return float(time[0])
    if after >= len(time):
        return float(time[-1])
    low, high = float(values[before]), float(values[after])
    part = 0.5 if high == low else min(1.0, max(0.0, (level - low) / (high - low)))
    return float(time[before] + part * (time[after] - time[before]))


def group_excursions(
    found: Excursions, time: Floats, merge: float | None, minimum_samples: int
) -> tuple[list[Group], int]:
    """Return each spike with its ringing, and the number of excursions in groups with too few samples.

    An excursion joins the group before it if it begins within `merge` (s) of the end of its last excursion. None means
    ten lengths of the group's largest excursion if the new one is less than half as high, otherwise two. The distance
    is longer for small excursions after long ringing. A group with fewer than `minimum_samples` above the threshold,
    over all its half cycles, is no spike (thesis 5.3: four).
    """
    groups: list[Group] = []
    begins, ends = time[found.first], time[found.last]
    for place in range(len(found)):
        group = groups[-1] if groups else None
        if group is None or begins[place] - ends[group.last] > _reach(found, time, group, place, merge):
            groups.append(Group(place, place, place))
            continue
        main = place if found.peak[place] > found.peak[group.main] else group.main
        groups[-1] = Group(group.first, main, place)
    samples = np.concatenate(([0], np.cumsum(found.samples)))
    long = [one for one in groups if samples[one.last + 1] - samples[one.first] >= minimum_samples]
    return long, len(found) - sum(one.last - one.first + 1 for one in long)


def _reach(found: Excursions, time: Floats, group: Group, place: int, merge: float | None) -> float:
    """Return the time after a group within which an excursion still belongs to it, s."""
    if merge is not None:
        return merge
    length = float(time[found.last[group.main]] - time[found.first[group.main]])
    smaller = found.peak[place] < _COMPARABLE * found.peak[group.main]
    reach = (RINGING_LENGTHS if smaller else _AT_ONCE) * length
    if found.peak[place] < _BEATS_BELOW * found.peak[group.main]:
        reach = max(reach, _BEATS * float(time[found.last[group.last]] - time[found.first[group.first]]))
    return reach

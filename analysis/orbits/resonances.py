"""Resonances of impacting bodies: peaks along a sweep of the forcing frequency, and shifted natural frequencies.

A mass that turns back at an elastic stop moves on a cut ellipse, and needs less than a whole natural period: thesis
(2.34), (2.35). This is exact without force and damping, for one mode and restitution 1. Otherwise it is a first
guess, for comparison with the peaks of a sweep.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.errors import UsageError

Floats = NDArray[np.float64]

_OVERSHOOT = 1e-9
"""Largest excess over 1 of the ratio of a touched stop that counts as rounding."""
PROMINENCE = 0.05
"""Height of a peak above the valleys on both of its sides, over the largest value, above which it counts."""


def frequency_shift(stop_ratio: Floats | float) -> Floats:
    """Return impacting over natural frequency of an elastic, undamped, unforced oscillator: thesis (2.35).

    Parameters
    ----------
    stop_ratio : float or array
        Position of the stop over the deepest excursion on the other side, both from the equilibrium: -1 < ratio <= 1.
        1: the stop is just touched; 0: at the equilibrium; negative: the body is pressed on the stop at rest.

    Returns
    -------
    array
        pi / arccos(-ratio): 1 for a touch, 2 for a stop at the equilibrium. Its slope is unbounded at both ends.

    Raises
    ------
    UsageError
        No such motion exists for a ratio.

    Examples
    --------
    >>> print(frequency_shift([1.0, 0.25, 0.0]).round(6))
    [1.       1.722859 2.      ]
    """
    ratio = np.asarray(stop_ratio, dtype=np.float64)
    fine = (ratio > -1.0) & (ratio <= 1.0 + _OVERSHOOT)
    if not fine.all():
        raise UsageError(f"frequency_shift: stop_ratio: expected -1 < ratio <= 1, got {_first(ratio, fine)}.")
    return np.asarray(np.pi / np.arccos(-np.minimum(ratio, 1.0)))


def stop_ratio(shift: Floats | float) -> Floats:
    """Return the stop ratio for a shift of the natural frequency, the inverse of `frequency_shift`.

    Parameters
    ----------
    shift : float or array
        Impacting over natural frequency, 1 or more.

    Returns
    -------
    array
        -cos(pi / shift). Near shift 1 its error is the square of the error of the shift.

    Raises
    ------
    UsageError
        A shift is below 1.

    Examples
    --------
    >>> print(stop_ratio([1.0, 2.0, 1.72285878782861]).round(12) + 0.0)
    [1.   0.   0.25]
    """
    given = np.asarray(shift, dtype=np.float64)
    fine = (given >= 1.0 - _OVERSHOOT) & np.isfinite(given)
    if not fine.all():
        raise UsageError(f"stop_ratio: shift: expected 1 or more, got {_first(given, fine)}.")
    return np.asarray(-np.cos(np.pi / np.maximum(given, 1.0)))


def _first(values: Floats, fine: NDArray[np.bool_]) -> str:
    return f"{np.atleast_1d(values)[~np.atleast_1d(fine)][0]:g}"


@dataclass(frozen=True, slots=True)
class Peak:
    """A peak of a response over the forcing frequency.

    Attributes
    ----------
    place : int
        Index of the highest point.
    frequency, height : float
        Top of the parabola through this point and its neighbours, in the units of both.
    step : float
        Distance of the farther neighbour: the possible error of the frequency.
    """

    place: int
    frequency: float
    height: float
    step: float


def peaks_of(frequency: Floats, response: Floats, prominence: float = PROMINENCE) -> list[Peak]:
    """Return the peaks of a response, the lowest frequency first.

    Parameters
    ----------
    frequency, response : array, shape (point,)
        Ascending; NaN without a response, which ends a stretch: nothing is known beyond it.
    prominence : float
        Smallest height of a peak above the higher of the two valleys to higher peaks, over the largest response.

    Examples
    --------
    >>> rate = np.linspace(0.0, 3.0, 301)
    >>> [round(peak.frequency, 3) for peak in peaks_of(rate, 1.0 / (0.1 + (rate - 1.234) ** 2))]
    [1.234]
    """
    from scipy.signal import find_peaks  # some tenths of a second

    known = np.flatnonzero(np.isfinite(response))
    if not known.size:
        return []
    least = prominence * float(np.abs(response[known]).max())
    found = []
    for stretch in np.split(known, np.flatnonzero(np.diff(known) > 1) + 1):
        if stretch.size < 3:
            continue
        places, _ = find_peaks(response[stretch], prominence=least)
        found += [_peak(frequency, response, int(stretch[place])) for place in places]
    return found


def _peak(frequency: Floats, response: Floats, place: int) -> Peak:
    x, y = frequency[place - 1 : place + 2], response[place - 1 : place + 2]
    left, right = (y[1] - y[0]) / (x[1] - x[0]), (y[2] - y[1]) / (x[2] - x[1])
    bend = (right - left) / (x[2] - x[0])
    step = float(np.diff(x).max())
    # a plateau has no bend
    top = float(x[1]) if bend == 0.0 else float(0.5 * (x[0] + x[1]) - 0.5 * left / bend)
    top = float(np.clip(top, x[0], x[2]))
    height = float(y[1] + (top - x[1]) * (left + bend * (top - x[0]))) if bend else float(y[1])
    return Peak(place, top, height, step)

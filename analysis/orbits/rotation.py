"""Quasi-periodic motion: its rotation number, and the closed curves that it draws in the strobe section.

The states of a quasi-periodic motion are a function of an angle that grows by the rotation number each period
(equations.md 4.15). Weighted Birkhoff averages find the rotation number (Das, Saiki, Sander and Yorke 2017). They
converge faster than any power of the number of periods for such a motion, and slowly for chaos. The states in the
order of their angles show whether they are a function of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

FEWEST_STATES = 100
"""Smallest number of states on each curve, in each turn of the angle, that tells quasi-periodic motion."""
MOST_CURVES = 64
"""Largest number of curves that a motion visits one after the other."""
LINES, MOST_TURNS = 3, 3
"""Number of strongest spectral lines that are tried, and turns of the angle in which a line may turn once."""
MOST_DIGITS = 10
"""Largest number of digits of a rotation number in words."""
CONSTANT = 1e-9
"""Range of a quantity, over its size, below which it is constant."""
MISPLACED = 3.0
"""Error of a frequency, times the square of the number of states, above which the order of their angles is unknown."""
DRIFT = 1e-2
"""Change of a line's amplitude between both halves of a motion above which the motion is a transient."""
LEAST_FALL = 5.0
"""Fall of the distance from the curve, from half of the states to all of them, that a closed curve has at least.

Distances of chaotic states do not fall; those of a smooth curve fall by 16.
"""
FARTHEST = 0.01
"""Largest distance of states from the curve, over its size."""
ROUNDING = 1e-5
"""Distance of states from the curve, over its size, that counts as rounding, or as the rest of a transient."""
SEPARATE = 3.0
"""Median distance of two curves, over that of neighbouring states of one, above which they are two."""
EXPLAINED = 1e-3
"""Largest distance of states from the curve, over its size, that the error of a rotation number explains."""
CORNERS = 0.2
"""Share of the states that may be next to a corner of the curve, where an impact touches a stop."""
SWEPT = np.array([8.0, 8.0, 8.0, 8.0, 4.0, 4.0, 4.0, 4.0, 0.2])
"""Least angle that the states sweep beside a resonance p/q, over 1/q, for q = 1, 2, ..., and for all larger q.

A motion that sweeps less may be locked to the resonance. Spectral lines next to each other give no rotation number.
"""
FEWEST_OF_RESONANCE = 8
"""Number of states for each of the q of a resonance below which the resonance is too long to matter."""


@dataclass(frozen=True, slots=True)
class Rotation:
    """The rotation number of a quasi-periodic motion.

    Attributes
    ----------
    number : float
        Turns along a curve from a state to the next one on this curve, 0 to 0.5: the direction is not known.
    error : float
        Difference of the numbers of both halves of the motion.
    curves : int
        Number of closed curves in the strobe section. The motion visits them one after the other, a period each.
    """

    number: float
    error: float
    curves: int = 1

    @property
    def text(self) -> str:
        """The rotation number in words.

        >>> Rotation(0.38196601125, 2e-9).text, Rotation(0.21, 1e-4, 4).text
        ('rotation number 0.381966011 +- 2e-09', 'rotation number 0.2100 +- 1e-04 on 4 curves')
        """
        error = max(self.error, 1e-15)
        digits = int(np.clip(np.ceil(-np.log10(error)), 1, MOST_DIGITS))
        where = f" on {self.curves} curves" if self.curves > 1 else ""
        return f"rotation number {self.number:.{digits}f} +- {error:.0e}{where}"


def rotations_in_words(rotations: Sequence[Rotation]) -> str:
    """Return the rotation number of one motion, or the range of those of several, in words; empty without any.

    >>> rotations_in_words([Rotation(0.25, 1e-3, 2), Rotation(0.5, 1e-3, 4)])
    'rotation numbers 0.25 to 0.5 on 2 to 4 curves'
    """
    if len(set(rotations)) <= 1:
        return rotations[0].text if rotations else ""
    numbers, curves = [each.number for each in rotations], [each.curves for each in rotations]
    where = f" on {min(curves)} to {max(curves)} curves" if max(curves) > 1 else ""
    return f"rotation numbers {min(numbers):.6g} to {max(numbers):.6g}{where}"


def rotation_of(states: Floats, known: float | None = None) -> Rotation | None:
    """Return the rotation number of a motion; None where its states are on no closed curves: equations.md 4.15.

    Parameters
    ----------
    states : array, shape (period, quantity)
        Quantities of consecutive forcing periods, finite; displacement and velocity at forcing phase 0 are enough.
    known : float or None
        Turns of a second sine in a forcing period, of which the states may be a function.

    Examples
    --------
    >>> angle = 2.0 * np.pi * np.arange(500) * (3.0 - np.sqrt(5.0)) / 2.0
    >>> found = rotation_of(np.column_stack([np.cos(angle), np.sin(angle) + 0.3 * np.cos(2.0 * angle)]))
    >>> round(found.number, 9), found.error < 1e-8
    (0.381966011, True)
    """
    low, high = states.min(axis=0), states.max(axis=0)
    moves = high - low > CONSTANT * np.abs(states).max(axis=0)
    if not moves.any():
        return None
    scaled = (states[:, moves] - low[moves]) / (high - low)[moves]
    least = np.inf
    for curves in range(1, min(MOST_CURVES, len(states) // FEWEST_STATES) + 1):
        parts = [scaled[place::curves] for place in range(curves)]
        size = float(np.ptp(parts[0], axis=0).max())
        for number, error in _candidates(parts[0], [] if known is None else [(curves * known % 1.0, 0.0)]):
            off, is_curve = _fit(parts[0], number, error)
            # more curves, or more turns, count only where the states are far from fewer
            is_free = _is_far_from_resonances(number, len(parts[0]))
            if (
                is_curve
                and is_free
                and least > FARTHEST * size
                and all(_fit(part, number, error)[1] for part in parts[1:])
            ):
                if curves > 1 and _overlap(parts[0], parts[1]):
                    return None  # one curve, too rough for the number of its states
                folded = number % 1.0
                return Rotation(min(folded, 1.0 - folded), error, curves)
            if (
                is_free or curves == 1
            ):  # the states of a resonance of the curves are near each other for any number
                least = min(least, off)
    return None


def _candidates(states: Floats, known: list[tuple[float, float]]) -> Iterator[tuple[float, float]]:
    """Yield rotation numbers that known and the strongest spectral lines of states may belong to, with their errors."""
    signal = states[:, 0] + 1j * states[:, min(1, states.shape[1] - 1)]
    found = [*known, *_lines(signal)]
    for turns in range(1, min(MOST_TURNS, len(states) // FEWEST_STATES) + 1):
        for frequency, error in found:
            for turn in range(turns):
                yield (frequency + turn) / turns, error / turns


def _lines(signal: Complexes) -> Iterator[tuple[float, float]]:
    """Yield the frequencies of the strongest lines, 1 / period, with their errors; none where the strongest changes."""
    count = len(signal)
    window = _window(count)
    moving = signal - window @ signal
    sizes = np.abs(np.fft.fft(window * moving, 2 * count))
    tops = np.flatnonzero((sizes >= np.roll(sizes, 1)) & (sizes > np.roll(sizes, -1)))
    half = count // 2
    for place, top in enumerate(tops[np.argsort(-sizes[tops])][:LINES]):
        near = float(top) / (2 * count)
        frequency, drift = _frequency(moving, near)
        error = abs(_frequency(moving[:half], near)[0] - _frequency(moving[-half:], near)[0])
        if error * count**2 < MISPLACED and drift <= DRIFT:
            yield frequency, error
        elif place == 0:
            return


def _frequency(signal: Complexes, near: float) -> tuple[float, float]:
    """Return the frequency of a line by the turn of its average between two halves, and the change of its size."""
    half = len(signal) // 2
    turning = signal * np.exp(-2j * np.pi * near * np.arange(len(signal)))
    window = _window(half)
    early, late = window @ turning[:half], window @ turning[-half:]
    if early == 0.0 or late == 0.0:
        return near, np.inf
    passed = len(signal) - half
    turned = float(np.angle(late / early)) / (2.0 * np.pi * passed)
    return near + turned, abs(abs(late) / abs(early) - 1.0)


def _window(count: int) -> Floats:
    """Return the weights exp(-1 / (t (1 - t))) of a weighted Birkhoff average, t from 0 to 1."""
    place = (np.arange(count) + 0.5) / count
    weights = np.exp(-1.0 / (place * (1.0 - place)))
    return np.asarray(weights / weights.sum())


def _fit(states: Floats, number: float, error: float) -> tuple[float, bool]:
    """Return the distance of states from a curve, and whether they are a function of an angle.

    The angle grows by the rotation number from each state to the next, and its error by the error of this number.
    """
    angles, half = np.mod(number * np.arange(len(states)), 1.0), len(states) // 2
    size = float((states.max(axis=0) - states.min(axis=0)).max())
    off, off_half = _from_curve(states, angles), _from_curve(states[:half], angles[:half])
    explained = float(np.clip(2.0 * np.pi * error * len(states), ROUNDING, EXPLAINED)) * size
    largest = min(max(off_half / LEAST_FALL, explained), FARTHEST * size)
    return off, off <= largest


def _is_far_from_resonances(number: float, count: int) -> bool:
    """Tell whether some states that turn by a rotation number are locked to no resonance."""
    turns = np.arange(1, count // FEWEST_OF_RESONANCE)
    swept = count * np.abs(number * turns - np.round(number * turns))
    return bool((swept >= SWEPT[np.minimum(turns, SWEPT.size) - 1]).all())


def _overlap(one: Floats, other: Floats) -> bool:
    """Tell whether the states of two parts lie on one curve: those of one are as near to the other as to themselves."""
    few = slice(None, FEWEST_STATES)
    across = np.abs(one[few, None] - other[None]).max(axis=2).min(axis=1)
    within = np.abs(one[few, None] - one[None]).max(axis=2)
    within[np.arange(len(within)), np.arange(len(within))] = np.inf
    return bool(np.median(across) < SEPARATE * np.median(within.min(axis=1)))


def _from_curve(states: Floats, angles: Floats) -> float:
    """Return the distance of states from the curve through the two states on either side."""
    order = np.argsort(angles)
    turn = angles[order]
    steps = np.array([-2, -1, 1, 2])
    places = np.arange(len(states))[:, None] + steps
    at = np.mod(turn[places % len(states)] - turn[:, None] + 0.5, 1.0) - 0.5
    weights = np.ones_like(at)
    with np.errstate(divide="ignore", invalid="ignore"):
        for one in range(4):
            for other in range(4):
                if one != other:
                    weights[:, one] *= at[:, other] / (at[:, other] - at[:, one])
    near = states[order][places % len(states)]
    # angles that nearly coincide have weights without bound
    lowest, highest = near.min(axis=1), near.max(axis=1)
    between = np.clip(np.einsum("ij,ijk->ik", weights, near), 2.0 * lowest - highest, 2.0 * highest - lowest)
    off = np.abs(between - states[order]).max(axis=1)
    return float(np.quantile(np.where(np.isnan(off), np.inf, off), 1.0 - CORNERS, method="lower"))

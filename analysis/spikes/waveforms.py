"""Contact force over time as simple curves: half-sine, haversine and bell, fitted to pulses.

Thesis section 5.3.1; a is the peak, u the time from the middle of the pulse:

    half-sine   a cos(pi u / length)        for |u| < length / 2.
    haversine   a cos^2(pi u / length)      for |u| < length / 2.
    bell        a exp(-u^2 / (2 length^2))  for all u, whose limit of short length is Dirac's function.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_POINTS = 33
_ITERATIONS = 25
_SMALLEST_LEVEL = 1e-9


@dataclass(frozen=True, slots=True)
class Waveform:
    """A curve of unit peak and unit length, and its integrals."""

    value: Callable[[Floats], Floats]
    """Value as a function of the time from its middle, in units of its length."""
    slope: Callable[[Floats], Floats]
    """Its derivative."""
    half_width: Callable[[Floats], Floats]
    """Half of its width at a level (share of the peak), in units of its length."""
    part_above: Callable[[Floats], Floats]
    """Share of its impulse between its two crossings of a level, the part below the level included."""
    impulse: float
    """Whole impulse over peak times length."""


def _inside(time: Floats) -> Floats:
    return np.asarray(np.abs(time) < 0.5, dtype=np.float64)


def _haversine_part(level: Floats) -> Floats:
    angle = np.arccos(np.sqrt(level))
    part: Floats = 2.0 / np.pi * (angle + np.sin(angle) * np.cos(angle))
    return part


def _bell_part(level: Floats) -> Floats:
    from scipy.special import erf

    part: Floats = erf(np.sqrt(-np.log(level)))
    return part


WAVEFORMS = {
    "half_sine": Waveform(
        lambda time: np.cos(np.pi * time) * _inside(time),
        lambda time: -np.pi * np.sin(np.pi * time) * _inside(time),
        lambda level: np.arccos(level) / np.pi,
        lambda level: np.sqrt(1.0 - level**2),
        2.0 / np.pi,
    ),
    "haversine": Waveform(
        lambda time: np.cos(np.pi * time) ** 2 * _inside(time),
        lambda time: -np.pi * np.sin(2.0 * np.pi * time) * _inside(time),
        lambda level: np.arccos(np.sqrt(level)) / np.pi,
        _haversine_part,
        0.5,
    ),
    "bell": Waveform(
        lambda time: np.exp(-0.5 * time**2),
        lambda time: -time * np.exp(-0.5 * time**2),
        lambda level: np.sqrt(-2.0 * np.log(level)),
        _bell_part,
        float(np.sqrt(2.0 * np.pi)),
    ),
}


@dataclass(frozen=True, slots=True)
class WaveformFit:
    """One curve fitted to every pulse.

    Attributes
    ----------
    peak, middle, length : ndarray of float, shape (spike,)
        SI unit, s, s; NaN for a pulse with too few samples for three unknowns.
    goodness : ndarray of float, shape (spike,)
        1 - (squares of the residual) / (squares about the mean) within the pulse.
    squares : ndarray of float, shape (spike,)
        Mean square of the residual, SI unit squared.
    """

    peak: Floats
    middle: Floats
    length: Floats
    goodness: Floats
    squares: Floats


def fit_waveforms(pulses: list[tuple[Floats, Floats]], levels: Floats) -> dict[str, WaveformFit]:
    """Fit each curve to each pulse by least squares.

    All pulses are fitted at once: each is read at 33 instants, and a Gauss-Newton step is one solution of 3 by 3
    systems. A pulse has instants (s) and values, from one crossing of its level (a share of the peak) to the next.
    """
    if not pulses:
        empty = np.zeros(0)
        return {name: WaveformFit(empty, empty, empty, empty, empty) for name in WAVEFORMS}
    begin = np.array([time[0] for time, _ in pulses])
    width = np.array([time[-1] - time[0] for time, _ in pulses])
    place = np.linspace(-0.5, 0.5, _POINTS)
    values = np.stack(
        [np.interp(time[0] + (place + 0.5) * (time[-1] - time[0]), time, value) for time, value in pulses]
    )
    enough = np.array([len(time) >= 6 for time, _ in pulses]) & (width > 0.0)
    scale = np.max(np.abs(values), axis=1)
    scale[scale == 0.0] = 1.0
    signs = np.sign(np.sum(values, axis=1))
    signs[signs == 0.0] = 1.0
    normal = values / (scale * signs)[:, None]
    fits = {}
    for name, waveform in WAVEFORMS.items():
        peak, middle, length, squares = _fit(waveform, place, normal, levels)
        total = np.mean((normal - normal.mean(axis=1, keepdims=True)) ** 2, axis=1)
        goodness = 1.0 - squares / np.where(total > 0.0, total, 1.0)
        rows = (
            peak * scale * signs,
            begin + (0.5 + middle) * width,
            length * width,
            goodness,
            squares * scale**2,
        )
        fits[name] = WaveformFit(*(np.where(enough, row, np.nan) for row in rows))
    return fits


def _fit(
    waveform: Waveform, place: Floats, values: Floats, levels: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return peak, middle, length and mean squared residual, in units of peak and width of each pulse."""
    level = np.clip(levels, _SMALLEST_LEVEL, 0.9)
    state = np.stack([np.ones(len(values)), np.zeros(len(values)), 0.5 / waveform.half_width(level)], axis=1)
    best = _squares(waveform, place, values, state)
    for _ in range(_ITERATIONS):
        step = _step(waveform, place, values, state)
        moved = np.zeros(len(values), dtype=bool)
        for part in (1.0, 0.25, 0.05):
            trial = state + part * step
            trial[:, 2] = np.maximum(trial[:, 2], 0.05)
            squares = _squares(waveform, place, values, trial)
            better = ~moved & (squares < best)
            state = np.where(better[:, None], trial, state)
            best = np.where(better, squares, best)
            moved |= better
        if not np.any(moved):
            break
    return state[:, 0], state[:, 1], state[:, 2], best


def _step(waveform: Waveform, place: Floats, values: Floats, state: Floats) -> Floats:
    """Return the Gauss-Newton step for each pulse, shape (spike, 3)."""
    peak, middle, length = (state[:, [column]] for column in range(3))
    time = (place - middle) / length
    value, slope = waveform.value(time), waveform.slope(time)
    gradient = np.stack([value, -peak * slope / length, -peak * slope * time / length], axis=2)
    normal = np.einsum("spi,spj->sij", gradient, gradient)
    size = np.trace(normal, axis1=1, axis2=2)
    # a curve outside its pulse has no gradient, and takes no step
    normal += 1e-9 * np.eye(3) * np.where(size > 0.0, size, 1.0)[:, None, None]
    right = np.einsum("spi,sp->si", gradient, values - peak * value)
    step: Floats = np.linalg.solve(normal, right[:, :, None])[:, :, 0]
    return step


def _squares(waveform: Waveform, place: Floats, values: Floats, state: Floats) -> Floats:
    peak, middle, length = (state[:, [column]] for column in range(3))
    left = values - peak * waveform.value((place - middle) / length)
    return np.asarray(np.mean(left**2, axis=1))


def chosen_waveform(fits: dict[str, WaveformFit]) -> str:
    """Return the curve with the smallest residual over all pulses; all contacts of a record are of one kind.

    Each curve has three unknowns, so the smallest sum of squares is also the choice of any information criterion.
    """
    left = {name: float(np.nansum(fit.squares)) for name, fit in fits.items()}
    return min(left, key=lambda name: left[name])

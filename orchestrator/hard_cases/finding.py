"""Finding the contact: grazes, ripples, resonance, all dampings."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from vibroimpact.fmus.core.modes import beam_modes
from vibroimpact.orchestrator.hard_cases.case import Curve, Floats, Found, HardCase, largest, relative
from vibroimpact.orchestrator.hard_cases.runs import IMPACT_TIME, IMPACT_VELOCITY, PLAIN, restitution, run

THEME = "Finding the contact"
LEVELS = 10.0 ** -np.arange(2.0, 13.0)
TRUSTED = 1e-8
"""Excess below which the rounding of the stop's own position shows in the speed."""
SCANNED = 20_000
"""Points on which a closed form is looked at before its root is found."""


def _grazing_impacts(excess: float) -> Floats:
    """Return the impacts of a free motion whose peak passes the stop at 1 by so much, in 50 periods."""
    body = PLAIN | {"displacement_start": -1.0 - excess}
    record = run(body=body, stop=[restitution(1.0, 1.0)], record={"recorded_time": 100.0 * math.pi})
    assert record.impacts is not None
    return record.impacts


def _from_above() -> Found:
    errors = []
    for excess in LEVELS:
        impacts = _grazing_impacts(excess)
        start = -1.0 - excess
        speed = math.sqrt((-1.0 - start) * (1.0 - start))  # with the rounding of the start itself
        errors.append(largest(relative(impacts[:, IMPACT_VELOCITY], speed)))
    off = np.array(errors)
    curve = Curve(LEVELS, off, "peak over the stop (-)", "relative error of the speed (-)", x_log=True)
    return Found(largest(off[LEVELS >= 0.9 * TRUSTED]), curve)


def _from_below() -> Found:
    counts = np.array([float(len(_grazing_impacts(-shortfall))) for shortfall in LEVELS])
    curve = Curve(
        LEVELS, counts, "peak below the stop (-)", "impacts in 50 periods (-)", x_log=True, y_log=False
    )
    return Found(float(counts.sum()), curve)


def first_root(function: Callable[[Floats], Floats], end: float) -> float:
    """Return the first root of a function that begins below 0, looked for on an even grid."""
    from scipy.optimize import brentq

    times = np.linspace(0.0, end, SCANNED)
    above = np.flatnonzero(function(times) > 0.0)
    place = int(above[0])
    found: float = brentq(
        lambda t: float(function(np.array(t))), times[place - 1], times[place], xtol=1e-300, rtol=1e-15
    )
    return found


def _off_time(expected: float, **tables: Any) -> float:
    """Return the relative error of the time of the first impact."""
    record = run(**tables)
    assert record.impacts is not None
    return largest(relative(record.impacts[:1, IMPACT_TIME], expected))


def _by_number(off: Floats, words: str) -> Found:
    """Return what was measured of some settings, drawn one beside the other."""
    places = np.arange(len(off), dtype=np.float64)
    return Found(largest(off), Curve(places, off, words, "relative error of the time (-)"))


def _ripple() -> Found:
    """A beam whose slow mode carries a fast one past its stop: which ripple meets it first?"""
    modes = beam_modes("clamped_free", 8)
    rates, shapes = modes.eigenvalues**2, modes.shapes(1.0)[0]
    sizes = np.array([0.0, 0.0, 0.0, 1e-2, 1e-3, 1e-4, 1e-4])
    errors, ratios = [], []
    for fast in range(2, 8):
        start = np.zeros(8)
        start[0], start[fast] = -0.5, sizes[fast - 1] + 1e-3
        amplitudes = shapes * start

        def over(t: Floats, a: Floats = amplitudes) -> Floats:
            return np.asarray(np.cos(np.multiply.outer(t, rates)) @ a - 0.9)

        expected = first_root(over, 2.0 * math.pi / rates[0])
        body = {
            **{"kind": "beam", "length": 1.0, "flexural_rigidity": 1.0, "mass_per_length": 1.0, "modes": 8},
            "displacement_start": start.tolist(),
        }
        asked = {"recorded_time": 1.01 * expected}
        errors.append(_off_time(expected, body=body, stop=[restitution(0.9, 0.5)], record=asked))
        ratios.append(rates[fast] / rates[0])
    off = np.array(errors)
    curve = Curve(
        np.array(ratios), off, "fast over slow frequency (-)", "relative error of the time (-)", x_log=True
    )
    return Found(largest(off), curve)


DETUNINGS = np.array([0.0, 1e-12, -1e-12, 1e-9, -1e-6, 1e-3])


def _resonance() -> Found:
    """Undamped, forced at 1 + detuning from rest: x = sin((1+w)t/2) sin((w-1)t/2)/((w-1)/2)/(1+w), equations.md 1.4."""
    errors = []
    for detuning in DETUNINGS:
        frequency = 1.0 + detuning
        half = 0.5 * (frequency - 1.0)

        def over(t: Floats, w: float = frequency, h: float = half) -> Floats:
            beat = t * np.sinc(h * t / math.pi)
            return np.asarray(np.sin(0.5 * (1.0 + w) * t) * beat / (1.0 + w) - 5.0)

        expected = first_root(over, 60.0)
        off = _off_time(
            expected,
            body=PLAIN,
            forcing={"amplitude": 0.5, "angular_frequency": frequency},
            stop=[restitution(2.5, 0.5)],
            record={"recorded_periods": 10},
        )
        errors.append(off)
    return _by_number(np.array(errors), "detuning: 0, 1e-12, -1e-12, 1e-9, -1e-6, 1e-3")


RATIOS = np.array([0.0, 1e-9, 0.5, 1.0 - 1e-9, 1.0, 1.0 + 1e-9, 3.0, 100.0])


def _released(ratio: float, t: Floats) -> Floats:
    """Return the free motion from -1 at rest, natural frequency 1: equations.md 1.2, with one root of its own."""
    square = ratio**2 - 1.0
    if abs(square) < 1e-6:  # the series of cosh and sinh about critical damping
        x = square * t**2
        cosh, sinh = 1.0 + x / 2.0 + x**2 / 24.0, t * (1.0 + x / 6.0 + x**2 / 120.0)
        return np.asarray(-np.exp(-ratio * t) * (cosh + ratio * sinh))
    if square < 0.0:
        w = math.sqrt(-square)
        return np.asarray(-np.exp(-ratio * t) * (np.cos(w * t) + ratio * np.sin(w * t) / w))
    root = math.sqrt(square)
    slow, fast = -1.0 / (ratio + root), -ratio - root
    return np.asarray((fast * np.exp(slow * t) - slow * np.exp(fast * t)) / (slow - fast))


def _above(ratio: float, t: Floats) -> Floats:
    """Return how far the free motion has passed -0.3."""
    return _released(ratio, t) + 0.3


def _dampings() -> Found:
    errors = []
    for ratio in RATIOS:
        expected = first_root(partial(_above, float(ratio)), max(8.0, 4.0 * ratio))
        off = _off_time(
            expected,
            body=PLAIN | {"damping_ratio": float(ratio), "displacement_start": -1.0},
            stop=[restitution(-0.3, 0.5)],
            record={"recorded_time": 1.01 * expected},
        )
        errors.append(off)
    return _by_number(np.array(errors), "damping: 0, 1e-9, .5, 1-1e-9, 1, 1+1e-9, 3, 100")


CASES = (
    HardCase(
        "grazing-from-above",
        THEME,
        "a peak that passes the stop by 1e-2 to 1e-12",
        "each is an impact, with the speed of the closed form",
        "energy of the free motion, closed form",
        "relative error of the speed, down to a peak of 1e-8",
        6e-7,
        _from_above,
    ),
    HardCase(
        "grazing-from-below",
        THEME,
        "a peak that misses the stop by 1e-2 to 1e-12",
        "no impact in 50 periods",
        "closed form",
        "impacts",
        0.0,
        _from_below,
    ),
    HardCase(
        "ripple",
        THEME,
        "fast modes of a beam that ripple over the stop",
        "the first ripple that touches is found",
        "sum of the modes in closed form, root of its first crossing",
        "relative error of the time",
        7e-15,
        _ripple,
    ),
    HardCase(
        "resonance",
        THEME,
        "undamped resonance, detuned by 0 to 1e-3",
        "the instant at which the growing motion meets the stop",
        "closed form with the beat as a sinc",
        "relative error of the time",
        4e-15,
        _resonance,
    ),
    HardCase(
        "dampings",
        THEME,
        "damping ratios 0, 1e-9, 0.5, 1 and next to it, 3, 100",
        "the instant at which the motion from -1 comes to -0.3",
        "closed form",
        "relative error of the time",
        7e-15,
        _dampings,
    ),
)

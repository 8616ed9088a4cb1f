"""Finding the contact: grazes, ripples, resonance, all dampings, equal rates."""

from __future__ import annotations

import math
from collections.abc import Callable
from decimal import Decimal, localcontext
from functools import partial
from typing import Any

import numpy as np

from vibroimpact.analysis.orbits import closed_form
from vibroimpact.fmus.core.modes import beam_modes
from vibroimpact.orchestrator.hard_cases.case import Curve, Floats, Found, HardCase, largest, relative
from vibroimpact.orchestrator.hard_cases.runs import (
    IMPACT_PHASE,
    IMPACT_TIME,
    IMPACT_VELOCITY,
    PLAIN,
    restitution,
    run,
)
from vibroimpact.orchestrator.orbits import impacting_body
from vibroimpact.orchestrator.scene import Scene

THEME = "Finding the contact"
LEVELS = 10.0 ** -np.arange(2.0, 13.0)
TRUSTED = 1e-8
"""Peak over the stop, below which the rounding of the stop's own position shows in the speed."""
SCANNED = 20_000
"""Grid points of a closed form in the search of its root."""


def _grazing_impacts(excess: float) -> Floats:
    """Return the impacts, in 50 periods, of a free motion whose peak passes the stop at 1 by `excess`."""
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
    """Return the first root of a function that starts below 0, from an even grid."""
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
    """Return the measurement of several settings, drawn side by side."""
    places = np.arange(len(off), dtype=np.float64)
    return Found(largest(off), Curve(places, off, words, "relative error of the time (-)"))


def _ripple() -> Found:
    """A beam whose slow mode carries a fast one past its stop: the first ripple to touch must be found."""
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
        record = {"recorded_time": 1.01 * expected}
        errors.append(_off_time(expected, body=body, stop=[restitution(0.9, 0.5)], record=record))
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
    """Return the free motion from -1 at rest with natural frequency 1, equations.md 1.2, by independent formulas."""
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
    """Return the excess of the free motion over -0.3."""
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


OFFSETS = np.array([-1e-4, -1e-8, -1e-12, 0.0, 1e-12, 1e-8, 1e-4])
"""Relative change of the damping at which two rates are equal."""
COUPLING = 0.25
"""Stiffness k between two masses of 1, with springs of 1 + k^2 and 1 at them, and a dashpot of 2 k at the first. Their
characteristic polynomial is (s^2 + k s + 1)^2."""
COMPARED = 6
"""Number of impacts of a run, compared with the power series."""
DIGITS, TERMS, STRIDE = 30, 24, 0.5
"""Digits and terms of the power series, and the length of one series in time: its last term is below 1e-23."""


def _near_defective() -> Found:
    """A critically damped oscillator and a chain with Jordan blocks, forced against a stop; also close to both."""
    k = COUPLING
    springs = {"stiffnesses": [1.0 + k**2 - k, k], "far_stiffness": 1.0 - k}
    coupled = np.array([[1.0 + k**2, -k], [-k, 1.0]])
    errors = []
    for offset in OFFSETS:
        critical, block = 2.0 * (1.0 + float(offset)), 2.0 * k * (1.0 + float(offset))
        chain = {"kind": "chain", "masses": [1.0, 1.0], "dampings": [block, 0.0], **springs}
        errors.append(_off_series(np.eye(1), critical, 0.2, PLAIN | {"damping": critical}, 1.0))
        errors.append(_off_series(coupled, block, 0.3, chain, [0.0, 1.0]))
    off = np.array(errors).reshape(-1, 2).max(axis=1)
    words = "damping off by -1e-4, -1e-8, -1e-12, 0, 1e-12, ..."
    return Found(largest(off), Curve(np.arange(7.0), off, words, "relative error of impacts (-)"))


def _defective_orbits() -> Found:
    """Periodic orbits of the chain with Jordan blocks, and close to it, where exponentials of the modes cancel."""
    k, w = COUPLING, 0.9
    errors = []
    for offset in OFFSETS:
        dampings = [2.0 * k * (1.0 + float(offset)), 0.0]
        springs = {"stiffnesses": [1.0 + k**2 - k, k], "far_stiffness": 1.0 - k}
        tables: dict[str, Any] = {
            "body": {"kind": "chain", "masses": [1.0, 1.0], "dampings": dampings, **springs},
            "forcing": {"amplitude": [0.0, 1.0], "angular_frequency": w},
            "stop": [restitution(0.6, 0.7, mass=1)],
            "record": {"transient_periods": 400, "recorded_periods": 1},
        }
        record = run(**tables)
        scene = Scene.from_dict({"scene": {"units": "nondimensional"}, **tables}, "hard case")
        (orbit,) = closed_form(impacting_body(scene))
        assert record.impacts is not None
        seen = record.impacts[:, [IMPACT_PHASE, IMPACT_VELOCITY]]
        errors.append(largest(relative(seen, np.array([[orbit.phases[0], orbit.velocities[0]]]))))
    off = np.array(errors)
    words = "damping off by -1e-4, -1e-8, -1e-12, 0, 1e-12, ..."
    return Found(largest(off), Curve(np.arange(7.0), off, words, "relative error of the impact (-)"))


def _off_series(
    stiffness: Floats, damping: float, stop: float, body: dict[str, Any], force: float | list[float]
) -> float:
    """Return the largest relative error of times and speeds of the first impacts."""
    w, r = 0.9, 0.7
    place = {"mass": 1} if "kind" in body else {}
    record = run(
        body=body,
        forcing={"amplitude": force, "angular_frequency": w},
        stop=[restitution(stop, r, **place)],
        record={"recorded_periods": 5},
    )
    assert record.impacts is not None
    first = record.impacts[:COMPARED, [IMPACT_TIME, IMPACT_VELOCITY]]
    expected = impacts_by_series(stiffness, damping, w, stop, r)
    return largest(relative(first, expected)) if len(first) == COMPARED else math.inf


def impacts_by_series(stiffness: Floats, damping: float, w: float, stop: float, r: float) -> Floats:
    """Return times and speeds of the first impacts, shape (impact, 2), in 30 digits.

    Masses are 1. The first has the dashpot and the stop, the last the force cos(w t). A power series of the equations
    of motion needs no eigenvalues.
    """
    n = len(stiffness)
    matrix = np.zeros((2 * n + 2, 2 * n + 2))
    matrix[:n, n : 2 * n], matrix[n : 2 * n, :n] = np.eye(n), -stiffness
    matrix[n, n], matrix[2 * n - 1, 2 * n] = -damping, 1.0
    matrix[2 * n, 2 * n + 1], matrix[2 * n + 1, 2 * n] = -w, w
    exact = np.vectorize(Decimal, otypes=[object])
    rates, state = exact(matrix), exact(np.eye(2 * n + 2)[2 * n])
    grid = np.linspace(0.0, STRIDE, 11)[1:]
    start = Decimal(0)
    impacts: list[list[float]] = []
    with localcontext() as context:
        context.prec = DIGITS
        while len(impacts) < COMPARED:
            series = [state]
            for order in range(1, TERMS):
                series.append(rates @ series[-1] / order)
            places = np.polynomial.polynomial.polyval(grid, [float(term[0]) for term in series])
            beyond = np.flatnonzero(places > stop)
            step = Decimal(float(grid[beyond[0] if len(beyond) else -1]))
            state = _summed(series, step)
            if len(beyond):
                for _ in range(6):  # steps of Newton's method
                    step -= (state[0] - Decimal(stop)) / state[n]
                    state = _summed(series, step)
                impacts.append([float(start + step), float(state[n])])
                state[0], state[n] = Decimal(stop), -Decimal(r) * state[n]
            start += step
    return np.array(impacts)


def _summed(series: list[Any], step: Decimal) -> Any:
    """Return the sum of a power series of states."""
    total = series[-1]
    for term in series[-2::-1]:
        total = total * step + term
    return total


CASES = (
    HardCase(
        "grazing-from-above",
        THEME,
        "a peak 1e-2 to 1e-12 beyond the stop",
        "each is an impact, with the speed of the closed form",
        "energy of the free motion, closed form",
        "relative error of the speed, down to a peak of 1e-8",
        6e-7,
        _from_above,
    ),
    HardCase(
        "grazing-from-below",
        THEME,
        "a peak 1e-2 to 1e-12 below the stop",
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
        "the instant of contact of the growing motion",
        "closed form with the beat as a sinc",
        "relative error of the time",
        4e-15,
        _resonance,
    ),
    HardCase(
        "dampings",
        THEME,
        "damping ratios 0, 1e-9, 0.5, close to 1, 1, 3, 100",
        "the instant at which the motion from -1 reaches -0.3",
        "closed form",
        "relative error of the time",
        7e-15,
        _dampings,
    ),
    HardCase(
        "near-defective",
        THEME,
        "a critically damped oscillator, a chain with Jordan blocks, and dampings off by 1e-12 to 1e-4",
        "the first six impacts",
        "power series of the equations of motion with 30 digits",
        "relative error of times and speeds",
        1.2e-13,
        _near_defective,
    ),
    HardCase(
        "defective-orbits",
        THEME,
        "P(1,1) of the chain with Jordan blocks, and with dampings off by 1e-12 to 1e-4",
        "the impact of the orbit, computed without a run",
        "a run of 400 periods",
        "relative error of phase and speed",
        3.3e-13,
        _defective_orbits,
    ),
)

"""Motions that grow by negative springs and dashpots: equations.md 1.9."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vibroimpact.analysis.dataset import Outcome
from vibroimpact.orchestrator.hard_cases.case import Curve, Floats, Found, HardCase, largest, relative
from vibroimpact.orchestrator.hard_cases.runs import IMPACT_TIME, IMPACT_VELOCITY, recorded, run
from vibroimpact.orchestrator.study.balance import BALANCED, off_balance

THEME = "Motions that grow"
_MASS: dict[str, Any] = {"name": "mass", "mass": 1.0}
_PENDULUM: dict[str, Any] = {**_MASS, "stiffness": -1.0}


def _stops(coefficient: float) -> list[dict[str, Any]]:
    one = {"at": "mass", "restitution": coefficient}
    return [{**one, "position": 1.0}, {**one, "position": -1.0, "side": "lower"}]


SPEEDS = 1.0 + 10.0 ** np.arange(-8.0, 3.0)


def _over_the_top() -> Found:
    """An inverted pendulum between elastic stops takes 2 artanh(1 / V) from one to the other."""
    errors = []
    for speed in SPEEDS:
        # artanh(1 / V) without cancellation at V near 1
        half = float(np.log1p(2.0 / (speed - 1.0)))
        start = {"displacement_start": -1.0, "velocity_start": float(speed)}
        record = run(body=[_PENDULUM | start], stop=_stops(1.0), record={"recorded_time": 100.5 * half})
        assert record.impacts is not None
        times = record.impacts[:, IMPACT_TIME]
        errors.append(largest(relative(np.diff(times), half)) if len(times) == 100 else math.inf)
    off = np.array(errors)
    return Found(
        # a speed that is off by its rounding changes the time over the top by rounding / (V^2 - 1)
        largest(off * np.minimum(1.0, SPEEDS**2 - 1.0)),
        Curve(SPEEDS - 1.0, off, "V - 1 (-)", "relative error of a flight (-)", x_log=True, is_bounded=False),
    )


RATIOS = np.array([0.01, 0.03, 0.1, 0.3])


def _cycle(ratio: float, r: float) -> float:
    """Return the speed of the limit cycle of x'' - 2 ratio x' + x = 0 between stops at -1 and 1."""
    from scipy.optimize import brentq

    w = math.sqrt(1.0 - ratio**2)

    def speed_at(time: float) -> float:
        """Return V from the displacement 1 at the end of a flight from -1 with the speed r V."""
        grown = math.exp(ratio * time)
        c, s = math.cos(w * time), math.sin(w * time) / w
        return (1.0 / grown + (c - ratio * s)) / (r * s)

    def off(time: float) -> float:
        c, s = math.cos(w * time), math.sin(w * time) / w
        speed = speed_at(time)
        return math.exp(ratio * time) * (s + (c + ratio * s) * r * speed) - speed

    return speed_at(brentq(off, 1e-3, math.pi - 1e-3, xtol=1e-15, rtol=1e-15))


def _self_excited() -> Found:
    """An oscillator with negative damping between stops that take energy ends on its limit cycle."""
    errors = []
    for ratio in RATIOS.tolist():
        r = math.exp(-4.0 * ratio)
        body = _MASS | {"stiffness": 1.0, "damping": -2.0 * ratio, "velocity_start": 1.5}
        record = run(body=[body], stop=_stops(r), record={"recorded_time": 200.0 / ratio})
        assert record.impacts is not None
        errors.append(float(relative(record.impacts[-1, IMPACT_VELOCITY], _cycle(ratio, r))))
    off = np.array(errors)
    return Found(largest(off), Curve(RATIOS, off, "- damping ratio (-)", "relative error of the speed (-)"))


def _balance() -> Found:
    """A buckled and a self-excited body that hit each other and stops: the energy balance holds."""
    bodies = [
        _MASS | {"stiffness": -2.0, "damping": 0.1, "displacement_start": 0.1},
        {"name": "other", "mass": 0.5, "stiffness": 3.0, "damping": -0.05},
    ]
    record = run(
        body=bodies,
        link=[{"between": ["mass", "other"], "stiffness": 1.0}],
        contact=[{"between": ["mass", "other"], "clearance": 0.3, "restitution": 0.8}],
        stop=_stops(0.9),
        forcing={"at": "mass", "amplitude": 1.0, "angular_frequency": 1.7},
        record={
            "transient_periods": 0,
            "recorded_periods": 50,
            "time_series": {"rate": 20.0, "variables": [*BALANCED]},
        },
    )
    assert record.samples is not None
    off = off_balance(record.samples)
    return Found(
        largest(off), Curve(record.samples[1:, 0], off, "time (-)", "relative error of the balance (-)")
    )


STARTS: Floats = 10.0 ** np.arange(-12.0, 0.0)


def _unbounded() -> Found:
    """An inverted pendulum that nothing holds ends at 1e9 times its start: arcosh 1e9."""
    errors = []
    expected = math.acosh(1e9)
    for start in STARTS.tolist():
        record = recorded(body=[_PENDULUM | {"displacement_start": start}], record={"recorded_time": 100.0})
        is_so = record.outcome == Outcome.unbounded
        time = float(record.message.split("at time ")[1].split()[0]) if is_so else math.nan
        errors.append(float(relative(time, expected)) if is_so else math.inf)
    off = np.array(errors)
    return Found(largest(off), Curve(STARTS, off, "start (-)", "relative error of the time (-)", x_log=True))


CASES = (
    HardCase(
        "over-the-top",
        THEME,
        "an inverted pendulum between elastic stops that just passes the top",
        "each of 100 flights takes its time",
        "closed form",
        "relative error of a flight, times V^2 - 1 below 1",
        6e-13,
        _over_the_top,
    ),
    HardCase(
        "self-excited",
        THEME,
        "negative damping between stops that take energy",
        "the motion settles on its limit cycle",
        "closed form of a flight",
        "relative error of the speed",
        3e-13,
        _self_excited,
    ),
    HardCase(
        "growing-balance",
        THEME,
        "a buckled and a self-excited body hit each other and two stops",
        "the energy balance holds",
        "balance",
        "relative error of the balance",
        3e-13,
        _balance,
    ),
    HardCase(
        "unbounded",
        THEME,
        "an inverted pendulum that nothing holds, from 1e-12 to 0.1",
        "ends as unbounded at 1e9 times its start",
        "closed form",
        "relative error of the time",
        7e-15,
        _unbounded,
    ),
)

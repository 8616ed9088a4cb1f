"""Impacts: a million of them, next to no room, several at one instant, several stops at one place."""

from __future__ import annotations

import math

import numpy as np

from vibroimpact.orchestrator.hard_cases.case import Curve, Found, HardCase, largest, relative
from vibroimpact.orchestrator.hard_cases.runs import (
    IMPACT_TIME,
    IMPACT_VELOCITY,
    PLAIN,
    STICK_START,
    restitution,
    run,
)

THEME = "Impacts"
ELASTIC_IMPACTS = 1_000_000


def _elastic() -> Found:
    """An oscillator that swings against a stop beyond its rest position."""
    stop = 0.3
    flight = 2.0 * (math.pi - math.acos(stop))
    end = flight * ELASTIC_IMPACTS
    record = run(
        body=PLAIN | {"displacement_start": -1.0},
        stop=[restitution(stop, 1.0)],
        record={
            **{"recorded_time": end, "impacts": False},
            "time_series": {"rate": 100.0 / end, "variables": ["displacement", "velocity"]},
        },
    )
    assert record.samples is not None
    time, x, v = record.samples[1:].T
    off = np.abs(x**2 + v**2 - 1.0)
    return Found(largest(off), Curve(time / flight, off, "impacts (-)", "relative error of the energy (-)"))


def _nearly_elastic() -> Found:
    """A mass that a force presses: flights of 2 r^n v / g that add up, equations.md 3.1."""
    r, start = 0.999, -1.0
    record = run(
        body={"mass": 1.0, "stiffness": 0.0, "displacement_start": start},
        forcing={"amplitude": 2.0, "angular_frequency": 0.0},
        stop=[restitution(0.0, r)],
        record={"recorded_time": 3000.0},
    )
    assert record.impacts is not None
    assert record.sticks is not None
    number = np.arange(len(record.impacts), dtype=np.float64)
    velocity = 2.0 * r**number
    expected = 1.0 + 2.0 * r * (1.0 - r**number) / (1.0 - r)
    times = relative(record.impacts[:, IMPACT_TIME], expected)
    ends = relative(record.sticks[:, STICK_START], 1.0 + 2.0 * r / (1.0 - r))
    off = np.maximum(times, relative(record.impacts[:, IMPACT_VELOCITY], velocity))
    curve = Curve(number + 1.0, off, "impact (-)", "relative error of time and speed (-)", x_log=True)
    return Found(max(largest(off), largest(ends)), curve)


GAPS = np.array([1e-3, 1e-6, 1e-9, 1e-12])


def _narrow_gap() -> Found:
    errors = []
    for gap in GAPS:
        record = run(
            body={"mass": 1.0, "stiffness": 0.0, "velocity_start": 1.0},
            stop=[restitution(gap, 1.0), restitution(0.0, 1.0, side="lower")],
            record={"recorded_time": 1000.5 * gap},
        )
        assert record.impacts is not None
        if len(record.impacts) != 1000:
            errors.append(math.inf)
            continue
        times = relative(record.impacts[:, IMPACT_TIME], gap * np.arange(1.0, 1001.0, dtype=np.float64))
        errors.append(max(largest(times), largest(relative(record.impacts[:, IMPACT_VELOCITY], 1.0))))
    off = np.array(errors)
    return Found(
        largest(off), Curve(GAPS, off, "gap (-)", "relative error after 1000 impacts (-)", x_log=True)
    )


def _simultaneous() -> Found:
    """Two masses of a mirror-symmetric chain that meet their stops at one instant, again and again."""
    end, samples = 400.0, 100
    record = run(
        body={
            **{"kind": "chain", "masses": [1.0, 2.0, 1.0], "stiffnesses": 1.0, "far_stiffness": 1.0},
            "displacement_start": [-0.5, 0.7, -0.5],
        },
        stop=[restitution(0.1, 1.0, mass=mass) for mass in (1, 3)],
        record={
            "recorded_time": end,
            "time_series": {
                "rate": samples / end,
                "variables": ["displacement[1]", "displacement[3]", "energy.kinetic", "energy.potential"],
            },
        },
    )
    assert record.samples is not None
    time, one, other, kinetic, potential = record.samples.T
    energy = kinetic + potential
    off = np.maximum(np.abs(one - other), np.abs(energy / energy[0] - 1.0))
    return Found(largest(off), Curve(time, off, "time (-)", "asymmetry, error of the energy (-)"))


CASES = (
    HardCase(
        "elastic-million",
        THEME,
        "a million elastic impacts",
        "the energy stays",
        "conservation",
        "relative error of the energy",
        1e-10,
        _elastic,
    ),
    HardCase(
        "nearly-elastic",
        THEME,
        "restitution 0.999 under a force: flights that add up to rest",
        "impacts and the instant of rest",
        "geometric sums in closed form",
        "relative error of times and speeds",
        1e-10,
        _nearly_elastic,
    ),
    HardCase(
        "narrow-gap",
        THEME,
        "1000 impacts between two elastic stops 1e-3 to 1e-12 apart",
        "each found, the speed kept",
        "free flight",
        "relative error of times and speeds",
        1e-12,
        _narrow_gap,
    ),
    HardCase(
        "simultaneous",
        THEME,
        "two masses that hit at one instant",
        "the energy stays, and so does the symmetry",
        "conservation, mirror symmetry",
        "asymmetry, or relative error of the energy",
        1e-11,
        _simultaneous,
    ),
)

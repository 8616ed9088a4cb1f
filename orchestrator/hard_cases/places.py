"""Stops in awkward places: at nodes, at the start, two of them under one resting motion."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vibroimpact.orchestrator.hard_cases.case import Curve, Floats, Found, HardCase, largest, relative
from vibroimpact.orchestrator.hard_cases.finding import first_root
from vibroimpact.orchestrator.hard_cases.runs import (
    IMPACT_TIME,
    IMPACT_VELOCITY,
    PLAIN,
    STICK_START,
    restitution,
    run,
)

THEME = "Stops in awkward places"
MIRRORED: dict[str, Any] = {
    **{"kind": "chain", "masses": [1.0, 1.0, 1.0], "stiffnesses": 1.0, "far_stiffness": 1.0}
}
"""Three equal masses between two walls."""


def _at_a_node() -> Found:
    """The outer masses swing against each other at sqrt(2) rad/s: the middle mass stays at its stop."""
    end, samples = 100.0, 100
    record = run(
        body=MIRRORED | {"displacement_start": [0.3, 0.0, -0.3]},
        stop=[restitution(0.0, 0.5, mass=2)],
        record={
            "recorded_time": end,
            "time_series": {"rate": samples / end, "variables": ["displacement[1]"]},
        },
    )
    assert record.samples is not None
    time, place = record.samples.T
    off = np.abs(place - 0.3 * np.cos(math.sqrt(2.0) * time)) / 0.3
    return Found(largest(off), Curve(time, off, "time (-)", "relative error of the motion (-)"))


def _driven_at_a_node() -> Found:
    """A force that is equal on both sides: the masses part at the first impact, and not before."""
    periods, rate = 5, 10.0
    record = run(
        body=MIRRORED,
        forcing={"amplitude": [1.0, 0.0, 1.0], "angular_frequency": 0.5},
        stop=[restitution(1.5, 0.7, mass=1)],
        record={
            "recorded_periods": periods,
            "time_series": {"rate": rate, "variables": ["displacement[1]", "displacement[3]"]},
        },
    )
    assert record.samples is not None
    assert record.impacts is not None
    time, one, other = record.samples.T
    off = np.abs(one - other)
    before = time < record.impacts[0, IMPACT_TIME]
    parted = off[~before].max() > 0.1
    curve = Curve(time, off, "time (-)", "asymmetry (-)", is_bounded=False)
    return Found(largest(off[before]) if parted else math.inf, curve)


def _starts() -> Found:
    """On the stop from the start: moving into it, at rest and pulled off it, at rest and pressed to it."""
    record = {"recorded_time": 0.5}
    into = run(body=PLAIN | {"velocity_start": 2.0}, stop=[restitution(0.0, 0.25)], record=record).impacts
    assert into is not None
    first = into[0]
    errors = [max(abs(first[IMPACT_TIME]), float(relative(first[IMPACT_VELOCITY], 2.0)))]
    for load in (-1.0, 1.0):
        found = run(
            body=PLAIN,
            forcing={"amplitude": load, "angular_frequency": 0.0},
            stop=[restitution(0.0, 0.5)],
            record=record,
        )
        assert found.impacts is not None
        assert found.sticks is not None
        expected = 0.0 if load > 0.0 else math.cos(0.5) - 1.0
        off = abs(found.final_displacement - expected)
        held = len(found.sticks) == 1 and found.sticks[0, STICK_START] == 0.0
        errors.append(off if not len(found.impacts) and held == (load > 0.0) else math.inf)
    off_all = np.array(errors)
    words = "1 moves into it, 2 is pulled off, 3 is pressed"
    return Found(largest(off_all), Curve(np.arange(1.0, 4.0), off_all, words, "error (-)"))


def _rocking() -> Found:
    """Two masses on dead stops, rocked by a spring: at rest on both after infinitely many impacts, in 10 s."""
    loads = 10.0 ** np.arange(-3.0, 4.0)
    errors = []
    for load in loads:
        record = run(
            body={
                **{"kind": "beam", "length": 1.0, "flexural_rigidity": 1.0, "mass_per_length": 1.0},
                **{"modes": 2, "damping_ratio": 0.3, "velocity_start": [-0.1, -0.1]},
            },
            forcing={"amplitude": float(load), "angular_frequency": 0.0, "location": 0.8},
            stop=[restitution(0.0, 0.0, location=1.0), restitution(0.0, 0.0, location=0.6)],
            record={"recorded_time": 30.0 + 30.0 / math.sqrt(load)},
        )
        assert record.final_state is not None
        errors.append(float(np.abs(record.final_state).max()))
    off = np.array(errors)
    return Found(largest(off), Curve(loads, off, "load (-)", "residual motion (-)", x_log=True))


OFFSETS = np.array([-1e-13, 1e-15, 1e-13, 1e-11, 1e-9])
"""Distances of the stop from the middle of a pinned beam, over its length."""
COMPARED = 6
"""Compared impacts of each run."""
OFF_THE_STOP = 1e-4
"""Time after an impact at which the mode has left the stop, with any rounding."""


def _beside_a_node() -> Found:
    """A pinned beam swings in mode 2, and touches a stop next to its middle, where it hardly moves."""
    off = np.array([_error_at(0.5 + float(distance)) for distance in OFFSETS])
    words = "stop beside the node, each distance"
    return Found(largest(off), Curve(np.arange(1.0, 1.0 + len(off)), off, words, "relative error (-)"))


def _error_at(location: float) -> float:
    """Return the largest error of time and speed of the first impacts. Mode 1 starts at rest; each impact moves it."""
    angle, r = math.pi * (location - 0.5), 0.8
    shapes = math.sqrt(2.0) * np.array([math.cos(angle), -math.sin(2.0 * angle)])
    rates = math.pi**2 * np.array([1.0, 4.0])
    start = -math.copysign(1.0, shapes[1])
    place, velocity, stop = np.array([0.0, start]), np.zeros(2), 0.3 * abs(shapes[1])
    expected, time = [], 0.0
    for _ in range(COMPARED):
        cosines, sines = shapes * place, shapes * velocity / rates

        def beyond(u: Floats, c: Floats = cosines, s: Floats = sines) -> Floats:
            turned = np.multiply.outer(u + OFF_THE_STOP, rates)
            return np.asarray((np.cos(turned) @ c + np.sin(turned) @ s - stop) / stop)

        flight = OFF_THE_STOP + first_root(beyond, 3.0)
        c, s = np.cos(rates * flight), np.sin(rates * flight)
        place, velocity = place * c + velocity / rates * s, velocity * c - place * rates * s
        time, speed = time + flight, float(shapes @ velocity)
        expected.append([time, speed])
        velocity = velocity - (1.0 + r) * speed * shapes / (shapes @ shapes)
    record = run(
        body={
            **{"kind": "beam", "length": 1.0, "flexural_rigidity": 1.0, "mass_per_length": 1.0, "modes": 2},
            **{"boundary": "pinned-pinned", "displacement_start": [0.0, start]},
        },
        stop=[restitution(float(stop), r, location=location)],
        record={"recorded_time": 1.001 * time},
    )
    assert record.impacts is not None
    found = record.impacts[:, [IMPACT_TIME, IMPACT_VELOCITY]]
    return largest(relative(found, np.array(expected))) if len(found) == COMPARED else math.inf


CASES = (
    HardCase(
        "stop-at-a-node",
        THEME,
        "a stop at a node of a swinging chain",
        "does not change the motion",
        "closed form",
        "relative error of the motion",
        1e-12,
        _at_a_node,
    ),
    HardCase(
        "beside-a-node",
        THEME,
        "a stop 1e-15 to 1e-9 of the length off a node of the swinging mode",
        "the first six impacts of the residual motion there",
        "both modes in closed form",
        "relative error of times and speeds",
        2e-14,
        _beside_a_node,
    ),
    HardCase(
        "driven-at-a-node",
        THEME,
        "a symmetric force on a symmetric chain, a stop on one side",
        "the masses move equally until the first impact",
        "symmetry",
        "asymmetry before the impact",
        1e-14,
        _driven_at_a_node,
    ),
    HardCase(
        "starts",
        THEME,
        "on the stop at the start: moving into it, pulled off it, pressed to it",
        "an impact at time 0; leaves without impact; stays",
        "closed forms",
        "error of time, speed or position",
        9e-16,
        _starts,
    ),
    HardCase(
        "rocking",
        THEME,
        "a beam of two modes that a load of 1e-3 to 1e3 presses to two dead stops",
        "comes to rest on both after infinitely many impacts",
        "statics",
        "residual motion",
        9e-16,
        _rocking,
    ),
)

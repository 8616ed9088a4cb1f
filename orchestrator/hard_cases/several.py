"""Several stops, of several laws: one acts while another is in contact, and the energy balance of all."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vibroimpact.orchestrator.hard_cases.case import Curve, Floats, Found, HardCase, largest, relative
from vibroimpact.orchestrator.hard_cases.runs import IMPACT_VELOCITY, kelvin_voigt, restitution, run
from vibroimpact.orchestrator.study.balance import BALANCED, off_balance

THEME = "Several stops"
BEAM: dict[str, Any] = {**{"kind": "beam", "length": 1.0, "flexural_rigidity": 1.0, "mass_per_length": 1.0}}


def _balance(record_table: dict[str, Any], **tables: Any) -> tuple[Floats, Floats, int]:
    """Return the time, the relative error of the energy balance, and the number of impacts."""
    series = {"rate": 20.0, "variables": [*BALANCED]}
    record = run(**tables, record={**record_table, "time_series": series})
    assert record.samples is not None
    assert record.impacts is not None
    return record.samples[1:, 0], off_balance(record.samples), len(record.impacts)


def _balanced(least_impacts: int, record_table: dict[str, Any], **tables: Any) -> Found:
    time, off, impacts = _balance(record_table, **tables)
    figure = largest(off) if impacts >= least_impacts else math.inf
    return Found(figure, Curve(time, off, "time (-)", "relative error of the balance (-)"))


def _all_laws() -> Found:
    """A chain with a stop of each law."""
    return _balanced(
        50,
        {"recorded_periods": 20},
        body={
            **{"kind": "chain", "masses": [1.0, 2.0, 0.5, 1.0], "stiffnesses": [3.0, 1.0, 2.0, 1.0]},
            "dampings": 0.02,
        },
        forcing={"amplitude": [0.5, 0.0, 0.2, 1.0], "angular_frequency": 1.3},
        stop=[
            kelvin_voigt(0.1, 100.0, 1.0, mass=1),
            {"law": "hertz", "position": 0.1, "stiffness": 1e4, "mass": 2},
            {"law": "hunt_crossley", "position": 0.05, "stiffness": 1e3, "damping": 0.5, "mass": 3},
            restitution(-0.1, 0.8, side="lower", mass=4),
        ],
    )


def _uneven_beam() -> Found:
    """A beam of 8 modes, undamped, damped and overdamped ones, with four stops at four places."""
    return _balanced(
        50,
        {"recorded_periods": 5},
        body=BEAM | {"modes": 8, "damping_ratio": [0.0, 0.5, 0.0, 0.3, 0.0, 0.01, 2.0, 0.0]},
        forcing={"amplitude": 1.0, "angular_frequency": 3.0, "location": 1.0},
        stop=[
            restitution(0.02, 0.7, location=1.0),
            restitution(-0.01, 0.9, location=0.5, side="lower"),
            kelvin_voigt(0.02, 1e3, 1.0, location=0.75),
            {"law": "hertz", "position": -0.005, "stiffness": 1e5, "location": 0.3, "side": "lower"},
        ],
    )


def _rest_beside() -> Found:
    """A pinned beam rests on a dead stop while an opposite Hunt-Crossley stop is pressed in and released."""
    return _balanced(
        5,
        {"recorded_time": 12.0},
        body={
            **BEAM,
            **{"boundary": "pinned-pinned", "modes": 2, "damping_ratio": 0.02},
            "velocity_start": [-0.15, -2.29],
        },
        stop=[
            restitution(0.0, 0.0, location=0.7),
            {
                **{"law": "hunt_crossley", "position": -0.01, "side": "lower", "location": 0.55},
                **{"stiffness": 1e3, "damping": 0.01},
            },
        ],
    )


def _overdamped() -> Found:
    """An undamped stop under an overdamped mode and an undamped mode returns its energy."""
    return _balanced(
        1,
        {"recorded_time": 3.0},
        body=BEAM | {"modes": 2, "damping_ratio": [30.0, 0.0], "velocity_start": [20.0, 1.0]},
        stop=[kelvin_voigt(0.05, 1e3)],
    )


DEPTHS = np.array([0.01, 0.03, 0.05, 0.07, 0.09])


def _behind() -> Found:
    """A rigid stop behind an undamped spring of 100 N/m: energy gives the speeds, equations.md 6.9."""
    stiffness, r = 100.0, 0.9
    errors = []
    for depth in DEPTHS:
        hit = math.sqrt(1.0 - stiffness * depth**2)
        left = math.sqrt((r * hit) ** 2 + stiffness * depth**2)
        record = run(
            body={
                **{"kind": "chain", "masses": [1.0], "stiffnesses": 0.0},
                **{"displacement_start": [-0.1], "velocity_start": [1.0]},
            },
            stop=[kelvin_voigt(0.0, stiffness), restitution(float(depth), r)],
            record={"recorded_time": 1.0},
        )
        assert record.impacts is not None
        rigid = record.impacts[record.impacts[:, 4] == 2.0]
        if len(rigid) != 1:
            errors.append(math.inf)
            continue
        off = float(relative(rigid[0, IMPACT_VELOCITY], hit))
        errors.append(max(off, float(relative(-record.final_velocity, left))))
    off_all = np.array(errors)
    return Found(
        largest(off_all),
        Curve(DEPTHS, off_all, "depth of the rigid stop (-)", "relative error of speeds (-)"),
    )


LOADS = 10.0 ** np.arange(-1.0, 4.0)


def _pressed_between() -> Found:
    """Between a rigid stop below and a Hunt-Crossley stop of exponent 2 above, pushed up: sqrt(load / k) deep."""
    errors = []
    for load in LOADS:
        record = run(
            body={"mass": 1.0, "stiffness": 0.0},
            forcing={"amplitude": float(load), "angular_frequency": 0.0},
            stop=[
                {
                    **{"law": "hunt_crossley", "position": 1e-6, "stiffness": 80.0},
                    **{"damping": 5.0, "exponent": 2.0},
                },
                restitution(0.0, 0.999, side="lower"),
            ],
            record={"recorded_time": 400.0},
        )
        depth = math.sqrt(load / 80.0)
        errors.append(abs(record.final_displacement - 1e-6 - depth) / depth)
    off = np.array(errors)
    return Found(
        largest(off), Curve(LOADS, off, "load (-)", "relative error of the final position (-)", x_log=True)
    )


CASES = (
    HardCase(
        "all-laws",
        THEME,
        "a chain with a stop of each law, 20 periods",
        "the energy balance holds",
        "balance",
        "relative error of the balance",
        1.7e-13,
        _all_laws,
    ),
    HardCase(
        "uneven-beam",
        THEME,
        "a beam of 8 modes, undamped to overdamped, four stops of three laws",
        "the energy balance holds",
        "balance",
        "relative error of the balance",
        2.6e-13,
        _uneven_beam,
    ),
    HardCase(
        "rest-beside",
        THEME,
        "a beam at rest on a dead stop while a Hunt-Crossley stop releases it",
        "finishes, the energy balance holds",
        "balance",
        "relative error of the balance",
        6e-13,
        _rest_beside,
    ),
    HardCase(
        "overdamped",
        THEME,
        "an undamped stop under an overdamped mode",
        "returns its energy",
        "balance",
        "relative error of the balance",
        1.3e-13,
        _overdamped,
    ),
    HardCase(
        "behind",
        THEME,
        "a rigid stop behind a spring",
        "the mass meets both, and leaves both",
        "conservation of energy",
        "relative error of the speeds",
        4e-15,
        _behind,
    ),
    HardCase(
        "pressed-between",
        THEME,
        "a load of 0.1 to 1e3 N on a power law, opposite a rigid stop at 1e-6 m",
        "is compressed to its static position",
        "statics",
        "relative error of the position",
        6e-12,
        _pressed_between,
    ),
)

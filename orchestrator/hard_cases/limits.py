"""Long steps and numbers beyond all bounds: deadlines hold, one error, limits do not change the motion."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np

from vibroimpact.analysis.dataset import Outcome
from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.hard_cases.case import Curve, Found, HardCase, largest
from vibroimpact.orchestrator.hard_cases.runs import PLAIN, kelvin_voigt, recorded, restitution, run

THEME = "Long steps"
DEADLINE = 0.2
LONG_RUN: dict[str, Any] = {"transient_periods": 10**7, "recorded_periods": 1}


def _deadlines() -> Found:
    """Motions that would take minutes in one step: each run ends within its deadline and reports it."""
    scenes: list[dict[str, Any]] = [
        {  # two masses, a dashpot of 1e5 between the first and the ground
            "body": {
                "kind": "chain",
                "masses": [1.0, 1.0],
                "stiffnesses": 1.0,
                "dampings": [1e5, 0.1],
            },
            "forcing": {"amplitude": [0.7, 0.1], "angular_frequency": 0.23},
            "stop": [restitution(0.05, 0.55)],
        },
        {  # a stop next to the start
            "body": PLAIN,
            "forcing": {"amplitude": 1.0, "angular_frequency": 1.0},
            "stop": [restitution(1e-300, 1.0), restitution(-1e-300, 1.0, side="lower")],
        },
        {  # stiff undamped springs with little room
            "body": PLAIN,
            "forcing": {"amplitude": 1.0, "angular_frequency": 1.0},
            "stop": [kelvin_voigt(1e-5, 1e12), kelvin_voigt(-1e-5, 1e12, side="lower")],
        },
    ]
    late = []
    for scene in scenes:
        began = time.process_time()
        record = recorded(**scene, record=LONG_RUN, execution={"deadline": DEADLINE, "impact_limit": 10**12})
        spent = time.process_time() - began
        late.append(spent - DEADLINE if record.outcome == Outcome.timeout else math.inf)
    off = np.array(late)
    words = "1 stiff dashpot, 2 no room, 3 stiff springs"
    return Found(
        largest(off),
        Curve(np.arange(1.0, 4.0), off, words, "processor time after the deadline (s)", y_log=False),
    )


def _beyond_numbers() -> Found:
    """A force of 1e300 on a light mass, a mass of 5e-324, a stiffness of 1e200: one error that names the time."""
    scenes: list[dict[str, Any]] = [
        {"body": PLAIN | {"mass": 1e-9}, "forcing": {"amplitude": 1e300, "angular_frequency": 1.0}},
        {"body": PLAIN | {"mass": 5e-324}, "forcing": {"amplitude": 1.0, "angular_frequency": 1.0}},
        {"body": PLAIN | {"stiffness": 1e200}, "forcing": {"amplitude": 1e300, "angular_frequency": 1.0}},
    ]
    silent = []
    for scene in scenes:
        try:
            recorded(**scene, stop=[restitution(1.0, 0.5)], record={"recorded_periods": 100})
        except ComponentError as error:
            silent.append(float("time" not in str(error)))
        else:
            silent.append(1.0)
    off = np.array(silent)
    words = "1 large force, 2 least mass, 3 large stiffness"
    return Found(largest(off), Curve(np.arange(1.0, 4.0), off, words, "runs without it", y_log=False))


LIMITS = np.array([1, 10, 100, 1000])


def _impact_limits() -> Found:
    """A limit on impacts ends the run at that impact, with any recording."""

    def end_of(limit: int, record: dict[str, Any]) -> np.ndarray[Any, Any]:
        found = recorded(
            body=PLAIN | {"damping_ratio": 0.1},
            forcing={"amplitude": 0.5, "angular_frequency": 1.0},
            stop=[restitution(1.0, 0.7)],
            record={"recorded_periods": 5000} | record,
            execution={"impact_limit": limit},
        )
        assert found.outcome == Outcome.impact_limit
        return np.array([found.final_displacement, found.final_velocity])

    errors = []
    for limit in LIMITS:
        reference = end_of(int(limit), {})
        others = [
            end_of(int(limit), record) for record in ({"impacts": False}, {"time_series": {"rate": 3.0}})
        ]
        errors.append(max(float(np.abs(other - reference).max()) for other in others))
    off = np.array(errors)
    return Found(
        largest(off),
        Curve(LIMITS.astype(float), off, "limit (-)", "change of the final state (-)", x_log=True),
    )


PERIODS = np.array([1, 16, 128, 512])


def _long_free_motion() -> Found:
    """An undamped oscillator without contact: its energy after 512 periods, with samples and without."""
    errors = []
    for count in PERIODS:
        for rate in (None, 10.0):
            series = {} if rate is None else {"time_series": {"rate": rate}}
            record = run(
                body=PLAIN | {"displacement_start": -1.0},
                stop=[restitution(2.0, 0.5)],
                record={"recorded_time": 2.0 * math.pi * float(count)} | series,
            )
            errors.append(abs(record.final_displacement**2 + record.final_velocity**2 - 1.0))
    off = np.array(errors).reshape(-1, 2).max(axis=1)
    return Found(
        largest(off),
        Curve(PERIODS.astype(float), off, "periods (-)", "relative error of the energy (-)", x_log=True),
    )


CASES = (
    HardCase(
        "deadlines",
        THEME,
        "a dashpot of 1e5, stops at a distance of 1e-300, springs of 1e12 N/m at 1e-5 m, 10^7 periods in one step",
        "the deadline is kept within the step",
        "-",
        "processor time after the deadline in s",
        2.0,
        _deadlines,
        is_time=True,
    ),
    HardCase(
        "beyond-numbers",
        THEME,
        "a force of 1e300 on 1e-9 kg, a mass of 5e-324, a stiffness of 1e200",
        "one error that names the time",
        "-",
        "1 without such an error",
        0.0,
        _beyond_numbers,
    ),
    HardCase(
        "impact-limits",
        THEME,
        "a motion that ends by its limit on impacts, with or without their record, with samples",
        "the same final state",
        "each other",
        "change of the final state",
        4e-14,
        _impact_limits,
    ),
    HardCase(
        "long-free-motion",
        THEME,
        "an undamped motion of 512 periods in one step, or in samples",
        "keeps its energy",
        "conservation",
        "relative error of the energy",
        9e-16,
        _long_free_motion,
    ),
)

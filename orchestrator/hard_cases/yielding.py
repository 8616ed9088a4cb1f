"""Yielding stops: nearly rigid ones, power laws, preloads, a thousand short touches."""

from __future__ import annotations

import math

import numpy as np

from vibroimpact.orchestrator.hard_cases.case import Curve, Found, HardCase, largest, relative
from vibroimpact.orchestrator.hard_cases.runs import (
    IMPACT_DURATION,
    IMPACT_RESTITUTION,
    IMPACT_TIME,
    IMPACT_VELOCITY,
    PLAIN,
    kelvin_voigt,
    restitution,
    run,
)

THEME = "Stops that yield"
STIFFNESSES = 10.0 ** np.arange(6.0, 16.0)


def _nearly_rigid() -> Found:
    """A Kelvin-Voigt stop of equal restitution (equations.md 6.9): its motion tends to the rigid stop's."""
    ratio = 0.1
    root = math.sqrt(1.0 - ratio**2)
    r = math.exp(-2.0 * ratio * math.acos(ratio) / root)
    scene = {
        "body": PLAIN | {"damping": 0.1},
        "forcing": {"amplitude": 1.0, "angular_frequency": 1.3},
        "record": {"recorded_periods": 3},
    }
    rigid = run(**scene, stop=[restitution(0.5, r)]).final_displacement
    distances = []
    for stiffness in STIFFNESSES:
        damping = 2.0 * ratio * math.sqrt(stiffness)
        yielding = run(**scene, stop=[kelvin_voigt(0.5, float(stiffness), damping)]).final_displacement
        distances.append(abs(yielding - rigid))
    off = np.array(distances)
    resolved = off > 1e-9  # below, the order is dominated by rounding
    order = float(np.polyfit(np.log(STIFFNESSES[resolved] ** -0.5), np.log(off[resolved]), 1)[0])
    curve = Curve(
        STIFFNESSES, off, "stiffness (-)", "distance from the rigid stop (-)", x_log=True, is_bounded=False
    )
    return Found(abs(order - 1.0), curve)


PRODUCTS = np.array([0.01, 0.03, 0.1, 0.3, 1.0, 3.0])


def _hunt_crossley() -> Found:
    """equations.md 6.10: p (1 + e) = ln((1 + p) / (1 - p e)) with p = damping times speed, for any exponent."""
    from scipy.optimize import brentq

    errors = []
    for product in PRODUCTS:

        def off(e: float, p: float = float(product)) -> float:
            return p * (1.0 + e) - math.log((1.0 + p) / (1.0 - p * e))

        expected = brentq(off, 1e-12, min(1.0, (1.0 - 1e-13) / product), xtol=1e-16)
        worst = 0.0
        for exponent in (1.0, 1.5, 2.0, 2.5):
            stop = {
                **{"law": "hunt_crossley", "position": 0.0, "stiffness": 1e4, "exponent": exponent},
                "damping": float(product),
            }
            record = run(
                body={"mass": 1.0, "stiffness": 0.0, "displacement_start": -1.0, "velocity_start": 1.0},
                stop=[stop],
                record={"recorded_time": 3.0},
                execution={"contact_tolerance": 1e-12},
            )
            assert record.impacts is not None
            worst = max(worst, largest(relative(record.impacts[:, IMPACT_RESTITUTION], expected)))
        errors.append(worst)
    found = np.array(errors)
    return Found(
        largest(found),
        Curve(
            PRODUCTS, found, "damping times speed (-)", "relative error of the restitution (-)", x_log=True
        ),
    )


def _preloaded() -> Found:
    """A mass at the balance of a force and the stop's spring stays there."""
    stiffnesses, ends = 10.0 ** np.arange(0.0, 13.0, 2.0), []
    for stiffness in stiffnesses:
        place = 1.0 / float(stiffness)
        record = run(
            body={"mass": 1.0, "stiffness": 0.0, "displacement_start": place},
            forcing={"amplitude": 1.0, "angular_frequency": 0.0},
            stop=[kelvin_voigt(0.0, float(stiffness))],
            record={"recorded_time": 100.0},
        )
        ends.append(float(relative(record.final_displacement, place)))
    off = np.array(ends)
    return Found(
        largest(off),
        Curve(stiffnesses, off, "stiffness of the stop (-)", "relative motion in 100 s (-)", x_log=True),
    )


def _touches() -> Found:
    """An undamped spring on both sides of a gap: flights of equal length, touches of half a period of the spring."""
    stiffnesses, errors = 10.0 ** np.arange(0.0, 10.0, 3.0), []
    gap, count = 0.01, 1000
    for stiffness in stiffnesses:
        touch = math.pi / math.sqrt(float(stiffness))
        record = run(
            body={"mass": 1.0, "stiffness": 0.0, "velocity_start": 1.0},
            stop=[kelvin_voigt(gap, float(stiffness)), kelvin_voigt(0.0, float(stiffness), side="lower")],
            record={"recorded_time": count * (gap + touch) + 0.5 * gap},
        )
        assert record.impacts is not None
        if len(record.impacts) != count:
            errors.append(math.inf)
            continue
        begins = gap + (gap + touch) * np.arange(count, dtype=np.float64)
        times = largest(relative(record.impacts[:, IMPACT_TIME], begins))
        errors.append(max(times, largest(relative(record.impacts[:, IMPACT_DURATION], touch))))
    off = np.array(errors)
    return Found(
        largest(off),
        Curve(
            stiffnesses, off, "stiffness of the stops (-)", "relative error over 1000 touches (-)", x_log=True
        ),
    )


OPEN_STIFFNESSES = 10.0 ** np.arange(2.0, 13.0, 2.0)


def _open_contact() -> Found:
    """A contact that is open at the end of the recording: it has touch-down and speed, but no end."""
    errors = []
    for stiffness in OPEN_STIFFNESSES:
        record = run(
            body=PLAIN | {"displacement_start": -1.0},
            stop=[kelvin_voigt(0.0, float(stiffness))],
            record={"recorded_time": 0.5 * math.pi * (1.0 + 0.5 / math.sqrt(1.0 + stiffness))},
        )
        assert record.impacts is not None
        if len(record.impacts) != 1 or not math.isnan(record.impacts[0, IMPACT_DURATION]):
            errors.append(math.inf)
            continue
        time = relative(record.impacts[:, IMPACT_TIME], 0.5 * math.pi)
        errors.append(max(largest(time), largest(relative(record.impacts[:, IMPACT_VELOCITY], 1.0))))
    off = np.array(errors)
    curve = Curve(OPEN_STIFFNESSES, off, "stiffness (-)", "relative error of time and speed (-)", x_log=True)
    return Found(largest(off), curve)


CASES = (
    HardCase(
        "nearly-rigid",
        THEME,
        "stiffness 1e6 to 1e15 at fixed restitution",
        "tends to the rigid stop in proportion to the contact time",
        "the rigid stop",
        "distance of the order of convergence from 1",
        1.1e-3,
        _nearly_rigid,
    ),
    HardCase(
        "hunt-crossley",
        THEME,
        "Hunt-Crossley, damping times speed 0.01 to 3, exponents 1 to 2.5",
        "the restitution of the law",
        "p (1 + e) = ln((1 + p) / (1 - p e))",
        "relative error of the restitution",
        9e-11,
        _hunt_crossley,
    ),
    HardCase(
        "preloaded",
        THEME,
        "a mass in its static position on an undamped stop of 1 to 1e12 N/m",
        "stays there",
        "statics",
        "relative motion in 100 s",
        9e-16,
        _preloaded,
    ),
    HardCase(
        "touches",
        THEME,
        "1000 touches between two undamped springs of 1 to 1e9 N/m",
        "each is found once, with its duration",
        "free flight and half a period of the spring",
        "relative error of times and durations",
        5e-10,
        _touches,
    ),
    HardCase(
        "open-contact",
        THEME,
        "a contact that is open when the recording ends, stiffness 1e2 to 1e12",
        "is an impact of the recording, with unknown end",
        "free motion in closed form",
        "relative error of time and speed",
        9e-16,
        _open_contact,
    ),
)

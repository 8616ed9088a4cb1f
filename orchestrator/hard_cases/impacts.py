"""Impacts: a million of them, in narrow gaps, several at one instant, several stops at one place."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vibroimpact.orchestrator.hard_cases.case import Curve, Found, HardCase, largest, relative
from vibroimpact.orchestrator.hard_cases.runs import (
    IMPACT_IMPULSE,
    IMPACT_TIME,
    IMPACT_VELOCITY,
    PLAIN,
    STICK_START,
    impacts_of_points,
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
    """A mass under a constant force: flights of 2 r^n v / g in a convergent sum, equations.md 3.1."""
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


MASSES = (1.0, 2.5, 0.4)
COEFFICIENTS = (0.3, 0.7, 0.95)


def _absolute_restitution() -> Found:
    """Relative change of velocity at impacts of a chain's masses, and of a clamped beam's tip, whose shapes are 2."""
    errors = []
    for place, r in enumerate(COEFFICIENTS):
        chain = {"kind": "chain", "masses": list(MASSES), "stiffnesses": 1.0, "dampings": 0.05}
        beam = {"kind": "beam", "length": 1.0, "flexural_rigidity": 1.0, "mass_per_length": 1.0, "modes": 4}
        for body, force, stop, mobility in (
            (
                chain,
                {"amplitude": [1.0, 0.0, 0.0], "angular_frequency": 0.7},
                {"mass": place + 1},
                1.0 / MASSES[place],
            ),
            (beam, {"amplitude": 1.0, "angular_frequency": 3.0, "location": 0.7}, {"location": 1.0}, 16.0),
        ):
            record = run(
                body=body | ({} if body is chain else {"damping_ratio": 0.02}),
                forcing=force,
                stop=[restitution(0.05, r, **stop)],
                record={"recorded_periods": 10},
            )
            assert record.impacts is not None
            given = record.impacts[:, IMPACT_IMPULSE] * mobility / record.impacts[:, IMPACT_VELOCITY]
            errors.append(largest(relative(given, 1.0 + r)))
    off = np.array(errors)
    places = np.arange(1.0, 1.0 + len(off))
    return Found(
        largest(off), Curve(places, off, "chain, beam at each restitution", "relative error of 1 + r (-)")
    )


FALLS = np.array([0.25, 1.0, 3.0, 1024.0])


def _at_a_border() -> Found:
    """A free mass meets its stop at the border of two recordings, exactly or one bit off."""
    wrong = []
    for fall in FALLS:
        body = {"mass": 1.0, "stiffness": 0.0, "displacement_start": -float(fall), "velocity_start": 1.0}
        for border in (fall, np.nextafter(fall, 0.0), np.nextafter(fall, math.inf)):
            counted = 0
            for record in (
                {"recorded_time": float(border)},
                {"transient_time": float(border), "recorded_time": float(fall)},
            ):
                impacts = run(body=body, stop=[restitution(0.0, 0.5)], record=record).impacts
                assert impacts is not None
                counted += len(impacts)
            wrong.append(abs(counted - 1.0))
    off = np.array(wrong).reshape(-1, 3).sum(axis=1)
    return Found(
        float(off.sum()),
        Curve(FALLS, off, "length of the recording (-)", "miscounts (-)", x_log=True, y_log=False),
    )


SMALLEST = np.array([1e-300, 1e-100, 1e-20])


def _dead_stop() -> Found:
    """A restitution near 0: the motion is the same as with a dead stop."""

    def end_of(r: float) -> tuple[float, float]:
        record = run(
            body=PLAIN | {"damping_ratio": 0.05},
            forcing={"amplitude": 1.0, "angular_frequency": 0.9},
            stop=[restitution(0.3, r)],
            record={"recorded_periods": 20},
        )
        return record.final_displacement, record.final_velocity

    dead = np.array(end_of(0.0))
    off = np.array([np.abs(np.array(end_of(float(r))) - dead).max() for r in SMALLEST])
    return Found(
        largest(off), Curve(SMALLEST, off, "restitution (-)", "change of the final state (-)", x_log=True)
    )


def _errors_in_lanes(**tables: Any) -> list[float]:
    """Return the largest relative error of each point's impacts in lanes; inf where their number differs."""
    pairs = zip(impacts_of_points("auto", **tables), impacts_of_points("fused", **tables), strict=True)
    return [
        largest(relative(lanes, alone)) if lanes.shape == alone.shape else math.inf for lanes, alone in pairs
    ]


def _in_lanes() -> Found:
    """Sweeps of the starts of one mass, a chain and a beam, in lanes of the vector registers and one by one."""
    starts = {"start": -0.9, "stop": 0.1, "points": 20}
    bodies: tuple[tuple[dict[str, Any], dict[str, Any], str], ...] = (
        (
            PLAIN | {"damping_ratio": 0.1},
            {"amplitude": 0.5, "angular_frequency": 1.0},
            "body.displacement_start",
        ),
        (
            {
                **{"kind": "chain", "masses": [1.0, 1.0], "stiffnesses": 1.0, "dampings": 0.1},
                "displacement_start": [0.0, 0.0],
            },
            {"amplitude": [0.5, 0.0], "angular_frequency": 0.9},
            "body.displacement_start[2]",
        ),
        (
            {
                **{"kind": "beam", "length": 1.0, "flexural_rigidity": 1.0, "mass_per_length": 1.0},
                **{"modes": 4, "damping_ratio": 0.05, "displacement_start": [0.0, 0.0, 0.0, 0.0]},
            },
            {"amplitude": 5.0, "angular_frequency": 3.0, "location": 1.0},
            "body.displacement_start[1]",
        ),
    )
    errors = []
    for body, forcing, key in bodies:
        errors += _errors_in_lanes(
            **{"body": body, "forcing": forcing, "stop": [restitution(0.3, 0.7)]},
            **{"record": {"recorded_periods": 12}, "sweep": {key: starts}},
        )
    off = np.array(errors)
    return Found(
        largest(off), Curve(np.arange(1.0, 61.0), off, "points of mass, chain, beam", "relative error (-)")
    )


def _four_stops_in_lanes() -> Found:
    """Sweep of the start of a beam between two pairs of stops, in lanes and one by one."""
    body = {
        **{"kind": "beam", "length": 1.0, "flexural_rigidity": 1.0, "mass_per_length": 1.0},
        **{"modes": 4, "damping_ratio": 0.05, "displacement_start": [0.0, 0.0, 0.0, 0.0]},
    }
    stops = [
        restitution(sign * 0.3 * place, 0.8, side="upper" if sign > 0.0 else "lower", location=place)
        for place in (0.6, 1.0)
        for sign in (1.0, -1.0)
    ]
    starts = {"start": -0.02, "stop": 0.02, "points": 20}
    off = np.array(
        _errors_in_lanes(
            body=body,
            forcing={"amplitude": 1.0, "angular_frequency": 3.5, "location": 1.0},
            stop=stops,
            record={"recorded_periods": 2},
            sweep={"body.displacement_start[1]": starts},
        )
    )
    start = np.linspace(-0.02, 0.02, 20)
    return Found(largest(off), Curve(start, off, "start of the first mode (-)", "relative error (-)"))


CASES = (
    HardCase(
        "elastic-million",
        THEME,
        "a million elastic impacts",
        "the energy is conserved",
        "conservation",
        "relative error of the energy",
        3e-14,
        _elastic,
    ),
    HardCase(
        "nearly-elastic",
        THEME,
        "restitution 0.999 under a force: flights that end at rest",
        "impacts and the instant of rest",
        "geometric sums in closed form",
        "relative error of times and speeds",
        3e-11,
        _nearly_elastic,
    ),
    HardCase(
        "narrow-gap",
        THEME,
        "1000 impacts between two elastic stops 1e-3 to 1e-12 apart",
        "each is found, the speed is conserved",
        "free flight",
        "relative error of times and speeds",
        9e-16,
        _narrow_gap,
    ),
    HardCase(
        "simultaneous",
        THEME,
        "two masses that impact at one instant",
        "energy and symmetry are conserved",
        "conservation, mirror symmetry",
        "asymmetry, or relative error of the energy",
        1.2e-12,
        _simultaneous,
    ),
    HardCase(
        "absolute-restitution",
        THEME,
        "masses of a chain and the tip of a beam, restitution 0.3, 0.7 and 0.95",
        "each impact multiplies the speed by minus the restitution",
        "mass, or mode shapes at the tip, in closed form",
        "relative error of 1 + r",
        2e-14,
        _absolute_restitution,
    ),
    HardCase(
        "at-a-border",
        THEME,
        "an impact at the instant where one recording ends and the next begins",
        "belongs to one of them",
        "free flight",
        "miscounts",
        0.0,
        _at_a_border,
    ),
    HardCase(
        "next-to-dead",
        THEME,
        "restitution 1e-300 to 1e-20",
        "the motion equals that with restitution 0",
        "the dead stop",
        "change of the final state",
        9e-16,
        _dead_stop,
    ),
    HardCase(
        "in-lanes",
        THEME,
        "60 points of a mass, a chain and a beam, computed together",
        "have the same impacts as one by one",
        "each point alone",
        "relative error of times and speeds",
        7e-14,
        _in_lanes,
    ),
    HardCase(
        "four-stops-in-lanes",
        THEME,
        "20 points of a beam between two pairs of stops, computed together",
        "have the same impacts as one by one, slow ones too",
        "each point alone",
        "relative error of times and speeds",
        4e-11,
        _four_stops_in_lanes,
    ),
)

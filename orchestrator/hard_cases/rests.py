"""Chatter, sticking, release: beams that come to rest, loads that change sign, long rests."""

from __future__ import annotations

import cmath
import math

import numpy as np

from vibroimpact.fmus.core.modes import beam_modes
from vibroimpact.orchestrator.hard_cases.case import Curve, Floats, Found, HardCase, largest, relative
from vibroimpact.orchestrator.hard_cases.finding import first_root
from vibroimpact.orchestrator.hard_cases.flights import (
    QUARTER,
    bounces,
    first_impact,
    released,
    start_that_ends_at_the_turn,
)
from vibroimpact.orchestrator.hard_cases.runs import (
    IMPACT_TIME,
    IMPACT_VELOCITY,
    PLAIN,
    STICK_END,
    STICK_START,
    kelvin_voigt,
    restitution,
    run,
)

THEME = "Chatter, sticking, release"
BEAM = {"kind": "beam", "length": 1.0, "flexural_rigidity": 1.0, "mass_per_length": 1.0}


def _pressed_beam() -> Found:
    """A beam pressed to its stop by a constant force: the force of the stop is the static one."""
    modes, load, limit = 6, 5.0, 0.05
    shapes = beam_modes("clamped_free", modes)
    flexibility = shapes.shapes([0.5, 1.0]) / shapes.eigenvalues**2
    middle, tip = flexibility
    expected = (load * middle @ tip - limit) / (tip @ tip)
    end, samples = 400.0, 200
    record = run(
        body={**BEAM, "modes": modes, "damping_ratio": 0.1},
        forcing={"amplitude": load, "angular_frequency": 0.0, "location": 0.5},
        stop=[restitution(limit, 0.7)],
        record={"recorded_time": end, "time_series": {"rate": samples / end, "variables": ["contact_force"]}},
    )
    assert record.samples is not None
    time, force = record.samples[1:].T
    off = relative(force, expected)
    return Found(float(off[-1]), Curve(time, off, "time (-)", "relative distance from the static force (-)"))


def _turning_load() -> Found:
    """A mass without a spring, at rest on its stop, under F cos(w t): it leaves where the force changes sign."""
    frequencies = 10.0 ** np.arange(-3.0, 4.0)
    errors = []
    for w in frequencies:
        record = run(
            body={"mass": 1.0, "stiffness": 0.0},
            forcing={"amplitude": 1.0, "angular_frequency": float(w)},
            stop=[restitution(0.0, 0.5)],
            record={"recorded_periods": 1},
        )
        assert record.sticks is not None
        errors.append(largest(relative(record.sticks[:1, STICK_END], 0.5 * math.pi / w)))
    off = np.array(errors)
    return Found(
        largest(off),
        Curve(frequencies, off, "frequency of the load (-)", "relative error of the release (-)", x_log=True),
    )


def _undamped_rest() -> Found:
    """Four undamped modes with their point at rest on a dead stop, in 1000 steps: the others keep their energy."""
    end, samples = 1000.0, 1000
    record = run(
        body={**BEAM, "modes": 4, "displacement_start": [0.0, 0.1, 0.0, 0.0]},
        forcing={"amplitude": 500.0, "angular_frequency": 0.0, "location": 1.0},
        stop=[restitution(0.0, 0.0)],
        record={
            "transient_time": 50.0,
            "recorded_time": end,
            "time_series": {"rate": samples / end, "variables": ["energy.kinetic", "energy.potential"]},
        },
    )
    assert record.samples is not None
    time, kinetic, potential = record.samples.T
    energy = kinetic + potential
    off = np.abs(energy / energy[0] - 1.0)
    return Found(largest(off), Curve(time, off, "time (-)", "relative error of the energy (-)"))


STIFFNESSES = 10.0 ** np.arange(4.0, 13.0, 2.0)


def _stiff_rest() -> Found:
    """A mass pressed to a stiff undamped stop by F (1 + cos w t) - F/2: released at the zero of the stop's force."""
    errors = []
    for stiffness in STIFFNESSES:
        w, load = 0.01, 1.0
        # starts in its place, moving with it: x = F cos(w t) / (k - m w^2), the steady motion
        record = run(
            body={"mass": 1.0, "stiffness": 0.0, "displacement_start": load / (stiffness - w**2)},
            forcing={"amplitude": load, "angular_frequency": w},
            stop=[kelvin_voigt(0.0, float(stiffness))],
            record={"recorded_periods": 1},
        )
        assert record.impacts is not None
        # the first contact ends at the zero of its force: at a quarter of the period
        released = record.impacts[0, 0] + record.impacts[0, 6]
        errors.append(float(relative(released, 0.5 * math.pi / w)))
    off = np.array(errors)
    return Found(
        largest(off),
        Curve(STIFFNESSES, off, "stiffness of the stop (-)", "relative error of the release (-)", x_log=True),
    )


def _chatter() -> Found:
    """A mass falls on a stop: the instant at which infinitely many bounces end, for every restitution."""
    coefficients = np.array([0.05, 0.1, 0.3, 0.5, 0.7, 0.9, 0.95, 0.99])
    errors = []
    for r in coefficients:
        record = run(
            body={"mass": 1.0, "stiffness": 0.0, "displacement_start": -1.0},
            forcing={"amplitude": 2.0, "angular_frequency": 0.0},
            stop=[restitution(0.0, float(r))],
            record={"recorded_time": 1000.0},
        )
        assert record.sticks is not None
        errors.append(largest(relative(record.sticks[:1, STICK_START], 1.0 + 2.0 * r / (1.0 - r))))
    off = np.array(errors)
    return Found(largest(off), Curve(coefficients, off, "restitution (-)", "relative error of the rest (-)"))


TURNING = {"amplitude": 1.0, "angular_frequency": 1.0}
FREE = {"mass": 1.0, "stiffness": 0.0}
RELEASE_OFFSETS = np.array([-1e-2, -1e-5, -1e-9, -1e-12, 0.0, 1e-12, 1e-9, 1e-5, 1e-2])
"""Change of the velocity at the start: the bounces end before the release, at it, or not at all."""
RESOLVED_OFFSET = 1e-9
"""Offset above which rounding does not decide whether the mass comes to rest."""
WELL_BEFORE = 1e-2
"""Offset above which the instant of rest is well-conditioned."""
BOUNCING = (0.3, 0.5, 0.7, 0.95)
"""Restitutions."""
COMPARED = 3
"""Compared first impacts: each multiplies an error by 1 to 5."""


def _end_at_release() -> Found:
    """A free mass under cos(t) bounces to rest at the turn of the load, or near it; its later motion is compared."""
    errors = [
        [
            _off_bounces(r, abs(float(offset)), *start_that_ends_at_the_turn(r, float(offset)))
            for r in BOUNCING
        ]
        for offset in RELEASE_OFFSETS
    ]
    off = np.array(errors).max(axis=1)
    words = "start off by -1e-2, -1e-5, -1e-9, -1e-12, 0, ..."
    return Found(largest(off), Curve(np.arange(9.0), off, words, "relative error (-)"))


def _off_bounces(r: float, offset: float, place: float, velocity: float) -> float:
    """Return the largest relative error of the first impacts, the rest, its end, and the end of the motion."""
    record = run(
        body=FREE | {"displacement_start": place, "velocity_start": velocity},
        forcing=TURNING,
        stop=[restitution(0.0, r)],
        record={"recorded_periods": 1},
    )
    assert record.impacts is not None
    assert record.sticks is not None
    expected = bounces(*first_impact(place, velocity), r)
    comes_to_rest = not math.isnan(expected.rest)
    first = record.impacts[:COMPARED, [IMPACT_TIME, IMPACT_VELOCITY]]
    impacts = np.stack([QUARTER + np.array(expected.phases), expected.speeds], axis=1)[:COMPARED]
    if first.shape != impacts.shape or (
        offset >= RESOLVED_OFFSET and bool(len(record.sticks)) != comes_to_rest
    ):
        return math.inf
    last = (0.0, 0.0) if comes_to_rest else (expected.phases[-1], r * expected.speeds[-1])
    end = np.array(released(*last, 3.0 * QUARTER))
    off = [
        relative(first, impacts),
        relative(np.array([record.final_displacement, record.final_velocity]), end),
    ]
    off.append(relative(record.sticks[:1, STICK_END], QUARTER))
    if comes_to_rest and offset >= WELL_BEFORE:
        off.append(relative(record.sticks[:1, STICK_START], QUARTER + expected.rest))
    return largest(np.concatenate(off, axis=None))


ROOMS = np.array([1e-3, 1e-6, 1e-9, 1e-12])
TURNS = 10


def _pressed_in_turn() -> Found:
    """A free mass that cos(t) presses to two stops in turn: distance of its impacts from the stops."""
    off = np.array([[_off_turns(float(room), r) for r in (0.3, 0.8)] for room in ROOMS]).max(axis=1)
    curve = Curve(ROOMS, off, "gap (-)", "error of impacts and rests as a distance (-)", x_log=True)
    return Found(largest(off), curve)


def _off_turns(room: float, r: float) -> float:
    """Return the largest error of a time, times the first impact's speed there: a length; cos(t)'s path is 1."""
    record = run(
        body=FREE,
        forcing=TURNING,
        stop=[restitution(0.0, r), restitution(-room, r, side="lower")],
        record={"recorded_periods": TURNS // 2},
    )
    assert record.impacts is not None
    assert record.sticks is not None
    crossing, speed = first_impact(-room, 0.0, load=0.0, slope=1.0)
    expected = bounces(crossing, speed, r)
    off = []
    for turn in range(TURNS):
        release = QUARTER + math.pi * turn
        first = record.impacts[record.impacts[:, IMPACT_TIME] > release][:COMPARED]
        if len(first) < COMPARED or len(record.sticks) != TURNS + 1:
            return math.inf
        off.append(first[:, IMPACT_TIME] - release - expected.phases[:COMPARED])
        off.append(record.sticks[turn + 1, STICK_START] - release - expected.rest)
    return largest(np.abs(np.concatenate(off, axis=None))) * speed


FOURTH_ORDER_OFFSETS = np.array([-1e-3, -1e-6, -1e-12, 0.0, 1e-12, 1e-6, 1e-3])
"""Relative distance of the amplitude from the force that presses the body to its stop."""
FREQUENCIES = (0.3, 0.7, 1.4)


def _fourth_order() -> Found:
    """The force of a stop is 0 together with its slope: the body leaves by the fourth power of time, or stays."""
    errors = []
    for amplitude in 1.0 + FOURTH_ORDER_OFFSETS:
        errors += [_off_return(float(amplitude), w, ratio) for w in FREQUENCIES for ratio in (0.0, 0.1)]
        errors += [_off_touch(float(amplitude), w) for w in FREQUENCIES]
    off = np.array(errors).reshape(len(FOURTH_ORDER_OFFSETS), -1).max(axis=1)
    words = "amplitude off by -1e-3, -1e-6, -1e-12, 0, ..."
    return Found(largest(off), Curve(np.arange(7.0), off, words, "relative error (-)"))


def _off_return(amplitude: float, w: float, ratio: float) -> float:
    """Return the error of the next impact of a body that is at its stop, at 1, at the largest force."""
    held = math.atan2(math.sqrt(max(0.0, (amplitude - 1.0) * (amplitude + 1.0))), 1.0) / w
    steady = amplitude / complex(1.0 - w**2, 2.0 * ratio * w)
    turned = steady * cmath.exp(1j * w * held)
    away, speed, swing = 1.0 - turned.real, w * turned.imag, math.sqrt(1.0 - ratio**2)

    def motion(t: Floats) -> tuple[Floats, Floats]:
        u = t - held
        decay, c, s = np.exp(-ratio * u), np.cos(swing * u), np.sin(swing * u) / swing
        driven = steady * np.exp(1j * w * t)
        place = driven.real + decay * (away * c + (speed + ratio * away) * s)
        return place, (1j * w * driven).real + decay * (speed * c - (ratio * speed + away) * s)

    off_the_stop = held + 0.3 / w
    expected = off_the_stop + first_root(lambda u: motion(off_the_stop + u)[0] - 1.0, 9.0 / w)
    record = run(
        body=PLAIN | {"damping_ratio": ratio, "displacement_start": 1.0},
        forcing={"amplitude": amplitude, "angular_frequency": w},
        stop=[restitution(1.0, 0.5)],
        record={"recorded_periods": 2},
    )
    assert record.impacts is not None
    impact = [expected, float(motion(np.array(expected))[1])]
    return largest(relative(record.impacts[:1, [IMPACT_TIME, IMPACT_VELOCITY]], np.array(impact)))


def _off_touch(amplitude: float, w: float) -> float:
    """Return the distance of a body from its stop at -1. The force 1 + amplitude cos(w t) only touches 0 there."""
    periods = 5
    record = run(
        body=PLAIN | {"displacement_start": -1.0},
        forcing={"amplitude": amplitude, "angular_frequency": w},
        stop=[restitution(-1.0, 0.5)],
        record={"recorded_periods": periods},
    )
    assert record.sticks is not None
    rest_count = periods + 1 if amplitude > 1.0 else 1
    if len(record.sticks) != rest_count:
        return math.inf
    return largest(np.abs([record.final_displacement + 1.0, record.final_velocity]))


CASES = (
    HardCase(
        "chatter",
        THEME,
        "a mass that falls on a stop, restitution 0.05 to 0.99",
        "the instant at which infinitely many bounces end",
        "geometric sum",
        "relative error of the time",
        3e-14,
        _chatter,
    ),
    HardCase(
        "pressed-beam",
        THEME,
        "a beam of 6 modes pressed to its stop after chatter",
        "comes to rest; the force at the stop",
        "static flexibility of its modes",
        "relative error of the force at the end",
        1.7e-13,
        _pressed_beam,
    ),
    HardCase(
        "turning-load",
        THEME,
        "a load that changes sign at 1e-3 to 1e3 rad/s",
        "the mass lifts off at that instant",
        "zero of the load",
        "relative error of the time",
        7e-15,
        _turning_load,
    ),
    HardCase(
        "undamped-rest",
        THEME,
        "an undamped beam of 4 modes at rest on a dead stop, in 1000 steps",
        "the remaining motion keeps its energy",
        "conservation",
        "relative error of the energy",
        3e-13,
        _undamped_rest,
    ),
    HardCase(
        "stiff-rest",
        THEME,
        "a rest on an undamped stop of 1e4 to 1e12 N/m under a slow load",
        "released at the zero of the force",
        "steady motion in closed form",
        "relative error of the time",
        1e-14,
        _stiff_rest,
    ),
    HardCase(
        "end-at-release",
        THEME,
        "bounces that end as their load changes sign; starts off by 1e-12 to 1e-2",
        "come to rest before the release, or leave; the motion after it",
        "flights in closed form, backwards from the release",
        "relative error of impacts, rest, release and final state",
        7e-13,
        _end_at_release,
    ),
    HardCase(
        "pressed-in-turn",
        THEME,
        "a load that presses a mass alternately to two stops 1e-3 to 1e-12 apart",
        "crosses the gap at each change of sign, and bounces to rest",
        "flights in closed form",
        "error of times as a distance, relative to that of the load",
        5e-14,
        _pressed_in_turn,
    ),
    HardCase(
        "fourth-order",
        THEME,
        "a stop force that is 0 with zero slope, or off by 1e-12 to 1e-3",
        "the body leaves with the fourth power of time; or it stays, if the force only touches 0",
        "closed form; statics",
        "relative error of the next impact, or of the rest position",
        9e-14,
        _fourth_order,
    ),
)

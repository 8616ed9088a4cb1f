"""Impacts of structures in 40 digits, from matrices of masses and springs: chains, pairs, cavities, shaken tables.

Chaos multiplies the rounding of a run. The 40-digit motion from a start that is off by rounding says how much: events
agree until it is 1e-9 off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from support.exact_impacts import ExactBody, ExactImpact, ExactMotion, ExactSine, ExactStop, diagonal
from support.exact_motion import Oscillator, exact_flow

import vibroimpact as vi
from vibroimpact.orchestrator.scene import Scene

ROUNDING = 1e-15
"""Change of the start that stands for the rounding of a run."""
PARTED, EVENTS, FACTOR = 1e-9, 14, 20.0
"""Difference from which on chaos has parted two motions; most events; factor on what the change of the start makes."""
CLOSED, SUM = 1e-11, 1e-12
"""Largest relative error against a closed form of a cavity, and of the sum of motions in the millionth period."""
EPSILON = float(np.finfo(np.float64).eps)
GOLDEN = 1.618033988749895

Sine = tuple[float, float, float]
"""Amplitude, angular frequency and phase."""


def chain_matrix(springs: Sequence[float]) -> list[list[float]]:
    """Return the matrix of springs from the ground through the masses."""
    k = [*springs, 0.0]
    found = diagonal([k[i] + k[i + 1] for i in range(len(springs))])
    for i in range(1, len(springs)):
        found[i - 1][i] = found[i][i - 1] = -k[i]
    return found


def forces(sines: Sequence[Sine], where: int, size: int) -> list[ExactSine]:
    return [
        ExactSine([amplitude if i == where else 0.0 for i in range(size)], frequency, phase)
        for amplitude, frequency, phase in sines
    ]


def force_tables(sines: Sequence[Sine], **place: str) -> list[dict[str, Any]]:
    return [
        place
        | (
            {"amplitude": amplitude, "angular_frequency": frequency, "phase": phase}
            if frequency
            else {"signal": "constant", "amplitude": amplitude}
        )
        for amplitude, frequency, phase in sines
    ]


def impacts_of(body: ExactBody, stops: Sequence[ExactStop], end: float) -> list[ExactImpact]:
    motion = ExactMotion(body, stops)
    found: list[ExactImpact] = []
    while len(found) < EVENTS and (hit := motion.next_impact(end)) is not None:
        found.append(hit)
    return found


def assert_events(body: ExactBody, stops: Sequence[ExactStop], tables: dict[str, Any], least: int) -> None:
    """The events of the scene are those of 40 digits, `least` of them at least, until rounding parts two motions."""
    found = vi.run(Scene.from_dict(tables))
    end = float(found.impact_time[-1]) + 1e-6
    exact = impacts_of(body, stops, end)
    twin = impacts_of(replace(body, velocity=[v + ROUNDING for v in body.velocity]), stops, end)
    count = min(len(exact), len(twin), found.sizes["impact"])
    scale = max(float(each.velocity) for each in exact)
    same = 0
    for k in range(count):
        hit, moved = exact[k], twin[k]
        spread = max(float(abs(moved.time - hit.time)), float(abs(moved.velocity - hit.velocity)) / scale)
        if moved.contact != hit.contact or FACTOR * spread > PARTED:
            break
        allowed = FACTOR * (spread + ROUNDING * (1.0 + float(hit.time)))
        assert found.impact_contact[k] == hit.contact, k
        assert abs(float(mp.mpf(float(found.impact_time[k])) - hit.time)) <= allowed, k
        assert abs(float(mp.mpf(float(found.impact_velocity[k])) - hit.velocity)) / scale <= allowed, k
        same = k + 1
    assert same >= least


@pytest.mark.parametrize(
    "sines",
    [
        [(0.5, 1.1, 0.0)],
        [(0.5, 1.1, 0.0), (0.3, 1.1 * GOLDEN, 1.0)],
        [(0.5, 1.1, 0.0), (0.3, 2.2, -2.0), (-0.1, 0.0, 0.0)],
    ],
)
def test_two_masses_of_one_chain_that_hit_each_other(sines: list[Sine]) -> None:
    masses, springs, dashpots = [1.0, 0.5, 0.7], [1.0, 0.8, 0.5], [0.03, 0.01, 0.02]
    body = ExactBody(
        diagonal(masses),
        chain_matrix(dashpots),
        chain_matrix(springs),
        forces(sines, 0, 3),
        [0.0] * 3,
        [0.0] * 3,
    )
    stops = [ExactStop([1, -1, 0], 0.05, 0.7), ExactStop([0, -1, 1], 0.1, 0.6)]
    contacts = [
        {"between": ["chain.1", "chain.2"], "restitution": 0.7, "clearance": 0.05},
        {"between": ["chain.3", "chain.2"], "restitution": 0.6, "clearance": 0.1},
    ]
    chain = {"name": "chain", "kind": "chain", "masses": masses, "stiffnesses": springs, "dampings": dashpots}
    record = {"recorded_periods": 8}
    forcing = force_tables(sines, at="chain.1")
    tables = {"body": [chain], "contact": contacts, "forcing": forcing, "record": record}
    assert_events(body, stops, tables, 10)


@pytest.mark.parametrize(
    ("stiffness", "law"), [(0.0, {"restitution": 0.8}), (2.0, {"stiffness": 300.0, "damping": 0.5})]
)
def test_an_impact_pair_of_free_or_sprung_masses(stiffness: float, law: dict[str, float]) -> None:
    """Two free masses that a spring joins, or each with its own, hit each other on one side."""
    masses, own, link = [1.0, 0.4], [stiffness, 0.5 * stiffness], 1.5
    springs = [[own[0] + link, -link], [-link, own[1] + link]]
    sines = [(0.4, 1.3, 0.0), (0.2, 0.7, 2.0)]
    body = ExactBody(
        diagonal(masses), diagonal([0.0] * 2), springs, forces(sines, 0, 2), [0.0] * 2, [0.0, -0.3]
    )
    bodies = [
        {"name": name, "mass": m, "stiffness": k, "velocity_start": v}
        for name, m, k, v in zip("ab", masses, own, (0.0, -0.3), strict=True)
    ]
    kind = {"law": "kelvin_voigt"} if "stiffness" in law else {}
    tables = {
        **{"body": bodies, "link": [{"between": ["a", "b"], "stiffness": link}]},
        **{"contact": [{"between": ["a", "b"], "clearance": 0.02} | law | kind]},
        **{"forcing": force_tables(sines, at="a"), "record": {"recorded_periods": 5}},
    }
    assert_events(body, [ExactStop([1, -1], 0.02, **law)], tables, 10)


def test_a_ball_in_the_cavity_of_an_oscillator_under_two_sines() -> None:
    sines = [(0.3, 1.05, 0.0), (0.1, 1.05 * GOLDEN, 0.4)]
    body = ExactBody(
        diagonal([1.0, 0.1]),
        diagonal([0.04, 0.0]),
        diagonal([1.0, 0.0]),
        forces(sines, 0, 2),
        [0.0] * 2,
        [0.0, 0.2],
    )
    stops = [ExactStop([1, -1], 0.3, 0.6), ExactStop([-1, 1], 0.3, 0.6)]
    tables = {
        "body": [
            {"name": "frame", "mass": 1.0, "stiffness": 1.0, "damping": 0.04},
            {"name": "ball", "mass": 0.1, "stiffness": 0.0, "velocity_start": 0.2},
        ],
        "contact": [
            {"between": between, "restitution": 0.6, "clearance": 0.3}
            for between in (["frame", "ball"], ["ball", "frame"])
        ],
        **{"forcing": force_tables(sines, at="frame"), "record": {"recorded_periods": 10}},
    }
    assert_events(body, stops, tables, 10)


def test_a_ball_under_its_weight_on_a_shaken_table_that_rises() -> None:
    body = ExactBody([[1.0]], [[0.0]], [[0.0]], [ExactSine([-1.0])], [0.5], [0.0])
    floor = ExactStop([-1], 0.0, 0.9, speed=-0.01, amplitude=-0.3, angular_frequency=2.0)
    tables = {
        "body": {"mass": 1.0, "stiffness": 0.0, "displacement_start": 0.5},
        "stop": [
            {
                **{"position": 0.0, "side": "lower", "restitution": 0.9, "velocity": 0.01},
                **{"motion_amplitude": 0.3, "motion_angular_frequency": 2.0},
            }
        ],
        "forcing": [{"signal": "constant", "amplitude": -1.0}],
        "record": {"recorded_periods": 10},
    }
    assert_events(body, [floor], tables, 5)


@pytest.mark.parametrize(
    ("mass", "r", "frequency", "room", "force"),
    [(0.1, 0.6, 1.2, 0.3, 0.5), (0.05, 0.8, 1.3, 0.6, 1.0), (0.2, 0.4, 1.5, 0.3, 1.0)],
)
def test_a_ball_that_meets_both_ends_of_its_cavity_in_turn_has_a_closed_form(
    mass: float, r: float, frequency: float, room: float, force: float
) -> None:
    """Two impacts a period at equal distance h = pi / w, in the cavity of an undamped frame with mass and stiffness 1.

    The ball flies with the speed u, which its impacts turn: the frame gains 2 mu u, mu = mass. After an impact at t0
    the frame moves by A cos(w t) + mu u (sin s - tan(h / 2) cos s) with s = t - t0. Here A = force / (1 - w^2), and
    x(t + h) = -x(t). The ball crosses the room d to either side: u h = 2 x(t0) + 2 d. Restitution of the relative speed
    gives the other of two equations:

        A cos(w t0) = u (h / 2 + mu tan(h / 2)) - d,  A w sin(w t0) = u ((1 - r + 2 mu) / (1 + r) - mu)
    """
    h = np.pi / frequency
    amplitude, way = force / (1.0 - frequency**2), h / 2.0 + mass * np.tan(h / 2.0)
    ratio = (1.0 - r + 2.0 * mass) / (1.0 + r)
    speed = np.roots(
        [way**2 + ((ratio - mass) / frequency) ** 2, -2.0 * room * way, room**2 - amplitude**2]
    ).max()
    phase = np.arctan2(speed * (ratio - mass) / frequency / amplitude, (speed * way - room) / amplitude)
    middle = phase + np.pi / 2.0  # half-way between two impacts; there the free part is at its steepest
    pace = mass * speed / np.cos(h / 2.0)
    frame = {
        "displacement_start": float(amplitude * np.cos(middle)),
        "velocity_start": float(-amplitude * frequency * np.sin(middle) + pace),
    }
    tables = {
        "body": [
            {"name": "frame", "mass": 1.0, "stiffness": 1.0} | frame,
            {"name": "ball", "mass": mass, "stiffness": 0.0, "velocity_start": -float(speed)},
        ],
        "contact": [
            {"between": between, "restitution": r, "clearance": room}
            for between in (["frame", "ball"], ["ball", "frame"])
        ],
        "forcing": force_tables([(force, frequency, float(middle))], at="frame"),
        "record": {"recorded_periods": 4},
    }
    found = vi.run(Scene.from_dict(tables))
    assert found.sizes["impact"] == 8
    turns = np.where(found.impact_contact == 2, phase, phase + np.pi)
    off = np.angle(np.exp(1j * (found.impact_phase.values - turns)))
    assert np.abs(off).max() <= CLOSED
    assert np.abs(found.impact_velocity.values / (speed * (1.0 + ratio)) - 1.0).max() <= CLOSED


PERIODS = 10**6
FIRST, OTHER = (0.5, 0.7, 0.0), (0.3, 0.7 * GOLDEN, 1.0)
NEAR = [(1e-7, 1.0 + 1e-12, 1.0), (1e-7, 1.0 - 1e-8, 0.3)]


@pytest.mark.parametrize(
    ("natural", "damping", "sines"),
    [
        (1.0, 0.02, [FIRST, OTHER]),
        (1.0, 0.0, [FIRST, OTHER]),
        (0.0, 0.0, [FIRST, (0.5, 0.9, 1.0)]),
        # at a resonance each period of the growing beat is a step of its own: some seconds
        pytest.param(1.0, 1e-9, [FIRST, NEAR[0]], marks=pytest.mark.long),
        pytest.param(1.0, 0.0, [FIRST, *NEAR], marks=pytest.mark.long),
        pytest.param(1.0, 0.0, [FIRST, (1e-7, 1.0, 1.0)], marks=pytest.mark.long),
        pytest.param(1.0, 0.0, [(1e-7, 1.0, 0.0), FIRST], marks=pytest.mark.long),
    ],
)
def test_the_millionth_period_of_several_sines_is_their_sum(
    natural: float, damping: float, sines: list[Sine]
) -> None:
    start = (0.3, -0.2)
    tables = {
        "body": {"mass": 1.0, "stiffness": natural**2, "damping": damping}
        | dict(zip(("displacement_start", "velocity_start"), start, strict=True)),
        "forcing": force_tables(sines),
    }
    clock = Scene.from_dict(tables | {"record": {"recorded_periods": 1}}).clock
    assert clock is not None
    record = {"transient_periods": PERIODS // clock.periods - 1, "recorded_periods": 1}
    found = vi.run(Scene.from_dict(tables | {"record": record}))
    with mp.workdps(60):
        time = 2 * mp.pi * (PERIODS // clock.periods * clock.periods) / mp.mpf(sines[0][1])
        parts = [
            exact_flow(
                Oscillator(1.0, damping, natural**2, amplitude, frequency),
                start if k == 0 else (0.0, 0.0),
                time,
                phase,
            )
            for k, (amplitude, frequency, phase) in enumerate(sines)
        ]
        exact = [mp.fsum(part[i] for part in parts) for i in (0, 1)]
    size = max(abs(float(part)) for each in parts for part in each)
    # the free motion has the rounding of its own phase, which is no multiple of that of the clock
    size += EPSILON / SUM * natural * float(time) * (1.0 if damping < 1e-6 else 0.0)
    assert abs(float(found.final_displacement) - float(exact[0])) <= SUM * size
    assert abs(float(found.final_velocity) - float(exact[1])) <= SUM * size

"""Impacts of structures in 40 digits, from matrices of masses and springs: chains, pairs, cavities, shaken tables.

Chaos multiplies the rounding of a run. The 40-digit motion from a start that is off by rounding says how much: events
agree until it is 1e-9 off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import mpmath as mp
import pytest
from support.exact_impacts import ExactBody, ExactImpact, ExactMotion, ExactSine, ExactStop, diagonal

import vibroimpact as vi
from vibroimpact.orchestrator.scene import Scene

ROUNDING = 1e-15
"""Change of the start that stands for the rounding of a run."""
PARTED, EVENTS, FACTOR = 1e-9, 40, 20.0
"""Difference from which on chaos has parted two motions; most events; factor on what the change of the start makes."""
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
        *(diagonal(masses), chain_matrix(dashpots), chain_matrix(springs)),
        *(forces(sines, 0, 3), [0.0] * 3, [0.0] * 3),
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
    assert_events(body, stops, tables, 15)


@pytest.mark.parametrize("stiffness", [0.0, 2.0])
@pytest.mark.parametrize("law", [{"restitution": 0.8}, {"stiffness": 300.0, "damping": 0.5}])
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
        *(diagonal([1.0, 0.1]), diagonal([0.04, 0.0]), diagonal([1.0, 0.0])),
        *(forces(sines, 0, 2), [0.0, 0.0], [0.0, 0.2]),
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
    assert_events(body, stops, tables, 12)


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

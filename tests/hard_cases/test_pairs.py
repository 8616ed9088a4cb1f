"""Bodies that hit each other: momentum, energy, the order of impacts, rest, compliant laws.

References: the closed forms of equations.md 3.5, exact motion of one mass, the same run in other steps.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.coupled_parts import VERSIONS, values
from support.pair_parts import PairRun, cradle, hit, pair, run_of

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.importer.specification import PairSpec

ROLLS = {"stiffness": 0.0}
QUARTER = 0.5 * math.pi


# ---- one impact ----


@given(
    masses=st.tuples(st.floats(1e-3, 1e3), st.floats(1e-3, 1e3)),
    restitution=st.floats(0.0, 1.0),
    speeds=st.tuples(st.floats(1e-3, 1e3), st.floats(-1.0, 0.9)),
    version=st.sampled_from(VERSIONS),
)
@settings(max_examples=25, deadline=None)
def test_an_impact_keeps_the_momentum_and_turns_the_closing_speed(
    masses: tuple[float, float], restitution: float, speeds: tuple[float, float], version: str
) -> None:
    fast, slow = speeds[0], speeds[0] * speeds[1]
    bodies = [
        hit("a", version=version, mass=masses[0], velocity_start=fast, **ROLLS),
        hit("b", version=version, mass=masses[1], velocity_start=slow, **ROLLS),
    ]
    closing = fast - slow
    run = run_of(bodies, [pair("a", "b", restitution, clearance=closing)])
    momentum = run.momentum()
    size = masses[0] * abs(fast) + masses[1] * abs(slow)
    run.at(2.0)
    (_, after_a), (_, after_b) = run.motion("a"), run.motion("b")
    assert run.momentum() == pytest.approx(momentum, abs=4e-15 * size)
    assert after_b - after_a == pytest.approx(
        restitution * closing, abs=1e-14 * closing * (1.0 + size / min(masses) / fast)
    )
    assert [event.time for event in run.events] == pytest.approx([1.0], abs=1e-12)
    run.importer.free()


def test_a_pair_just_misses_and_just_meets() -> None:
    # b oscillates by 1 about 0; a waits 1 - or + 1e-9 below it
    for clearance, impacts in ((1.0 + 1e-9, 0), (1.0 - 1e-9, 1)):
        bodies = [hit("a", mass=1e6, **ROLLS), hit("b", displacement_start=1.0)]
        run = run_of(bodies, [pair("a", "b", clearance=clearance)], macro_step=100.0).at(4.0)
        assert len(run.events) == impacts
        run.importer.free()


def test_no_step_is_too_long_to_see_a_contact() -> None:
    def instants(macro_step: float) -> list[float]:
        bodies = [hit("a", displacement_start=-1.0), hit("b", stiffness=7.3, displacement_start=0.6)]
        run = run_of(bodies, [pair("a", "b", 0.9, clearance=0.3)], macro_step=macro_step).at(30.0)
        run.importer.free()
        return [event.time for event in run.events]

    short = instants(0.01)
    assert len(short) > 10
    assert instants(30.0) == pytest.approx(short, abs=1e-9)


# ---- several at one instant ----


@pytest.mark.parametrize("version", VERSIONS)
def test_in_a_cradle_one_goes_in_and_one_comes_out(version: str) -> None:
    run = cradle({0: -0.1}, version=version)
    energy = run.energy()
    run.at(QUARTER + 0.5)
    assert [event.component for event in run.events] == ["ball0", "ball1", "ball2", "ball3"]
    assert [event.index for event in run.events] == [0, 1, 2, 3]
    assert run.events[0].time == pytest.approx(QUARTER, abs=1e-12)
    for name in run.names[:4]:
        assert run.motion(name) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert run.motion("ball4") == pytest.approx((0.1 * math.sin(0.5), 0.1 * math.cos(0.5)), abs=1e-12)
    run.at(QUARTER + 20.0 * math.pi)
    assert len(run.events) == pytest.approx(84, abs=4)
    assert run.energy() == pytest.approx(energy, rel=1e-13)
    run.importer.free()


def test_in_a_cradle_two_go_in_and_two_come_out() -> None:
    run = cradle({0: -0.1, 1: -0.1}).at(QUARTER + 0.5)
    moving = [abs(run.motion(name)[1]) > 1e-9 for name in run.names]
    assert moving == [False, False, False, True, True]
    run.importer.free()


@given(
    masses=st.lists(st.floats(0.1, 10.0), min_size=3, max_size=6),
    restitution=st.floats(0.3, 1.0),
    starts=st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6),
)
@settings(max_examples=15, deadline=None)
def test_any_row_of_masses_keeps_momentum_and_never_gains_energy(
    masses: list[float], restitution: float, starts: list[float]
) -> None:
    names = [f"m{k}" for k in range(len(masses))]
    bodies = [
        hit(name, mass=mass, velocity_start=start, **ROLLS)
        for name, mass, start in zip(names, masses, starts, strict=False)
    ]
    links = [pair(*ends, restitution, clearance=0.05) for ends in pairwise(names)]
    run = run_of(bodies, links)
    momentum, energy = run.momentum(), run.energy()
    run.at(2.0)
    size = math.sqrt(2.0 * energy * sum(masses))
    assert run.momentum() == pytest.approx(momentum, abs=1e-13 * size)
    assert run.energy() <= energy * (1.0 + 1e-13)
    if restitution == 1.0:
        assert run.energy() == pytest.approx(energy, rel=1e-13)
    places = [run.motion(name)[0] + 0.05 * k for k, name in enumerate(names)]
    assert np.all(np.diff(places) > -1e-9)
    run.importer.free()


def test_two_that_meet_a_third_at_once_are_resolved_by_the_rule() -> None:
    bodies = [
        hit("a", velocity_start=1.0, **ROLLS),
        hit("b", **ROLLS),
        hit("c", velocity_start=-2.0, **ROLLS),
    ]
    run = run_of(bodies, [pair("a", "b", clearance=1.0), pair("b", "c", clearance=2.0)]).at(1.5)
    # equal masses exchange velocities: first b and c, the faster pair; then a with b, which returns at 2 m/s; then c
    assert [event.component for event in run.events] == ["b", "a", "b"]
    assert [run.motion(name)[1] for name in "abc"] == pytest.approx([-2.0, 0.0, 1.0], abs=1e-14)
    run.importer.free()


def test_impulses_that_never_end_are_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vibroimpact.orchestrator.importer.pairs.all_pairs.MOST_IMPULSES", 2)
    run = cradle({0: -0.1})
    with pytest.raises(ComponentError, match=r"expected impacts that end, got 2 at time 1\.57"):
        run.at(2.0)
    run.importer.free()


# ---- structures ----


def struck_beam(restitution: float) -> tuple[PairRun, float]:
    """Return a ball that has fallen on the tip of a beam, and the speed of the fall."""
    tip = {
        "length": 1.0,
        "flexural_rigidity": 50.0,
        "mass_per_length": 1.0,
        "modes": 4,
        "contact[1].location": 1.0,
    }
    beam = hit("beam", "Beam", **tip)
    ball = hit("ball", mass=0.3, velocity_start=2.0, **ROLLS)
    return run_of([ball, beam], [pair("ball", "beam", restitution, clearance=0.1)], macro_step=0.01), 2.0


@pytest.mark.parametrize("restitution", [1.0, 0.5])
def test_a_ball_on_the_tip_of_a_beam_gives_it_what_it_loses(restitution: float) -> None:
    run, speed = struck_beam(restitution)
    run.at(0.05)
    mass = values(run.importer, "beam", "contact[1].mass")[0]
    reduced = 1.0 / (1.0 / 0.3 + 1.0 / mass)
    _, after = run.motion("ball")
    assert 0.3 * (speed - after) == pytest.approx((1.0 + restitution) * reduced * speed, rel=1e-12)
    lost = 0.5 * reduced * speed**2 * (1.0 - restitution**2)
    assert run.energy() == pytest.approx(0.5 * 0.3 * speed**2 - lost, rel=1e-12)
    run.importer.free()


def test_chains_that_pound_at_inner_masses_keep_their_energy() -> None:
    chain = {"masses": 3, "contact[1].mass_number": 2}
    lower = hit("lower", "Chain", **chain, **{"velocity_start[3]": 1.0})
    upper = hit("upper", "Chain", **chain, **{"mass[2]": 3.0, "displacement_start[2]": -0.5})
    run = run_of([lower, upper], [pair("lower", "upper", clearance=0.51)])
    energy = run.energy()
    run.at(60.0)
    assert len(run.events) > 5
    assert run.energy() == pytest.approx(energy, rel=1e-12)
    run.importer.free()


def test_a_body_between_its_own_stop_and_another_body_keeps_the_energy() -> None:
    own = {"contact[2].law": "restitution", "contact[2].side": "lower", "contact[2].position": -0.5}
    bodies = [hit("a", velocity_start=-1.0, **ROLLS, **own), hit("b", mass=3.0, velocity_start=-0.5, **ROLLS)]
    run = run_of(bodies, [pair("a", "b", clearance=1.0)], macro_step=10.0)
    energy = run.energy()
    run.at(20.0)
    assert len(run.events) >= 2
    assert run.importer.components["a"].group("Int64", ["contact[2].count"]).get()[0] >= 2
    assert run.energy() == pytest.approx(energy, rel=1e-13)
    run.importer.free()


# ---- bounces that accumulate, rest ----


@pytest.mark.parametrize("version", VERSIONS)
def test_dead_bodies_move_as_one_until_they_part(version: str) -> None:
    bodies = [
        hit("a", version=version, displacement_start=-1.0),
        hit("b", version=version, mass=2.0, stiffness=9.0),
    ]
    run = run_of(bodies, [pair("a", "b", 0.0)]).at(QUARTER + 0.5)
    rate = math.sqrt(10.0 / 3.0)
    assert run.motion("a")[0] == pytest.approx(math.sin(0.5 * rate) / (3.0 * rate), abs=1e-5)
    assert run.motion("b")[0] == pytest.approx(run.motion("a")[0], abs=1e-5)
    run.at(QUARTER + 2.0)
    parted = 2.0 - math.pi / rate  # both springs are relaxed then: no force presses
    assert run.motion("a")[0] == pytest.approx(-math.sin(parted) / 3.0, abs=1e-5)
    assert run.motion("b")[0] == pytest.approx(
        -math.sin(math.sqrt(4.5) * parted) / math.sqrt(4.5) / 3.0, abs=1e-5
    )
    assert len(run.events) == 1
    run.importer.free()


def test_bounces_accumulate_to_rest_where_they_must() -> None:
    # a weight on a spring so soft that its force is constant: flights shrink by r, their sum is 2 v r / (1 - r) / g
    bodies = [
        hit("floor", mass=1e12, **ROLLS),
        hit("ball", forcing__amplitude=-10.0, displacement_start=1.0, **ROLLS),
    ]
    run = run_of(bodies, [pair("floor", "ball", 0.5)], macro_step=0.01)
    fall = math.sqrt(0.2)
    end = fall + 2.0 * fall * 0.5 / 0.5
    run.at(end + 1.0)
    assert run.events[-1].time == pytest.approx(end, rel=1e-3)
    assert len(run.events) < 20
    assert run.motion("ball") == pytest.approx((0.0, 0.0), abs=1e-6)
    run.importer.free()


def test_elastic_bodies_that_are_pressed_together_are_an_error_with_a_way_out() -> None:
    bodies = [hit("floor", mass=1e12, **ROLLS), hit("ball", forcing__amplitude=-10.0, **ROLLS)]
    run = run_of(bodies, [pair("floor", "ball", 1.0)], macro_step=0.01)
    with pytest.raises(ComponentError, match=r"stay in contact .* use kelvin_voigt"):
        run.at(1.0)
    run.importer.free()


# ---- compliant laws ----


@given(
    masses=st.tuples(st.floats(1e-2, 1e2), st.floats(1e-2, 1e2)),
    law=st.sampled_from(["kelvin_voigt", "hertz", "hunt_crossley"]),
    stiffness=st.floats(1e2, 1e6),
    steps=st.sampled_from([8.0, 30.0]),
    version=st.sampled_from(VERSIONS),
)
@settings(max_examples=15, deadline=None)
def test_a_lossless_law_keeps_momentum_and_energy(
    masses: tuple[float, float], law: str, stiffness: float, steps: float, version: str
) -> None:
    bodies = [
        hit("a", version=version, mass=masses[0], velocity_start=1.0, **ROLLS),
        hit("b", version=version, mass=masses[1], **ROLLS),
    ]
    spec = pair("a", "b", clearance=0.1, law=law, stiffness=stiffness)
    run = run_of(bodies, [spec], contact_steps=steps, macro_step=0.5)
    run.at(20.0)
    assert run.momentum() == pytest.approx(masses[0], rel=1e-12)
    assert run.energy() == pytest.approx(0.5 * masses[0], rel=1e-11)
    assert run.motion("b")[1] - run.motion("a")[1] == pytest.approx(1.0, abs=1e-10)
    assert [event.time for event in run.events] == pytest.approx([0.1], abs=1e-12)
    run.importer.free()


def test_a_dashpot_between_two_bodies_takes_what_its_closed_form_says() -> None:
    ratio = 0.1
    errors = []
    for steps in (15.0, 30.0, 60.0):
        bodies = [hit("a", velocity_start=1.0, **ROLLS), hit("b", **ROLLS)]
        reduced, stiffness = 0.5, 1e4
        damping = 2.0 * ratio * math.sqrt(reduced * stiffness)
        spec = pair("a", "b", clearance=0.1, law="kelvin_voigt", stiffness=stiffness, damping=damping)
        run = run_of(bodies, [spec], contact_steps=steps).at(1.0)
        root = math.sqrt(1.0 - ratio**2)
        angle = math.pi - math.atan2(2.0 * ratio * root, 1.0 - 2.0 * ratio**2)
        exact = math.exp(-ratio * angle / root)  # equations.md 6.9: separation where the force falls to 0
        errors.append(abs(run.motion("b")[1] - run.motion("a")[1] - exact))
        run.importer.free()
    assert errors[1] < 2e-3
    assert errors[2] < 0.5 * errors[0]


# ---- misuse ----


def test_bodies_that_overlap_at_the_start_are_refused_by_one_clear_error() -> None:
    bodies = [hit("a", displacement_start=0.2), hit("b")]
    with pytest.raises(ComponentError, match=r"do not overlap at the start, got a gap of -0\.1 m"):
        run_of(bodies, [pair("a", "b", clearance=0.1)])


def test_a_pair_of_one_body_twice_never_closes() -> None:
    bodies = [hit("a", **{"contact[2].law": "pair"})]
    both = PairSpec(("a", "contact[1]"), ("a", "contact[2]"), clearance=1.0)
    run = run_of(bodies, [both]).at(5.0)
    assert not run.events
    run.importer.free()

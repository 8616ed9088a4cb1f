"""Stops in every awkward place: bodies of one and many modes, against closed forms, symmetry and limits."""

import math

import numpy as np
import pytest
from support.reference_bodies import beam, chain
from support.structure import DONE, REFUSED, Modes, Stop, Structure
from support.tolerance import ROUNDING, SEQUENCE

from vibroimpact.fmus.errors import UsageError

CHAIN = chain([1.0, 2.0, 0.5], [3.0, 1.0, 2.0], [0.0] * 3)
MASS = CHAIN.shapes


def at(displacements: list[float]) -> np.ndarray:
    """Return the modal coordinates of physical displacements of the chain."""
    return np.linalg.solve(MASS, displacements)


# ---- one coordinate between two stops ----


@pytest.mark.parametrize("gap", [1e-3, 1e-9, 1e-12])
def test_between_two_elastic_stops_a_free_mass_bounces_at_its_speed(gap: float) -> None:
    stops = [Stop([1.0], gap / 2), Stop([1.0], -gap / 2, side="lower")]
    with Structure(Modes([0.0]), stops, 0.0, 1.0) as body:
        assert body.advance(1000.0 * gap) == DONE
        assert abs(len(body.impacts) - 1000) <= 1
        assert np.diff(body.impacts[:, 1]) == pytest.approx(gap, rel=1e-9)
        assert abs(body.velocity[0]) == 1.0


@pytest.mark.parametrize("position", [0.0, 0.1])
@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_two_stops_without_room_between_them_hold_a_mass_as_a_clamp(
    position: float, restitution: float
) -> None:
    # reference: with mass 2 at rest the chain is two separate oscillators, mass 1 and mass 3
    stops = [
        Stop(MASS[1], position, restitution=restitution),
        Stop(MASS[1], position, side="lower", restitution=restitution),
    ]
    start, speed = [0.2, position, 0.1], [0.3, 0.4, -0.2]
    force = MASS.T @ np.array([0.0, 1.0, 0.0])
    with Structure(Modes(CHAIN.natural, 0.0, force, 0.7), stops, at(start), at(speed)) as body:
        assert body.advance(20.0, most_impacts=2000) == DONE
        found = MASS @ body.displacement
    for mass, stiffness, x, v, i in ((1.0, 4.0, 0.2, 0.3, 0), (0.5, 2.0, 0.1, -0.2, 2)):
        w, rest = math.sqrt(stiffness / mass), position * (0.25 if i == 0 else 1.0)
        expected = rest + (x - rest) * math.cos(20.0 * w) + v / w * math.sin(20.0 * w)
        assert abs(found[i] - expected) <= SEQUENCE
    assert abs(found[1] - position) <= ROUNDING


@pytest.mark.parametrize(("above", "below"), [(1, 1), (1, 2), (3, 1), (2, 3)])
def test_a_clamped_mass_answers_a_load_from_either_side_at_once(above: int, below: int) -> None:
    stops = [Stop([1.0], 0.0)] * above + [Stop([1.0], 0.0, side="lower")] * below
    with Structure(Modes([1.0]), stops, 0.0, 0.0) as body:
        for load in (1.0, -1.0, 2.0, -3.0, 1e-9):
            assert body.advance(1.0, held=[load]) == DONE
            forces = [body.forces[:above].sum(), body.forces[above:].sum()]
            assert forces == pytest.approx([max(0.0, load), max(0.0, -load)], rel=ROUNDING)
            assert np.all(body.forces >= 0.0)
            assert body.displacement[0] == body.velocity[0] == 0.0


@pytest.mark.parametrize("steps", [1, 3, 97, 400])
@pytest.mark.parametrize(("above", "below"), [(1, 1), (1, 3), (2, 3), (3, 1)])
def test_a_clamped_mass_answers_a_load_that_turns_round_slowly(above: int, below: int, steps: int) -> None:
    shapes = (1.4, 1.0, 0.5)
    stops = [Stop([s], 0.0, restitution=0.5) for s in shapes[:above]]
    stops += [Stop([s], 0.0, restitution=0.5, side="lower") for s in shapes[:below]]
    signs = np.array([stop.shape[0] * (1.0 if stop.side == "upper" else -1.0) for stop in stops])
    with Structure(Modes([0.0], 0.0, 3.0, 2.5, -2.0), stops, 0.0, 0.0) as body:
        for step in range(steps):
            assert body.advance(20.0 * (step + 1) / steps - body.time) == DONE
            assert signs @ body.forces == pytest.approx(3.0 * math.cos(2.5 * body.time - 2.0), abs=1e-12)
            assert np.all(body.forces >= 0.0)
            assert abs(body.displacement[0]) <= 1e-15
        assert len(body.sticks) >= 15  # one for each reversal of the load


@pytest.mark.parametrize("law", ["hertz", "kelvin_voigt"])
def test_a_compliant_stop_on_a_clamped_point_is_never_pressed(law: str) -> None:
    stops = [
        Stop([1.0], 0.0, restitution=0.0),
        Stop([1.0], 0.0, law=law, stiffness=100.0),
        Stop([1.0], 0.0, restitution=0.0, side="lower"),
    ]
    with Structure(Modes([1.0]), stops, 0.0, 0.0) as body:
        for load in (1.0, -1.0):
            assert body.advance(1.0, held=[load], most_impacts=100) == DONE
            assert body.forces.tolist() == [max(0.0, load), 0.0, max(0.0, -load)]


# ---- simultaneous impacts ----


def test_two_masses_that_hit_at_the_same_instant_leave_in_either_order_of_listing_alike() -> None:
    twins = chain([1.0, 3.0, 1.0], [2.0, 1.0, 1.0], [0.0] * 3, far_stiffness=2.0)
    q, p = np.zeros(3), np.linalg.solve(twins.shapes, [1.0, 0.4, 1.0])
    stops = [Stop(twins.shapes[0], 0.1), Stop(twins.shapes[2], 0.1)]
    ends = []
    for listed in (stops, stops[::-1]):
        with Structure(Modes(twins.natural), listed, q, p) as body:
            assert body.advance(30.0) == DONE
            assert abs(body.energy / (0.5 * p @ p) - 1.0) <= SEQUENCE
            first = body.impacts[:2]
            assert first[0, 1] == pytest.approx(first[1, 1], abs=1e-15)
            assert first[:, 3] == pytest.approx(first[0, 3], rel=1e-14)
            ends.append(twins.shapes @ body.displacement)
    assert np.abs(ends[0] - ends[1]).max() <= 1e-11
    assert abs(ends[0][0] - ends[0][2]) <= 1e-11  # its own mirror image


@pytest.mark.parametrize("copies", [2, 3, 8])
def test_copies_of_one_stop_are_one_stop(copies: int) -> None:
    q, p = np.zeros(3), np.array([1.0, 0.2, -0.1])
    ends = []
    for count in (1, copies):
        stops = [Stop(MASS[2], 0.1, restitution=0.8)] * count
        with Structure(Modes(CHAIN.natural, 0.01), stops, q, p) as body:
            assert body.advance(10.0) == DONE
            ends.append(body.displacement)
            total = body.impacts[:, 4].sum()
        ends.append(total)
    assert np.abs(ends[0] - ends[2]).max() <= SEQUENCE
    assert ends[1] == pytest.approx(ends[3], rel=SEQUENCE)


# ---- nodes ----


def test_a_stop_at_a_node_of_every_moving_mode_changes_nothing_and_does_not_hang() -> None:
    modes = Modes([1.0, 2.0], 0.0)
    for position in (0.0, 0.1):
        with Structure(modes, [Stop([1.0, 0.0], position, restitution=0.5)], [0.0, 0.3], [0.0, 1.0]) as body:
            assert body.advance(20.0, most_impacts=100) == DONE
            assert len(body.impacts) == 0
            expected = 0.3 * math.cos(40.0) + 0.5 * math.sin(40.0)
            assert abs(body.displacement[1] - expected) <= SEQUENCE


def test_a_mode_driven_at_its_node_stays_still_until_an_impact_moves_it() -> None:
    supported = beam(4, boundary="pinned_pinned")
    force = np.where(np.arange(4) % 2 == 0, supported.shape(0.5), 0.0)
    stop = Stop(supported.shape(0.3), 0.01, restitution=0.7)
    with Structure(Modes(supported.natural, 0.01, force, 8.0), [stop], 0.0, 0.0) as body:
        body.advance(10.0, most_impacts=1)
        assert np.abs(body.displacement[1::2]).max() <= 1e-16
        assert abs(body.velocity[1]) > 0.01


# ---- starts ----


def test_a_start_on_the_stop_at_rest_holds_where_it_is_pressed_and_leaves_where_it_is_not() -> None:
    stop = Stop(MASS[2], 0.0, restitution=0.5)
    push = MASS[2]
    with Structure(Modes(CHAIN.natural), [stop], 0.0, 0.0) as body:
        assert body.advance(5.0, held=push) == DONE
        assert body.statuses == ("held",)
        assert abs(body.forces[0] - 1.0) <= ROUNDING
    with Structure(Modes(CHAIN.natural), [stop], 0.0, 0.0) as body:
        assert body.advance(0.1, held=-push) == DONE
        assert body.statuses == ("free",)
        assert len(body.impacts) == 0
        static = -push / CHAIN.natural**2
        assert np.abs(body.displacement - static * (1.0 - np.cos(0.1 * CHAIN.natural))).max() <= 1e-15


def test_a_start_moving_into_the_stop_is_an_impact_at_time_0() -> None:
    p = at([0.0, 0.0, 2.0])
    with Structure(Modes(CHAIN.natural), [Stop(MASS[2], 0.0, restitution=0.25)], 0.0, p) as body:
        body.advance(1e-6)
        assert body.impacts[0, [1, 3]] == pytest.approx([0.0, 2.0], abs=1e-14)
        assert (MASS @ body.velocity)[2] == pytest.approx(-0.5, abs=1e-5)


def test_a_start_beyond_a_rigid_stop_is_refused_and_a_stop_below_rest_is_met_at_once() -> None:
    with pytest.raises(UsageError):
        Structure(Modes([1.0]), [Stop([1.0], -0.1)], 0.0, 0.0)
    # a negative stop position: from rest at -0.5 a plastic stop at -0.2 holds; its force is that of the spring
    with Structure(Modes([1.0]), [Stop([1.0], -0.2, restitution=0.0)], -0.5, 0.0) as body:
        body.advance(10.0)
        assert body.statuses == ("held",)
        assert body.forces[0] == pytest.approx(0.2, rel=1e-14)
        assert body.impacts[0, 1] == pytest.approx(math.acos(0.4), rel=1e-14)


def test_a_step_of_no_length_or_less_is_refused_and_changes_nothing() -> None:
    with Structure(Modes([1.0, 3.0], 0.01), [Stop([1.0, 0.5], 0.1)], 0.0, [1.0, 0.2]) as body:
        body.advance(1.0)
        before = (body.time, body.displacement.tolist(), body.velocity.tolist(), len(body.impacts))
        for step in (0.0, -1.0, math.nan, -math.inf):
            assert body.advance(step) == REFUSED
            after = (body.time, body.displacement.tolist(), body.velocity.tolist(), len(body.impacts))
            assert after == before


def test_a_load_that_turns_round_between_steps_lifts_a_held_mass_off_at_that_instant() -> None:
    with Structure(Modes([1.0]), [Stop([1.0], 0.0, restitution=0.5)], 0.0, 0.0) as body:
        body.advance(1.0, held=[1.0])
        assert body.statuses == ("held",)
        body.advance(1.0, held=[-1.0], held_rate=[0.5])
        # x'' + x = -1 + t/2 from rest
        assert abs(body.displacement[0] - (-0.5 + math.cos(1.0) - 0.5 * math.sin(1.0))) <= ROUNDING
        assert body.sticks[:, 1:3].tolist() == [[0.0, 1.0]]
        assert len(body.impacts) == 0


# ---- beams with stops at several points ----


def test_a_beam_with_four_stops_and_uneven_damping_loses_what_its_balance_says() -> None:
    cantilever = beam(8, damping_ratio=[0.0, 0.5, 0.0, 0.3, 0.0, 0.01, 2.0, 0.0])
    zeta = np.diag(cantilever.damping) / (2.0 * cantilever.natural)
    stops = [
        Stop(cantilever.shape(1.0), 0.02, restitution=0.7),
        Stop(cantilever.shape(0.5), -0.01, side="lower", restitution=0.9),
        Stop(cantilever.shape(0.75), 0.02, law="kelvin_voigt", stiffness=1e3, damping=1.0),
        Stop(cantilever.shape(0.3), -0.005, side="lower", law="hertz", stiffness=1e5),
    ]
    force = cantilever.shape(1.0)
    with Structure(Modes(cantilever.natural, zeta, force, 3.0), stops, 0.0, 0.0, energies=True) as body:
        turned = 0.0
        for _ in range(200):
            assert body.advance(0.05, most_impacts=20000) == DONE
            turned = max(turned, abs(body.forcing_work) + body.damping_loss + abs(body.contact_loss))
            left = body.energy - body.forcing_work + body.damping_loss + body.contact_loss
            assert abs(left) <= 1e-9 * turned
            size = np.abs(body.displacement).sum() * 2.0
            for stop, sign in zip(stops[:2], (1.0, -1.0), strict=True):
                assert sign * (np.asarray(stop.shape) @ body.displacement - stop.position) <= 1e-12 * size
        assert len(body.impacts) > 100


def test_two_masses_let_go_at_one_instant_write_one_stick_each() -> None:
    # both forces fall through 0 with the cosine; rounding separates the instants
    stops = [Stop([1.0, 0.0], 0.1, restitution=0.0), Stop([0.0, 1.0], 0.4, restitution=0.0)]
    coupling = [[0.5, 0.0], [0.0, 0.0]]
    with Structure(Modes([0.0, 0.0], 0.0, [3.0, 1.0], 0.3, coupling=coupling), stops) as body:
        assert body.advance(2.0 * np.pi / 0.3) == DONE
        assert sorted(body.sticks[:, 3]) == [1.0, 2.0]
        assert np.all(body.sticks[:, 2] > body.sticks[:, 1] + 1.0)


@pytest.mark.parametrize("before", [0.0, 1e-1, 1e-5, 1e-6, 3e-7, 1e-7, 1e-9, 1e-11, 1e-13, 1e-15])
@pytest.mark.parametrize("law", ["restitution", "kelvin_voigt"])
def test_stops_at_one_place_let_a_body_go_as_one_in_any_steps(before: float, law: str) -> None:
    # the first release depends on shares of the force, which are known only to a millionth
    yields = Stop([1.0], 0.0, law=law, stiffness=1e9)
    ends = []
    for stops in ([Stop([1.4], 0.0)], [Stop([1.4], 0.0), Stop([0.72], 0.0, restitution=0.9), yields]):
        with Structure(Modes([1.0], 0.0, 9.5, 1.0), stops) as body:
            for time in (math.pi / 2.0 - before, 3.0):
                assert body.advance(time - body.time) == DONE
            assert set(body.statuses) == {"free"}
            ends.append([body.displacement[0], body.velocity[0]])
    assert ends[1] == pytest.approx(ends[0], rel=SEQUENCE)


@pytest.mark.parametrize("order", [1, -1])
def test_of_two_stops_at_one_place_the_livelier_one_throws_the_body_off(order: int) -> None:
    # the plastic stop has no impulse left to give, and does not hold a body that leaves it
    stops = [Stop([1.0], 0.0, restitution=r) for r in (0.0, 0.3)[::order]]
    with Structure(Modes(1.0), stops, 0.0, 1.0) as body:
        assert body.advance(0.5) == DONE
        assert body.displacement[0] == pytest.approx(-0.3 * math.sin(0.5), rel=ROUNDING)
        assert body.statuses == ("free", "free")


def test_a_body_that_stops_hold_in_place_is_not_worked_on() -> None:
    # two rigid stops with nearly parallel shapes: rounding of their forces is forty times as large
    near = np.array([[0.12774186, 0.60210998], [0.27296587, 1.05226582]])
    stops = [Stop(near[0], 0.0, side="lower", restitution=0.0), Stop(near[1], 0.0, restitution=0.5)]
    modes = Modes([1.0, 6.26689303], 0.02, [2.60725225, -0.97574072], 0.3)
    with Structure(modes, stops, 0.0, 0.0, energies=True) as body:
        for _ in range(50):
            assert body.advance(0.1) == DONE
        assert np.all(body.forces > 0.0)
        assert abs(body.forcing_work) <= ROUNDING

"""Fixed points of the strobe map: coordinates without jumps at impacts, winding numbers, and orbits that they show."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from vibroimpact.analysis.orbits.index_sum import IndexSum, distinct, index_sum
from vibroimpact.analysis.orbits.recurrences import orbits_passed
from vibroimpact.analysis.orbits.search import same_orbit
from vibroimpact.analysis.orbits.trigonometric import TURN
from vibroimpact.fmus.bodies import Contact
from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.orchestrator.orbits.self_check.plane_chart import PlaneChart, Wall
from vibroimpact.orchestrator.orbits.self_check.strobe_map import StrobeMap
from vibroimpact.orchestrator.orbits.self_check.winding import Marks, Search
from vibroimpact.orchestrator.scene import Scene

PARAMETER = "forcing.angular_frequency"
NOTHING = Marks(np.empty((0, 2)), np.empty(0, dtype=np.int64))


def wall(side: float, at: float, restitution: float, yield_velocity: float = 0.0) -> Wall:
    contact = Contact(np.ones(1), side, at, restitution, yield_velocity=yield_velocity)
    return Wall(at, side, 1.0, contact)


def charts(restitution: float, yield_velocity: float) -> list[PlaneChart]:
    """Return the charts beside an upper stop, beside a lower stop, and between two."""
    upper, lower = wall(1.0, 2.0, restitution, yield_velocity), wall(-1.0, -1.0, 0.5 * restitution)
    return [PlaneChart(-1.0, 2.0, 3.0, walls) for walls in ((upper,), (lower,), (upper, lower))]


@given(
    st.floats(0.05, 1.0),
    st.sampled_from([0.0, 0.3]),
    st.floats(1e-6, 3.0),
    st.integers(0, 2),
    st.integers(0, 1),
)
def test_the_states_before_and_after_an_impact_are_one_point(
    restitution: float, yield_velocity: float, speed: float, kind: int, which: int
) -> None:
    chart = charts(restitution, yield_velocity)[kind]
    hit = chart.walls[which % len(chart.walls)]
    after = hit.contact.restitution_at(speed) * speed
    before_and_after = np.array([[hit.at, hit.side * speed], [hit.at, -hit.side * after]])
    one, other = chart.points(before_and_after)
    assert one == pytest.approx(other, abs=1e-12)


@given(
    st.floats(0.05, 1.0),
    st.sampled_from([0.0, 0.3]),
    st.floats(-0.9, 1.9),
    st.floats(-2.9, 2.9),
    st.integers(0, 2),
)
def test_charts_keep_the_orientation_of_the_plane(
    restitution: float, yield_velocity: float, displacement: float, velocity: float, kind: int
) -> None:
    chart, step = charts(restitution, yield_velocity)[kind], 1e-6
    corner = np.array([displacement, velocity + 0.01])
    here, right, up = chart.points(corner + step * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
    assert ((right - here).conjugate() * (up - here)).imag > 0.0


def zeros_at(points: NDArray[np.complex128], signs: list[int]) -> Any:
    """Return a change with zeros of given indices, +1 or -1."""

    def change(states: Floats) -> NDArray[np.complex128]:
        z = states[:, 0] + 1j * states[:, 1]
        factors = [z - p if sign > 0 else (z - p).conj() for p, sign in zip(points, signs, strict=True)]
        return np.asarray(np.prod(factors, axis=0))

    return change


@given(st.integers(0, 2**32 - 1), st.integers(1, 5))
def test_winding_numbers_locate_all_zeros_and_their_signs(seed: int, count: int) -> None:
    draw = np.random.default_rng(seed)
    points = draw.uniform(-0.95, 0.95, count) + 1j * draw.uniform(-0.95, 0.95, count)
    signs = draw.choice([1, -1], count).tolist()
    change = zeros_at(points, signs)
    corner = np.ones(2)
    found = Search(change, -corner, corner, 64, 2).missing(NOTHING)
    # zeros of opposite signs in one first cell cancel each other
    cells = np.floor((points.real + 1.0) * 32.0) + 64.0 * np.floor((points.imag + 1.0) * 32.0)
    if np.unique(cells).size < count:
        return
    assert sorted(each.index for each in found) == sorted(signs)
    for each in found:
        apart = np.abs(points - complex(*each.middle))
        assert apart.min() < 1e-6
        assert signs[int(apart.argmin())] == each.index


def test_known_zeros_are_left_out_and_a_known_zero_of_a_wrong_sign_is_not() -> None:
    points, corner = np.array([0.31 + 0.2j, -0.4 - 0.55j, 0.1 + 0.7j]), np.ones(2)
    states = np.column_stack([points.real, points.imag])
    search = Search(zeros_at(points, [1, -1, 1]), -corner, corner, 16, 2)
    (left,) = search.missing(Marks(states[:2], np.array([1, -1])))
    assert left.middle == pytest.approx(states[2], abs=1e-6)
    assert [each.index for each in search.missing(Marks(states, np.array([1, 1, 1])))] == [-2]


def test_cells_where_the_change_is_unknown_are_no_zeros() -> None:
    def change(states: Floats) -> NDArray[np.complex128]:
        z = states[:, 0] + 1j * states[:, 1]
        return np.where(np.abs(z - 0.5) < 0.2, np.nan, (z - 0.5) * (z + 0.5))

    corner = np.ones(2)
    (only,) = Search(change, -corner, corner, 32, 2).missing(NOTHING)
    assert only.middle == pytest.approx([-0.5, 0.0], abs=1e-6)


def two_sided(frequency: float) -> Scene:
    stop = {"position": 1.0, "restitution": 0.7}
    return Scene.from_dict(
        {
            "scene": {"units": "nondimensional"},
            "body": {"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.04},
            "forcing": {"amplitude": 0.5, "angular_frequency": frequency},
            "stop": [stop, {**stop, "side": "lower", "position": -1.0}],
            "record": {"recorded_periods": 8},
        }
    )


def test_an_orbit_that_is_left_out_is_located() -> None:
    with StrobeMap(two_sided(0.973), PARAMETER) as strobe:
        known = list(strobe.orbits(0.973, 1))
        body = strobe.body(0.973)
        assert index_sum(body, known, 1).is_complete
        for place in (0, -1):
            others = list(known)
            left_out = others.pop(place)
            located = strobe.located(0.973, 1, others, [])
            assert [each.name for each in located.orbits] == [left_out.name]
            assert located.orbits[0].phases == pytest.approx(left_out.phases, abs=1e-8)
            assert (located.terms, located.undecided) == ([], 0)
        whole = strobe.located(0.973, 1, known, [])
        assert (whole.orbits, whole.terms, whole.undecided) == ([], [], 0)


def oscillator(
    frequency: float, forcing: dict[str, float], body: dict[str, float], stops: list[Any]
) -> Scene:
    return Scene.from_dict(
        {
            "scene": {"units": "nondimensional"},
            "body": {"mass": 1.0, "stiffness": 1.0, **body},
            "forcing": {"angular_frequency": frequency, **forcing},
            "stop": stops,
            "record": {"recorded_periods": 8},
        }
    )


def all_located(scene: Scene, frequency: float) -> IndexSum:
    """Return the sum of the fixed points that winding numbers alone locate, with the indices of their multipliers."""
    with StrobeMap(scene, PARAMETER) as strobe:
        located = strobe.located(frequency, 1, [], [])
        assert located.undecided == 0
        return index_sum(strobe.body(frequency), located.orbits, 1, (), located.terms)


def test_a_body_that_its_spring_presses_on_the_stop_keeps_all_its_orbits_in_the_plane() -> None:
    # small rings of one energy have no state on the free side of the stop
    frequency = 1.0978
    body = {"damping_ratio": 0.3, "displacement_start": -0.3}
    stop = {"position": -0.3, "restitution": 0.8980806063803102}
    scene = oscillator(frequency, {"amplitude": 0.3969220882508403}, body, [stop])
    with StrobeMap(scene, PARAMETER) as strobe, strobe.plane(frequency, 1) as plane:
        assert plane.low[0] < -0.35
        assert plane.high[0] == pytest.approx(-0.3, abs=1e-6)
    total = all_located(scene, frequency)
    assert total.is_complete
    assert all(int(each.name[2:].split(",")[0]) > 8 for each in total.terms)


def test_two_stops_close_together_have_orbits_with_a_rest_and_without() -> None:
    frequency = 2.9325882435075354
    upper = {"position": 0.5, "restitution": 0.28429914581017685}
    lower = {"position": 0.3177903967834059, "side": "lower", "restitution": 0.9127006153340091}
    body = {"damping_ratio": 0.05, "displacement_start": 0.4}
    total = all_located(
        oscillator(frequency, {"amplitude": 1.1169030773671305}, body, [upper, lower]), frequency
    )
    assert {(each.name, each.index) for each in total.terms} == {
        ("P(2,1)", 1),
        ("P(2,1)", -1),
        ("P(inf,1)", 1),
    }


@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_a_body_at_rest_on_its_stop_is_one_fixed_point_on_the_edge_of_the_plane(restitution: float) -> None:
    stop = {"position": -0.5, "restitution": restitution}
    scene = oscillator(0.5, {"amplitude": 0.3}, {"damping_ratio": 0.3, "displacement_start": -0.5}, [stop])
    with StrobeMap(scene, PARAMETER) as strobe:
        rests = strobe.rests(0.5, 1)
        assert [each.tolist() for each in rests] == [[[-0.5, 0.0]]]
        known = strobe.located(0.5, 1, [], rests)
        assert (known.orbits, known.terms, known.undecided) == ([], [], 0)
    assert str(all_located(scene, 0.5)) == "P(inf,1) +1, sum 1"


def test_impacts_that_nearly_repeat_lead_to_their_orbit() -> None:
    with StrobeMap(two_sided(0.972), PARAMETER) as strobe:
        body = strobe.body(0.972)
        saddle = next(each for each in strobe.orbits(0.972, 1) if each.name == "P(2,1)")
    turns = TURN * np.repeat(np.arange(3), 2)
    off = 1e-3 * np.array([0.0, 1.0, -2.0, 1.0, 0.0, -1.0])
    found = list(
        orbits_passed(
            body, np.tile(saddle.phases, 3) + turns + off, np.ones(6), np.tile(saddle.contacts, 3), 1
        )
    )
    assert found
    assert all(same_orbit(each, saddle) for each in found)
    one = np.zeros(1, dtype=np.int64)
    assert not list(orbits_passed(body, np.array([0.3]), np.ones(1), one, 1))


def test_a_chaotic_run_passes_orbits_that_the_index_sum_needs() -> None:
    scene = two_sided(0.95)
    with StrobeMap(scene, PARAMETER) as strobe:
        found = distinct(strobe.passed(0.95, 1, ()), 1)
    assert found
    assert all(each.periods == 1 and each.is_physical for each in found)


def test_the_motion_without_impacts_of_a_body_with_critical_damping_is_decided() -> None:
    stop = {"position": 1.0, "restitution": 0.7}
    scene = oscillator(3.0, {"amplitude": 1.3}, {"damping_ratio": 1.0}, [stop])
    assert str(all_located(scene, 3.0)) == "no impacts +1, sum 1"

"""Index sums of followed branches, the orbits that they find missing, and orbits that rest on a stop."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from soak import index_sums as soak

import vibroimpact as vi
from vibroimpact.analysis.dataset.schema import OrbitClass
from vibroimpact.analysis.orbits.classify import RunClass
from vibroimpact.analysis.orbits.following import FollowSettings
from vibroimpact.analysis.orbits.index_sum import IndexSum, IndexTerm
from vibroimpact.analysis.study import whole
from vibroimpact.orchestrator.orbits.branches import Followed
from vibroimpact.orchestrator.orbits.ends_of_runs import RunEnd
from vibroimpact.orchestrator.orbits.follow import Following
from vibroimpact.orchestrator.orbits.self_check.index_check import IndexCheck, between_special_points
from vibroimpact.orchestrator.orbits.self_check.strobe_map import Located, StrobeMap
from vibroimpact.orchestrator.scene import Scene

PARAMETER = "forcing.angular_frequency"


def two_sided(**forcing: float) -> dict[str, Any]:
    """Return an oscillator between two equal stops, whose P(2,1) loses its symmetry at .972824295."""
    stop = {"position": 1.0, "restitution": 0.7}
    return {
        "scene": {"units": "nondimensional"},
        "body": {"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.04},
        "forcing": {"amplitude": 0.5, "angular_frequency": 1.1, **forcing},
        "stop": [stop, {**stop, "side": "lower", "position": -1.0}],
        "record": {"recorded_periods": 8},
    }


@pytest.fixture(scope="module")
def followed() -> Followed:
    study = Following(Scene.from_dict(two_sided()), PARAMETER, 0.965, 0.985, step=0.1, doublings=0)
    return whole(study).followed


def sum_at(followed: Followed, value: float) -> IndexSum:
    assert followed.check is not None
    return next(each.sums[0] for each in followed.check.values if each.between[0] < value < each.between[1])


@pytest.mark.parametrize(
    ("value", "signs"),
    [
        (0.972, {("P(2,1)", -1): 1, ("P(1,1)", 1): 2}),
        (0.973, {("P(2,1)", 1): 1, ("P(2,1)", -1): 2, ("P(1,1)", 1): 2}),
        (0.976, {("P(2,1)", 1): 1}),
    ],
)
def test_the_pitchfork_between_two_equal_stops_keeps_the_sum_at_1(
    followed: Followed, value: float, signs: dict[tuple[str, int], int]
) -> None:
    total, counts = sum_at(followed, value), {}
    for term in total.terms:
        counts[term.name, term.index] = counts.get((term.name, term.index), 0) + term.points
    assert counts == signs
    assert total.is_complete


def test_an_orbit_without_a_neighbour_is_found_because_a_sum_is_not_1() -> None:
    # the unstable P(2,1) that begins where the steady motion reaches both stops
    scene = Scene.from_dict(two_sided())
    followed = whole(Following(scene, PARAMETER, 1.18, 1.26, step=0.1, doublings=0, grazes=0)).followed
    assert followed.check is not None
    assert (followed.check.searched, followed.check.found) == (1, 1)
    assert all(each.is_complete for each in followed.check.values)
    *_, born = followed.branches
    assert (born.name, born.is_symmetric) == ("P(2,1)", True)
    assert born.values.min() == pytest.approx(1.2208066516, abs=1e-9)
    assert "1 further orbit found" in followed.attributes["index_sums"]
    assert "missing_orbits" not in followed.attributes


def test_a_missing_branch_makes_another_sum_which_the_lines_say(
    followed: Followed, monkeypatch: pytest.MonkeyPatch
) -> None:
    left = [branch for branch in followed.branches if branch.name != "P(2,1)"]
    check = IndexCheck(Scene.from_dict(two_sided()), PARAMETER, FollowSettings(0.965, 0.985), 16)
    monkeypatch.setattr(IndexCheck, "_search", lambda *_: iter(()))
    assert not list(check.missing(left))
    assert [each.sums[0].total for each in check.values] == [2, 0]
    said = "\n".join(check.lines)
    assert "Orbits are missing from 0.965 to 0.97375272: P(1,1) +2, sum 2 over 1 and 2 periods." in said


def test_fixed_points_that_no_branch_holds_are_counted_and_said(
    followed: Followed, monkeypatch: pytest.MonkeyPatch
) -> None:
    left = [branch for branch in followed.branches if branch.name != "P(2,1)"]

    def located(*_: object) -> Located:
        return Located(terms=[IndexTerm("P(70,1)", -1, 1)])

    monkeypatch.setattr(StrobeMap, "orbits", lambda *_: iter(()))
    monkeypatch.setattr(StrobeMap, "located", located)
    check = IndexCheck(Scene.from_dict(two_sided()), PARAMETER, FollowSettings(0.965, 0.97), 16)
    assert not list(check.missing(left))
    said = "\n".join(check.lines)
    assert "Indices from 0.965 to 0.97: P(1,1) +2, P(70,1) -1, sum 1" in said
    assert "Counted, not followed: P(70,1), which the strobe map itself locates." in said


def test_a_fixed_point_that_no_run_shows_is_said(followed: Followed, monkeypatch: pytest.MonkeyPatch) -> None:
    left = [branch for branch in followed.branches if branch.name != "P(2,1)"]
    monkeypatch.setattr(StrobeMap, "orbits", lambda *_: iter(()))
    monkeypatch.setattr(StrobeMap, "located", lambda *_: Located(undecided=1))
    check = IndexCheck(Scene.from_dict(two_sided()), PARAMETER, FollowSettings(0.965, 0.97), 16)
    assert not list(check.missing(left))
    said = "\n".join(check.lines)
    assert "Orbits are missing from 0.965 to 0.97: P(1,1) +2, sum 2" in said
    assert "1 further fixed point that no run with at most 2000 impacts a period shows" in said


def test_the_nearest_runs_over_the_range_that_end_on_no_orbit_start_further_runs() -> None:
    kind = RunClass(OrbitClass.sticking, 1)
    ends = [RunEnd(value, kind, None, (value,)) for value in (1.0, 1.1, 1.2, 1.3, 1.4, 1.5)]
    check = IndexCheck(Scene.from_dict(two_sided()), PARAMETER, FollowSettings(1.0, 1.5), 16, ends)
    assert sorted(each[0] for each in check._starts_near(1.16)) == [1.0, 1.1, 1.2, 1.3]


def test_ranges_lie_between_special_points_of_all_branches(followed: Followed) -> None:
    ranges = between_special_points(followed.branches, FollowSettings(0.965, 0.985))
    assert ranges[0][0] == 0.965
    assert ranges[-1][1] == 0.985
    assert all(np.diff(each)[0] > 0.0 for each in ranges)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"body.damping_ratio": 0.0}, "a mode without damping"),
        ({"stop[1].motion_amplitude": 0.1, "stop[1].motion_angular_frequency": 1.1}, "a stop that moves"),
    ],
)
def test_bodies_whose_sum_need_not_be_1_are_named(changes: dict[str, float], said: str) -> None:
    check = IndexCheck(
        Scene.from_dict(two_sided()).with_values(changes), PARAMETER, FollowSettings(1.0, 1.2), 16
    )
    assert not list(check.missing([]))
    assert said in check.lines[0]


def test_a_chain_that_can_meet_two_stops_at_once_is_named() -> None:
    chain = {"kind": "chain", "masses": [1.0, 1.0], "stiffnesses": [1.0, 1.0], "dampings": 0.1}
    stops = [{"position": 0.5, "mass": mass, "restitution": 0.7} for mass in (1, 2)]
    scene = two_sided() | {"body": chain, "stop": stops}
    scene["forcing"] = {"amplitude": [0.5, 0.0], "angular_frequency": 1.0}
    check = IndexCheck(Scene.from_dict(scene), PARAMETER, FollowSettings(1.0, 1.2), 16)
    assert not list(check.missing([]))
    assert "two can be met at once" in check.lines[0]


def test_an_orbit_that_rests_on_both_stops_counts_once() -> None:
    scene = Scene.from_dict(two_sided(amplitude=2.0, angular_frequency=0.2))
    with StrobeMap(scene, PARAMETER) as strobe:
        assert [len(each) for each in strobe.rests(0.2, 1)] == [1]
        assert [len(each) for each in strobe.rests(0.2, 2)] == [1]
        assert strobe.rests(1.1, 1) == []


def test_a_body_that_is_always_pressed_on_its_stop_rests() -> None:
    scene = two_sided() | {"stop": [{"position": -1.0, "restitution": 0.7}]}
    scene["body"] = scene["body"] | {"displacement_start": -1.0}
    with StrobeMap(Scene.from_dict(scene), PARAMETER) as strobe:
        assert [len(each) for each in strobe.rests(1.1, 1)] == [1]


@pytest.mark.parametrize("seed", [1, 4])
def test_the_fixed_points_of_random_oscillators_add_up_to_1(seed: int) -> None:
    assert soak.check(seed) is None


def test_runs_seed_branches_and_what_is_not_followed_is_said() -> None:
    found = vi.follow(two_sided(), PARAMETER, 0.9, 0.95, step=0.2, doublings=0, grazes=0)
    lines = found.attrs["first_orbits"].splitlines()
    assert lines[0].startswith("50 runs over the range, up and down, end on ")
    assert "chaos" in lines[1]
    assert set(np.unique(found.vibroimpact.runs["orbit_index"].values)) <= {-1, 0, 1}

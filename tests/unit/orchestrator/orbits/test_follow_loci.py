"""Grazes between impacts followed over two numbers of a scene, and the points of codimension 2 on their curves."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.command_line import in_this_process
from support.places import ROOT

import vibroimpact as vi
from vibroimpact.analysis.dataset.schema import SpecialOrbit
from vibroimpact.analysis.orbits.following import FollowSettings
from vibroimpact.analysis.study import whole
from vibroimpact.orchestrator.orbits.follow import Following
from vibroimpact.orchestrator.orbits.loci import FollowedLoci, follow_loci

CHAIN = ROOT / "examples" / "thesis" / "figure_6_13.toml"
PARAMETER = "forcing.angular_frequency"
POSITION = "stop[1].position"


def test_grazes_between_impacts_over_two_numbers_are_those_of_single_followings() -> None:
    loci = vi.follow(
        CHAIN,
        PARAMETER,
        0.8,
        0.9,
        doublings=0,
        impacts=1,
        grazes=0,
        second=POSITION,
        second_range=(0.03, 0.2),
        step=0.05,
    ).vibroimpact.runs
    assert set(loci["orbit_special"].values) == {SpecialOrbit.graze_between_impacts}
    for place in (1, loci.sizes["run"] // 2, loci.sizes["run"] - 2):
        position, frequency = float(loci["position"][place]), float(loci["angular_frequency"][place])
        scene = vi.Scene.from_file(CHAIN).with_values({POSITION: position})
        alone = vi.follow(
            scene, PARAMETER, frequency - 0.02, frequency + 0.05, doublings=0, impacts=1, grazes=0, step=0.1
        )
        runs = alone.vibroimpact.runs
        found = runs["angular_frequency"].values[
            runs["orbit_special"].values == SpecialOrbit.graze_between_impacts
        ]
        assert np.abs(found - frequency).min() < 1e-9


def curves_of_grazes_between_impacts(scene: vi.Scene, impacts: int) -> FollowedLoci:
    branches = whole(
        Following(scene, PARAMETER, 0.4, 0.52, impacts=impacts, doublings=0, grazes=0, step=0.05, starts=64)
    ).followed
    for branch in branches.branches:
        branch.points = [point for point in branch.points if point.kind == "graze between impacts"][:1]
    ranges = FollowSettings(0.4, 0.52, 0.03), FollowSettings(0.09, 0.6, 0.03)
    loci = FollowedLoci(branches, POSITION)
    assert list(follow_loci(loci, *ranges))
    return loci


def test_two_maxima_that_touch_are_the_orbit_of_one_more_impact_that_has_no_speed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("vibroimpact.orchestrator.orbits.first_orbits.SEEDS", 2)
    scene = vi.Scene.from_file(CHAIN).with_values({PARAMETER: 0.47})
    one = curves_of_grazes_between_impacts(scene.with_values({POSITION: 0.4}), 1)
    two = curves_of_grazes_between_impacts(scene, 2)
    corners = [point.values for locus in one.loci for kind, point in locus.special if kind == "another"]
    (slow,) = [point.values for kind, point in two.loci[0].special if kind == "graze"]
    assert min(np.abs(np.subtract(each, slow)).max() for each in corners) < 1e-10
    assert slow == pytest.approx((0.47955763624, 0.31956742827), abs=1e-10)
    _the_other_maximum_touches_where_the_slow_impact_grazes(one, two)
    _tori_have_multipliers_on_the_unit_circle(two)


def _the_other_maximum_touches_where_the_slow_impact_grazes(one: FollowedLoci, two: FollowedLoci) -> None:
    assert [locus.kind for locus in one.loci] == ["graze between impacts"] * 2
    grazes = [locus for locus in two.loci if locus.kind == "graze"]
    ends = [[each.points[place].values for place in (0, -1)] for each in (one.loci[1], *grazes)]
    ahead = [max(each) for each in ends]
    assert ahead[0][0] == pytest.approx(0.52, abs=1e-12)
    assert ahead[1] == pytest.approx(ahead[0], abs=1e-11)


def _tori_have_multipliers_on_the_unit_circle(two: FollowedLoci) -> None:
    """Both multipliers are 1 where the curve leaves that of the folds, and complex beyond."""
    (tori,) = [locus for locus in two.loci if locus.kind == "torus"]
    folds = [locus for locus in two.loci if locus.kind == "fold"]
    met = [point.values for locus in folds for kind, point in locus.special if kind == "torus"]
    assert min(np.abs(np.subtract(each.values, met[0])).max() for each in tori.points) < 1e-8
    for point in tori.points[1:-1]:
        turning = point.orbit.multipliers[point.orbit.multipliers.imag > 0.0]
        assert np.abs(np.abs(turning) - 1.0).min() < 1e-8


@pytest.mark.parametrize("longest", [0.01, 0.2])
def test_a_branch_is_followed_once_however_far_its_orbits_lie_apart(longest: float) -> None:
    scene = vi.Scene.from_file(CHAIN).with_values({POSITION: 0.0372})
    found = whole(
        Following(scene, PARAMETER, 1.6, 2.2, step=longest, doublings=0, impacts=1, grazes=0)
    ).followed
    assert [branch.name for branch in found.branches] == ["P(1,1)"]


@pytest.mark.long
def test_a_doubling_whose_orbit_touches_a_stop_between_impacts_is_on_the_curve_of_these_grazes() -> None:
    scene = vi.Scene.from_file(CHAIN).with_values({POSITION: 0.0372, PARAMETER: 1.75})
    branches = whole(Following(scene, PARAMETER, 1.6, 2.2, step=0.05, grazes=0)).followed
    for branch in branches.branches:
        branch.points = branch.points[-2:] if branch.name == "P(2,2)" else []
    ranges = FollowSettings(1.6, 2.2, 0.01), FollowSettings(0.03, 0.05, 0.01)
    loci = FollowedLoci(branches, POSITION)
    assert list(follow_loci(loci, *ranges))
    (met,) = [
        point.values
        for locus in loci.loci
        for kind, point in locus.special
        if kind == "graze between impacts"
    ]
    assert met == pytest.approx((1.7725763745, 0.037100299463), abs=1e-9)
    alone = whole(
        Following(scene.with_values({POSITION: met[1]}), PARAMETER, 1.6, 2.2, step=0.05, grazes=0)
    ).followed
    last = [point for point in alone.branches[1].points if point.kind == "graze between impacts"]
    assert last[0].at.value == pytest.approx(met[0], abs=1e-9)


def test_the_file_says_where_its_branches_are(tmp_path: Path) -> None:
    output = tmp_path / "loci.nc"
    span = ["--parameter", PARAMETER, "--from", "0.84", "--to", "0.9", "--step", "0.1", "--doublings", "0"]
    second = ["--second", POSITION, "--second-from", "0.1", "--second-to", "0.15"]
    done = in_this_process("follow", CHAIN, *span, *second, "--impacts", "1", "-o", output)
    assert (done.returncode, done.stderr) == (0, "")
    assert f"{output} has the curves over both numbers; branches are written without --second." in done.stdout
    with vi.open_dataset(output) as found:
        assert found["position"].values.min() == pytest.approx(0.1, abs=1e-12)


def test_without_a_bifurcation_branches_are_what_there_is() -> None:
    found = vi.follow(
        CHAIN,
        PARAMETER,
        0.9,
        1.0,
        doublings=0,
        impacts=1,
        grazes=0,
        step=0.1,
        second=POSITION,
        second_range=(0.1, 0.15),
    )
    assert set(found["orbit_special"].values) == {SpecialOrbit.none}

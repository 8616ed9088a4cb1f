"""Special points of known systems under `follow`: losses of symmetry, doublings in cascade, and a graze."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support.command_line import in_this_process as ran

import vibroimpact as vi
from vibroimpact.analysis.dataset.schema import SpecialOrbit

PARAMETER = "forcing.angular_frequency"


def in_this_process(arguments: list[str]) -> tuple[int, str, str]:
    done = ran(*arguments)
    return done.returncode, done.stdout, done.stderr


SYMMETRIC = """
[body]
mass = 1.0
stiffness = 1.0
damping_ratio = 0.04
[forcing]
amplitude = 0.5
angular_frequency = 0.98
[[stop]]
position = 1.0
restitution = 0.7
[[stop]]
side = "lower"
position = -1.0
restitution = 0.7
[record]
recorded_periods = 8
"""


def test_a_loss_of_symmetry_is_a_branch_point_at_which_both_broken_branches_begin(tmp_path: Path) -> None:
    path, output, figure = tmp_path / "two.toml", tmp_path / "b.nc", tmp_path / "b.png"
    path.write_text(SYMMETRIC, encoding="utf-8")
    span = ["--parameter", PARAMETER, "--from", "0.96", "--to", "1", "--step", "0.05", "--doublings", "0"]
    code, out, err = in_this_process(["follow", str(path), *span, "-o", str(output), "--figure", str(figure)])
    assert (code, err) == (0, "")
    for said in (
        "1  P(1,1) at stop 1: its graze between impacts at 0.97375271868 meets P(2,1)",
        "its mirror image is branch 4, P(1,1) at stop 2",
        "symmetric; begun from P(2,1), 1 at stop 1, 1 at stop 2 at 0.97",
        "its mirror image is branch 5, P(2,1), 1 at stop 1, 1 at stop 2; begun from P(1,1) at stop 1 at its graze",
        "ends: graze of P(1,1), branch point of the symmetric P(2,1).",
        "Indices from 0.96 to 0.9728243: P(1,1) +2, P(2,1) -1, sum 1 over 1 and 2 periods.",
        "0.97375272: P(1,1) +2, P(2,1) +1, P(2,1) -2, sum 1 over 1 and 2 periods.",
        "to 1: P(2,1) +1, sum 1 over 1 and 2 periods.",
    ):
        assert said in out
    assert "no cause was found" not in out
    assert re.search(r"2  P\(2,1\), 1 at stop 1, 1 at stop 2 +pitchfork +0\.97282429546 ", out)
    with vi.open_dataset(output) as written:
        runs = written.vibroimpact.runs
        branch, value = runs["orbit_branch"].values, runs["angular_frequency"].values
        here = runs["orbit_special"].values == SpecialOrbit.branch_point
        np.testing.assert_allclose(value[here], 0.972824295465, atol=1e-11)
        assert (runs["orbit_symmetric"].values[here] == 1).all()
        for number in (3, 5):
            broken = branch == number
            assert not runs["orbit_stable"].values[broken & ~here].any()
            assert runs["orbit_symmetric"].values[broken & ~here].any() == 0
            assert value[broken].max() == pytest.approx(0.97375271868, abs=1e-10)
        one, other = (runs.isel(run=branch == number) for number in (3, 5))
        # half a period later the mirror image is -x
        assert one["displacement_max"].values == pytest.approx(-other["displacement_min"].values, abs=1e-9)
        assert one["orbit_multiplier_real"].values[1:] == pytest.approx(
            other["orbit_multiplier_real"].values[1:], rel=1e-6
        )


def test_a_motion_that_touches_both_stops_meets_orbits_at_one_stop_and_at_both(tmp_path: Path) -> None:
    path = tmp_path / "two.toml"
    path.write_text(SYMMETRIC, encoding="utf-8")
    span = [
        "--parameter",
        PARAMETER,
        "--from",
        "0.708",
        "--to",
        "0.711",
        "--impacts",
        "1",
        "--doublings",
        "0",
    ]
    code, out, err = in_this_process(["follow", str(path), *span, "--step", "0.1"])
    assert (code, err) == (0, "")
    higher = "P(2,1), 1 at stop 1, 1 at stop 2, P(3,2), 2 at stop 1, 1 at stop 2 (unstable at higher values)"
    lower = "P(1,2) at stop 1, P(2,2), 1 at stop 1, 1 at stop 2 (unstable at lower values)"
    meets = "its graze at 0.70938784829 meets motion without impacts"
    assert f"1  P(1,1) at stop 1: {meets}; {higher}; {lower}." in out


def test_equal_orbits_at_two_stops_are_told_apart_as_mirror_images() -> None:
    scene = vi.Scene.from_text(SYMMETRIC)
    found = vi.follow(scene, PARAMETER, 0.965, 0.973, impacts=1, step=0.1, doublings=0)
    runs = found.vibroimpact.runs
    assert set(runs["orbit_branch"].values) == {1, 2}
    branch_of_impact = runs["orbit_branch"].values[found["impact_run"].values]
    np.testing.assert_array_equal(found["impact_contact"].values, branch_of_impact)


def special_values(found: xr.Dataset, kind: SpecialOrbit, name: str) -> list[float]:
    runs = found.vibroimpact.runs
    return [float(each) for each in runs[name].values[runs["orbit_special"].values == kind]]


def test_doublings_are_followed_one_after_the_other() -> None:
    # Thompson and Ghaffari's cascade: no damping, restitution .8, the stop at the place of rest
    scene = {
        "scene": {"units": "nondimensional"},
        "body": {"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.0},
        "forcing": {"amplitude": 1.0, "angular_frequency": 2.65},
        "stop": [{"position": 0.0, "restitution": 0.8}],
        "record": {"recorded_periods": 1},
    }
    found = vi.follow(scene, PARAMETER, 2.64, 2.7316, impacts=1, doublings=3, grazes=0, step=0.1)
    assert special_values(found, SpecialOrbit.period_doubling, "angular_frequency") == pytest.approx(
        [2.65334773, 2.71598725, 2.72911792, 2.73136382], abs=5e-9
    )
    periods = found.vibroimpact.runs["orbit_periods"].values
    assert sorted(set(periods)) == [1, 2, 4, 8]


def test_a_branch_over_the_amplitude_turns_just_before_its_graze() -> None:
    # example 15.2 of COCO: the graze is where the steady motion reaches the stop, at the amplitude .1
    scene = {
        "scene": {"units": "nondimensional"},
        "body": {"mass": 1.0, "stiffness": 1.0, "damping": 0.1},
        "forcing": {"amplitude": 0.15, "angular_frequency": 1.0},
        "stop": [{"position": 1.0, "restitution": 0.8}],
        "record": {"recorded_periods": 1},
    }
    found = vi.follow(scene, "forcing.amplitude", 0.09, 0.2, grazes=0, step=0.2)
    assert special_values(found, SpecialOrbit.fold, "amplitude") == pytest.approx([0.09997075], abs=5e-9)
    assert special_values(found, SpecialOrbit.graze, "amplitude") == pytest.approx([0.1], abs=1e-12)

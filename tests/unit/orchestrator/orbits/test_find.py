"""Refusals of `vibroimpact orbit`, and the orbits that it finds from counts, seeds and runs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.command_line import in_this_process
from support.places import ROOT

import vibroimpact as vi
from vibroimpact.analysis.orbits import OrbitError
from vibroimpact.fmus.errors import DatasetError

SCENE = ROOT / "examples" / "bifurcation.toml"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--impacts", "0"], "orbit: expected 1 to 64 impacts in 1 or more periods, got 0 in 1."),
        (["--periods", "0"], "orbit: expected 1 to 64 impacts in 1 or more periods, got 1 in 0."),
        (["--impacts", "65"], "orbit: expected 1 to 64 impacts in 1 or more periods, got 65 in 1."),
        (["--impacts", "-1", "--periods", "2"], "got -1 in 2."),
        (
            ["--seed", "2.6,x"],
            "--seed: expected phases in rad, each with :STOP where it is not 1, got '2.6,x'.",
        ),
        (["--seed", ""], "--seed: expected phases in rad"),
        (["--seed", "nan"], "phases: expected ascending ones within 1 turns"),
        (["--seed", "2.6:3"], "seed: expected stops 1 to 1, got 3."),
        (["--seed", "2.6:0"], "seed: expected stops 1 to 1, got 0."),
        (["--seed", "0.9,7.2", "--impacts", "3"], "seed: expected 3 impacts"),
        (["--seed", "1e308"], "seed: expected phases up to 1e+06 rad, got 1e+308."),
        (["--seed", "3,2"], "phases: expected ascending ones within 1 turns"),
        (["-o", "orbits.png"], "orbits.png"),
    ],
)
def test_orbits_that_cannot_be_are_refused_in_one_line(options: list[str], said: str) -> None:
    done = in_this_process("orbit", SCENE, *options)
    assert done.returncode == 2
    assert said in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


AT = ["--set", "sweep={}", "--set", "forcing.angular_frequency=1.4"]
GRAZED = {"forcing.angular_frequency": 0.83, "body.damping_ratio": 0.1}


def scene(changes: dict[str, float]) -> vi.Scene:
    return vi.Scene.from_text(SCENE.read_text(encoding="utf-8")).with_sweep({}).with_values(changes)


def test_orbits_are_told_and_drawn(tmp_path: Path) -> None:
    figure = tmp_path / "o.png"
    done = in_this_process("orbit", SCENE, *AT, "--figure", figure)
    assert (done.returncode, done.stderr) == (0, "")
    for said in ("1.884298559", "0.7874223201", "2 physical orbits."):
        assert said in done.stdout
    assert figure.is_file()
    done = in_this_process("orbit", SCENE, *AT, "--impacts", "3", "--periods", "1")
    assert done.returncode == 0
    assert "No physical orbit P(3,1) near 256 trains of impacts.\n" in done.stdout
    assert "A long run of the scene ends on no impacts.\n" in done.stdout


def test_a_motion_that_is_no_orbit_on_which_a_run_ends_is_named() -> None:
    far = ["--set", "sweep={}", "--set", "stop[1].position=3.0", "--set", "forcing.angular_frequency=3.0"]
    done = in_this_process("orbit", SCENE, *far)
    assert "No physical orbit P(1,1), and none that a long run ends on.\n" in done.stdout
    assert "A long run of the scene ends on no impacts.\n" in done.stdout
    done = in_this_process("orbit", SCENE, "--set", "sweep={}", "--set", "forcing.angular_frequency=0.72")
    assert "A long run of the scene ends on chaos.\n" in done.stdout


def test_unstable_orbits_of_two_impacts_are_found_and_the_run_ends_on_the_stable_one() -> None:
    (unstable,) = vi.find_orbits(scene({"forcing.angular_frequency": 0.94}), 2, 2)
    assert not unstable.is_stable
    once, twice = vi.find_orbits(scene({"forcing.angular_frequency": 0.8}))
    assert (once.name, once.is_stable, twice.name, twice.is_stable) == ("P(1,1)", False, "P(2,2)", True)


def test_an_orbit_between_two_stops_is_that_of_a_long_run() -> None:
    (orbit,) = vi.find_orbits(ROOT / "examples" / "two_stops.toml")
    assert orbit.name == "P(2,1)"
    assert orbit.contacts.tolist() == [0, 1]
    assert orbit.determinant == pytest.approx(orbit.exact_determinant, rel=1e-12)


def test_orbits_are_the_runs_of_a_dataset_which_the_same_command_may_write_again(tmp_path: Path) -> None:
    output = tmp_path / "orbits.nc"
    for _ in range(2):
        assert in_this_process("orbit", SCENE, *AT, "-o", output).returncode == 0
    with vi.open_dataset(output) as found:
        known = vi.find_orbits(scene({"forcing.angular_frequency": 1.4}), 1)
        np.testing.assert_array_equal(found["orbit_stable"], [1, 0])
        np.testing.assert_allclose(found["impact_velocity"], [orbit.velocities[0] for orbit in known])
        assert found["orbit_branch"].values.tolist() == [1, 2]


def test_a_dataset_of_something_else_is_not_overwritten(tmp_path: Path) -> None:
    output = tmp_path / "orbits.nc"
    in_this_process("run", SCENE, "--set", "sweep={}", "-o", output)
    before = output.read_bytes()
    assert in_this_process("orbit", SCENE, *AT, "-o", output).returncode == 2
    assert output.read_bytes() == before


def test_a_penetrating_orbit_is_told_where_it_is_asked_for_and_no_file_holds_it(tmp_path: Path) -> None:
    # equations.md 9: the P(1,2) of damping ratio .1 grazes at .83586
    grazed = scene(GRAZED)
    assert vi.find_orbits(grazed, 1, 2) == []
    (orbit,) = vi.find_orbits(grazed, 1, 2, penetrating=True)
    assert not orbit.is_physical
    assert orbit.highest[0] == pytest.approx(0.0034, abs=1e-4)
    output, changes = tmp_path / "orbits.nc", [f"{key}={value}" for key, value in GRAZED.items()]
    options = [part for change in ("sweep={}", *changes) for part in ("--set", change)]
    done = in_this_process("orbit", SCENE, *options, "--periods", "2", "--penetrating", "-o", output)
    assert (done.returncode, done.stderr) == (0, "")
    assert "penetrates stop 1 by 0.00339" in done.stdout
    assert "is not written: it would hold no orbit" in done.stdout
    assert not output.exists()


def test_the_orbit_near_to_a_seed_is_found_and_counted_once() -> None:
    at = scene({"forcing.angular_frequency": 1.4})
    (unstable,) = vi.find_orbits(at, seed=[(2.6, 1)])
    assert not unstable.is_stable
    assert unstable.phases[0] == pytest.approx(2.620714454, abs=1e-9)
    (stable,) = vi.find_orbits(at, periods=2, seed=[(0.9, 1), (7.2, 1)])
    assert stable.name == "P(1,1)"
    assert stable.multipliers[0] == pytest.approx(vi.find_orbits(at, 1)[0].multipliers[0], abs=1e-9)
    with pytest.raises(OrbitError, match=r"expected an orbit P\(1,2\) near to the phases \[2.6\], got none"):
        vi.find_orbits(at, periods=2, seed=[(2.6, 1)])


def test_the_orbit_of_a_run_is_found_from_its_impacts(tmp_path: Path) -> None:
    file = tmp_path / "runs.nc"
    swept = vi.Scene.from_file(ROOT / "examples" / "two_stops.toml").with_sweep(
        {"forcing.angular_frequency": {"values": [0.9, 1.0]}}
    )
    vi.run(swept, file)
    done = in_this_process(
        "orbit", ROOT / "examples" / "two_stops.toml", "--from-dataset", file, "--run", "1"
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "1 physical orbit." in done.stdout
    near = vi.seed_of_run(file, 1)
    assert [stop for _, stop in near.impacts] == [1, 2]
    (orbit,) = vi.find_orbits(
        swept.with_sweep({}).with_values(near.values), seed=near.impacts, periods=near.periods
    )
    np.testing.assert_allclose(orbit.phases, [phase for phase, _ in near.impacts], rtol=0.0, atol=1e-12)
    done = in_this_process("orbit", SCENE, "--from-dataset", file, "--run", "1")
    assert (done.returncode, done.stderr) == (2, "seed: expected stops 1 to 1, got 2.\n")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"record.transient_periods": 0, "record.recorded_periods": 2}, "got none: not periodic"),
        ({"forcing.amplitude": 0.0}, "got none: no impacts."),
        ({"record.impacts": False}, "seed: expected recorded impacts, got no impact_time"),
    ],
)
def test_a_run_without_an_orbit_gives_no_seed(changes: dict[str, object], said: str) -> None:
    at = vi.Scene.from_file(SCENE).with_sweep({}).with_values({"forcing.angular_frequency": 1.2})
    with pytest.raises(DatasetError, match=said):
        vi.seed_of_run(vi.run(at.with_values(changes)))

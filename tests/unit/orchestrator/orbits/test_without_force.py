"""Orbits, branches, classes and exponents of scenes without a force, against runs of the engine."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.command_line import in_this_process
from support.places import ROOT

import vibroimpact as vi
from vibroimpact.analysis.orbits import PeriodicOrbit
from vibroimpact.fmus.errors import UsageError

EXAMPLE = ROOT / "examples" / "self_excited.toml"


BOX = """
[scene]
title = "A box on ice with a ball on a spring in it"
units = "nondimensional"

[[body]]
name = "box"
mass = 1.0
stiffness = 0.0
velocity_start = 0.1

[[body]]
name = "ball"
mass = 0.5
stiffness = 0.0

[[link]]
between = ["box", "ball"]
stiffness = 1.0
damping = 0.1

[[contact]]
between = ["box", "ball"]
restitution = 0.7
clearance = 0.4

[forcing]
at = "ball"
amplitude = 0.5
angular_frequency = 1.5
phase = 0.3

[record]
transient_periods = 300
recorded_periods = 20
impacts = true
"""


def example(**changes: float) -> vi.Scene:
    return vi.Scene.from_file(EXAMPLE).with_sweep({}).with_values(changes)


def runs_on(orbit: PeriodicOrbit, scene: vi.Scene) -> float:
    """Return the largest error of a period and of velocities of a long run, relative."""
    impacts = vi.run(scene).vibroimpact.impacts()
    count = orbit.phases.size
    times, speeds = impacts.impact_time.values, impacts.impact_velocity.values
    period = abs(float(times[-1] - times[-1 - count]) / orbit.period - 1.0)
    off = np.abs(np.sort(speeds[-count:]) / np.sort(orbit.velocities) - 1.0)
    return max(period, float(off.max()))


def test_a_long_run_of_the_engine_repeats_the_orbit() -> None:
    (orbit,) = vi.find_orbits(example())
    assert orbit.name == "P(2,1)"
    assert runs_on(orbit, example()) < 1e-9


def test_the_dataset_of_orbits_has_a_period_for_each() -> None:
    orbits = vi.find_orbits(example())
    assert orbits.dataset.orbit_period.values == pytest.approx([orbits[0].period])


def test_a_branch_has_the_orbits_of_both_stops_and_of_each() -> None:
    found = vi.follow(example(), "stop[2].position", -1.7, -1.3, impacts=1, step=0.2)
    runs = found.vibroimpact.runs
    kinds = {int(each) for each in np.unique(runs["orbit_special"].values)}
    assert kinds == {0, 5}
    assert set(np.unique(runs["orbit_branch"].values)) == {1, 2}
    touched = runs["position"].values[runs["orbit_special"].values > 0]
    np.testing.assert_allclose(touched, -1.5213650415, atol=1e-9)


def test_runs_without_a_force_have_classes_and_exponents_of_their_orbits() -> None:
    scene = example().with_sweep({"stop[2].position": [-1.7, -1.2]})
    runs = vi.run(scene)
    assert [each.name for each in vi.classify(runs)] == ["P(1,1)", "P(2,1)"]
    found = vi.lyapunov(runs)
    alone, both = (vi.find_orbits(example(**{"stop[2].position": at})) for at in (-1.7, -1.2))
    np.testing.assert_allclose(
        found.lyapunov_exponent.values[:, 0],
        [np.log(alone[0].multipliers[0].real), 0.5 * np.log(both[0].multipliers[0].real)],
        rtol=1e-9,
    )
    assert np.isnan(found.lyapunov_exponent.values[:, 1]).all()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (
            ["--set", "body[1].damping=0.1"],
            "forcing: expected a force, or a negative dashpot that gives energy",
        ),
        (
            ["--periods", "2"],
            "orbit: periods: expected 1 of a body without a force, whose orbits set it, got 2.",
        ),
        (["--seed", "0.5"], "seed: expected none, by --seed or --from-dataset, of a body without a force"),
    ],
)
def test_orbits_that_no_body_without_a_force_has_are_refused(options: list[str], said: str) -> None:
    done = in_this_process("orbit", EXAMPLE, "--set", "sweep={}", *options)
    assert done.returncode == 2
    assert said in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_studies_that_need_a_force_refuse_a_scene_without(tmp_path: Path) -> None:
    done = in_this_process("energies", EXAMPLE, "-o", tmp_path / "energies.nc")
    assert done.returncode == 2
    assert "forcing: expected a harmonic force, which this study needs, got none." in done.stderr


def test_a_box_on_ice_repeats_up_to_the_shift_that_its_start_gives() -> None:
    scene = vi.Scene.from_text(BOX)
    (orbit,) = vi.find_orbits(scene)
    run = vi.run(scene)
    shifts = np.diff(run.strobe_displacement.values)
    np.testing.assert_allclose(shifts, orbit.shift, rtol=1e-11)
    assert orbit.shift == pytest.approx((0.1 + 0.5 / 1.5 * np.sin(-0.3)) / 1.5 * orbit.period, rel=1e-12)
    np.testing.assert_allclose(run.vibroimpact.impacts().impact_velocity[-1], orbit.velocities[0], rtol=1e-12)
    strobe = orbit.at(np.array([2.0 * np.pi]))[1][0] + orbit.shift / orbit.period
    assert run.strobe_velocity.values[-1] == pytest.approx(strobe, abs=1e-12)
    assert [each.name for each in vi.classify(run)] == ["P(1,1)"]
    exponents = vi.lyapunov(run).lyapunov_exponent.values
    np.testing.assert_allclose(exponents, np.log(np.abs(orbit.multipliers)), rtol=1e-9)


def test_a_constant_force_on_a_box_on_ice_is_refused() -> None:
    scene = BOX.replace(
        "[forcing]", '[[forcing]]\nat = "box"\nsignal = "constant"\namplitude = 0.1\n\n[[forcing]]'
    )
    with pytest.raises(
        UsageError, match="expected no constant force on a body that nothing ties to the ground"
    ):
        vi.find_orbits(vi.Scene.from_text(scene))


def test_a_single_body_has_its_key_also_as_a_structure() -> None:
    body = {"mass": 1.0, "stiffness": 1.0, "damping": -0.1, "displacement_start": 0.1}
    stop = [{"position": 1.0, "restitution": 0.6}]
    given = {
        "scene": {"units": "nondimensional"},
        "body": body,
        "stop": stop,
        "record": {"recorded_time": 50.0},
    }
    found = vi.follow(vi.Scene.from_dict(given), "body.damping", -0.2, -0.1, impacts=1, step=0.2)
    # the impact gives back what the negative dashpot brings: one multiplier, r^2 exp(-2 zeta w T)
    decay = 0.36 * np.exp(-found.damping.values * found.orbit_period.values)
    np.testing.assert_allclose(found.orbit_multiplier_real.values, decay, rtol=1e-9)

"""Orbits found and followed from scenes: the commands, their files, and their refusals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support.command_line import in_this_process as ran
from support.places import ROOT

import vibroimpact as vi
from vibroimpact.analysis.dataset.schema import SpecialOrbit
from vibroimpact.analysis.orbits import OrbitError
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.orchestrator.hard_cases.loose import ball_in_cavity, symmetric_orbit


def in_this_process(arguments: list[str]) -> tuple[int, str, str]:
    done = ran(*arguments)
    return done.returncode, done.stdout, done.stderr


SCENE = ROOT / "examples" / "bifurcation.toml"
PARAMETER = "forcing.angular_frequency"


@pytest.fixture(scope="module")
def branches() -> object:
    return vi.follow(SCENE, PARAMETER, 0.6, 1.6, step=0.05, impacts=1, grazes=0)


def test_a_branch_of_a_ball_in_a_cavity_is_its_closed_form() -> None:
    mass, frequency, start = 0.1, 1.4, 0.28
    phase, _ = symmetric_orbit(mass, frequency, start)
    found = vi.follow(
        vi.Scene.from_dict(ball_in_cavity(mass, frequency, start)),
        "forcing.amplitude",
        start,
        0.34,
        step=0.2,
        seed=[(phase, 1), (phase + np.pi, 2)],
        doublings=0,
        grazes=0,
    )
    runs = found.vibroimpact.runs
    symmetric = runs["orbit_branch"].values == 1
    assert np.count_nonzero(symmetric) >= 8
    expected = [
        symmetric_orbit(mass, frequency, float(size))[1] for size in runs["amplitude"].values[symmetric]
    ]
    speeds = found["impact_velocity"].values.reshape(-1, 2)[symmetric]
    np.testing.assert_allclose(speeds.T, [expected] * 2, rtol=1e-12)
    assert (runs["orbit_symmetric"].values[symmetric] == 1).all()
    # the branch loses its symmetry where a multiplier passes 1, and another branch begins there
    stable, amplitude = runs["orbit_stable"].values[symmetric] > 0, runs["amplitude"].values[symmetric]
    point = amplitude[runs["orbit_special"].values[symmetric] == SpecialOrbit.branch_point]
    assert point == pytest.approx([0.3388], abs=1e-4)
    assert amplitude[stable].max() <= point[0] + 1e-9
    assert amplitude[~stable].min() >= point[0] - 1e-9


def test_branches_are_a_dataset_whose_runs_are_orbits(branches: object) -> None:
    runs = branches.vibroimpact.runs  # type: ignore[attr-defined]
    special = runs["orbit_special"].values
    values = {
        SpecialOrbit(kind).name: np.sort(runs["angular_frequency"].values[special == kind])
        for kind in (1, 2, 4)
    }
    np.testing.assert_allclose(values["fold"], [0.9363626913, 1.5166110861], atol=1e-9)
    np.testing.assert_allclose(values["period_doubling"], [0.9364931207], atol=1e-9)
    np.testing.assert_allclose(values["graze"][[0, 2]], [0.7106873691, 1.2185743569], atol=1e-9)
    assert set(np.unique(runs["orbit_branch"].values)) == {1, 2}


def test_the_sweep_of_a_campaign_lies_on_the_stable_branch(branches: object) -> None:
    scene = vi.Scene.from_text(SCENE.read_text(encoding="utf-8")).with_sweep(
        {PARAMETER: {"values": [1.0, 1.2, 1.4], "path": "up"}}
    )
    run = vi.run(scene)
    for value in (1.0, 1.2, 1.4):
        fast = vi.find_orbits(scene.with_sweep({}).with_values({PARAMETER: value}), 1)[0]
        found = run.vibroimpact.impacts(direction="up", angular_frequency=value)
        np.testing.assert_allclose(found["impact_velocity"], fast.velocities[0], rtol=1e-10)
        own = run.sel(direction="up", angular_frequency=value)
        followed = branches.vibroimpact.runs  # type: ignore[attr-defined]
        stable = (followed["orbit_stable"].values > 0) & (followed["orbit_branch"].values == 1)
        order = np.argsort(followed["angular_frequency"].values[stable])
        ranges = (followed["displacement_max"] - followed["displacement_min"]).values[stable, 0][order]
        between = np.interp(value, followed["angular_frequency"].values[stable][order], ranges)
        assert between == pytest.approx(
            float((own["displacement_max"] - own["displacement_min"]).max()), rel=2e-4
        )


def test_the_command_prints_writes_and_draws(tmp_path: Path) -> None:
    output, figure = tmp_path / "b.nc", tmp_path / "b.png"
    arguments = [
        "follow",
        str(SCENE),
        "--parameter",
        PARAMETER,
        "--from",
        "0.6",
        "--to",
        "1.6",
        "--step",
        "0.05",
        "--impacts",
        "1",
    ]
    code, out, err = in_this_process([*arguments, "-o", str(output), "--figure", str(figure)])
    assert (code, err) == (0, "")
    for said in ("0.93649312074", "1.5166110861", "0.71068736909", "1.2185743569", "P(2,2)"):
        assert said in out
    assert figure.stat().st_size > 10_000
    code, out, _ = in_this_process(["plot", str(output), "-o", str(tmp_path / "again.png")])
    assert code == 0


@pytest.fixture(scope="module")
def loci() -> xr.Dataset:
    both = {"second": "forcing.amplitude", "second_range": (0.3, 0.7)}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("vibroimpact.orchestrator.orbits.loci.SECOND_VALUES", 3)
        return vi.follow(SCENE, PARAMETER, 0.6, 1.6, step=0.05, doublings=0, impacts=1, grazes=0, **both)


def test_bifurcations_over_two_numbers_are_a_dataset_and_drawn(loci: xr.Dataset) -> None:
    assert {"angular_frequency", "amplitude"} <= set(loci.coords)
    assert set(np.unique(loci["orbit_special"].values)) == {1, 2, 4, 5}
    vi.draw(loci)


def test_curves_lie_on_the_map_of_both_numbers(loci: xr.Dataset) -> None:
    grid = {
        PARAMETER: {"start": 0.7, "stop": 1.5, "points": 5},
        "forcing.amplitude": {"values": [0.4, 0.5, 0.6]},
    }
    scene = vi.Scene.from_text(SCENE.read_text(encoding="utf-8")).with_sweep(grid)
    below = vi.run(scene.with_values({"record.transient_periods": 20}))
    figure = vi.draw(loci, over=below)
    panels = [axis for axis in figure.axes if axis.lines]
    assert len(panels) == 2
    for axis in panels:
        assert axis.get_ylabel() == "amplitude (-)"
        drawn = [line for line in axis.lines if line.get_linestyle() != "None"]  # the others mark points
        curves = np.concatenate([np.column_stack(line.get_data()) for line in drawn])
        np.testing.assert_allclose(np.sort(curves[:, 0]), np.sort(loci.vibroimpact.runs["angular_frequency"]))
        assert axis.get_xlim() == pytest.approx((0.6, 1.6))
        assert axis.get_ylim() == pytest.approx((0.35, 0.65))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--from", "1", "--to", "1"], "--from, --to: expected two different numbers, got 1 and 1."),
        (["--parameter", "body.kind"], "scene key: expected a numeric key"),
        (["--parameter", "no.such"], "scene key: expected a numeric key"),
        (["--from", "2.5", "--to", "3"], "follow: expected an orbit with impacts at one of 25 values"),
        (["--periods", "0"], "--periods: expected 1 or more, got 0."),
        (["--grazes", "-1"], "--grazes: expected 0 or more, got -1."),
        (["--step", "0"], "--step: expected 1e-4 to 0.2, got 0."),
        (
            ["--second", "forcing.amplitude"],
            "--second: expected --second, --second-from and --second-to together",
        ),
        (
            ["--parameter", "body.mass", "--from", "-1"],
            "--from, --to: body.mass: expected a number > 0, got -1.",
        ),
        (["--parameter", "stop[1].restitution", "--to", "1.5"], "expected 0 <= r <= 1, got 1.5."),
        (
            ["--second", "body.stiffness", "--second-from", "-1", "--second-to", "2"],
            "--second-from, --second-to: body.stiffness: expected a number >= 0, got -1.",
        ),
        (["--set", "stop=[]"], "stop: expected a restitution stop, got none."),
    ],
)
def test_what_cannot_be_followed_is_one_line(arguments: list[str], said: str) -> None:
    base = ["follow", str(SCENE), "--parameter", PARAMETER, "--from", "0.6", "--to", "1.6"]
    code, out, err = in_this_process([*base, *arguments])
    assert code == 2
    assert out == ""
    assert said in err
    assert err.count("\n") == 1


def test_curves_over_two_numbers_say_on_which_branch_they_begin_and_what_is_left_out(
    loci: xr.Dataset,
) -> None:
    curves = loci.attrs["curves"].splitlines()
    assert len(curves) == len(np.unique(loci.vibroimpact.runs["orbit_branch"].values))
    begun = [each.partition("begun from ")[2] for each in curves]
    assert begun[0].startswith("branch 1 at forcing.amplitude = 0.5, P(1,1), at 0.71")
    assert any(each.startswith("curve 1, where its graze is a fold, at 0.665") for each in begun)
    assert all(each.startswith(("branch 1 at forcing.amplitude = ", "curve ")) for each in begun)
    assert "were not looked for" in loci.attrs["not_looked_for"]
    assert "forcing.amplitude = 0.5, 0.3, 0.7," in loci.attrs["not_looked_for"]


def test_what_was_followed_before_ctrl_c_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from vibroimpact.analysis.orbits.following import Follower

    walk = Follower.walk

    def interrupted(self: Follower, branch: object, *more: object) -> object:
        for number, each in enumerate(walk(self, branch, *more)):  # type: ignore[arg-type]
            if number == 25:
                raise KeyboardInterrupt
            yield each

    monkeypatch.setattr(Follower, "walk", interrupted)
    output = tmp_path / "b.nc"
    code, _, err = in_this_process(
        ["follow", str(SCENE), "--parameter", PARAMETER, "--from", "0.6", "--to", "1.6", "-o", str(output)]
    )
    assert code == 130
    assert "Interrupted" in err
    assert vi.open_dataset(output).sizes["angular_frequency"] >= 25


def test_a_branch_reaches_the_bounds_of_its_number() -> None:
    """Beyond these values there is no body, so differences there are on one side."""
    scene = vi.Scene.from_text(SCENE.read_text(encoding="utf-8")).with_sweep({})
    found = vi.follow(scene, "stop[1].restitution", 0.0, 1.0, step=0.1, impacts=1)
    runs = found.vibroimpact.runs
    values = runs["restitution"].values[runs["orbit_branch"].values == 1]
    assert (values[0], values[-1]) == (0.0, 1.0)
    special = runs["restitution"].values[runs["orbit_special"].values == SpecialOrbit.period_doubling]
    assert special == pytest.approx([0.51349590817], abs=1e-10)


def test_a_branch_does_not_jump_where_a_number_changes_its_meaning() -> None:
    """A yield velocity of 0 is a constant restitution; next to 0 there is hardly any."""
    scene = vi.Scene.from_text(SCENE.read_text(encoding="utf-8")).with_sweep({})
    found = vi.follow(scene, "stop[1].yield_velocity", 0.0, 0.2, step=0.1, impacts=1)
    assert (found["orbit_special"].values != SpecialOrbit.stability_change).all()
    assert 0.0 < found["yield_velocity"].values.min() < 1e-8


def test_what_was_followed_before_an_error_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from vibroimpact.analysis.orbits.following import Follower

    def fails(self: Follower, *arguments: object) -> object:
        raise OrbitError("orbit: expected something else.")

    monkeypatch.setattr(Follower, "leave", fails)
    output = tmp_path / "b.nc"
    command = ["follow", str(SCENE), "--parameter", PARAMETER, "--from", "0.6", "--to", "1.6"]
    code, out, err = in_this_process([*command, "--impacts", "1", "-o", str(output)])
    assert code in (1, 2)
    assert err == "orbit: expected something else.\n"
    assert "0.93649312074" in out
    assert vi.open_dataset(output).sizes["angular_frequency"] > 100


def test_an_orbit_that_passes_through_its_stop_is_not_followed() -> None:
    # equations.md 9: the P(1,2) of damping ratio .1 grazes at .83586
    changes = {PARAMETER: 0.83, "body.damping_ratio": 0.1}
    scene = vi.Scene.from_file(SCENE).with_sweep({}).with_values(changes)
    (orbit,) = vi.find_orbits(scene, 1, 2, penetrating=True)
    with pytest.raises(OrbitError, match=r"got a P\(1,2\) that passes through stop 1 by 0.00339"):
        vi.follow(scene, PARAMETER, 0.8, 0.9, seed=[(float(orbit.phases[0]), 1)], periods=2)


@pytest.mark.parametrize("variable", ["displacement_max", "strobe_displacement", "impact_phase"])
def test_branches_over_a_sweep_draw_the_variable_that_is_asked_for(branches: object, variable: str) -> None:
    sweep = vi.run(vi.Scene.from_file(SCENE).with_sweep({PARAMETER: [1.0, 1.2, 1.4]}), progress=False)
    figure = vi.draw(branches, over=sweep, variable=variable)  # type: ignore[arg-type]
    (axis,) = figure.axes
    below, *lines = axis.lines
    assert below.get_label() == "simulated"
    values = sweep[variable].values.ravel()
    np.testing.assert_array_equal(
        np.sort(np.asarray(below.get_ydata())), np.sort(values[np.isfinite(values)])
    )
    drawn = np.concatenate([np.asarray(line.get_ydata(), dtype=float) for line in lines])
    assert np.isfinite(drawn).sum() > 3 * below.get_ydata().size
    with pytest.raises(DatasetError, match="expected one that orbits recorded"):
        vi.draw(branches, over=sweep, variable="nothing")  # type: ignore[arg-type]

"""Orbits found and followed from scenes: the commands, their files, and their refusals."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support.command_line import in_this_process as ran
from support.places import ROOT

import vibroimpact as vi
from vibroimpact.analysis.dataset.schema import SpecialOrbit
from vibroimpact.analysis.orbits import OrbitError
from vibroimpact.fmus.errors import DatasetError, SceneError
from vibroimpact.orchestrator.hard_cases.loose import ball_in_cavity, symmetric_orbit
from vibroimpact.orchestrator.scene.changes import with_resting_start


def in_this_process(arguments: list[str]) -> tuple[int, str, str]:
    done = ran(*arguments)
    return done.returncode, done.stdout, done.stderr


SCENE = ROOT / "examples" / "bifurcation.toml"
PARAMETER = "forcing.angular_frequency"


@pytest.fixture(scope="module")
def branches() -> object:
    return vi.follow(SCENE, PARAMETER, 0.6, 1.6, step=0.05, grazes=0)


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
        return vi.follow(SCENE, PARAMETER, 0.6, 1.6, step=0.05, doublings=0, grazes=0, **both)


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
        curves = np.concatenate([np.column_stack(line.get_data()) for line in axis.lines])
        np.testing.assert_allclose(np.sort(curves[:, 0]), np.sort(loci.vibroimpact.runs["angular_frequency"]))
        assert axis.get_xlim() == pytest.approx((0.6, 1.6))
        assert axis.get_ylim() == pytest.approx((0.35, 0.65))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--from", "1", "--to", "1"], "--from, --to: expected two different numbers, got 1 and 1."),
        (["--parameter", "body.kind"], "scene key: expected a numeric key"),
        (["--parameter", "no.such"], "scene key: expected a numeric key"),
        (["--from", "2.5", "--to", "3"], "follow: expected a physical orbit P(1,1)"),
        (["--periods", "0"], "--periods: expected 1 or more, got 0."),
        (["--grazes", "-1"], "--grazes: expected 0 or more, got -1."),
        (["--step", "0"], "--step: expected 1e-4 to 0.2, got 0."),
        (
            ["--second", "forcing.amplitude"],
            "--second: expected --second, --second-from and --second-to together",
        ),
        (["--set", "stop=[]"], "stop: expected a restitution stop, got none."),
    ],
)
def test_what_cannot_be_followed_is_one_line(arguments: list[str], said: str) -> None:
    base = ["follow", str(SCENE), "--parameter", PARAMETER, "--from", "0.6", "--to", "1.6"]
    code, out, err = in_this_process([*base, *arguments])
    assert code in (1, 2)
    assert out == ""
    assert said in err
    assert err.count("\n") == 1


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


def test_a_loss_of_symmetry_is_a_branch_point_at_which_the_broken_branch_begins(tmp_path: Path) -> None:
    path, output, figure = tmp_path / "two.toml", tmp_path / "b.nc", tmp_path / "b.png"
    path.write_text(SYMMETRIC, encoding="utf-8")
    span = ["--parameter", PARAMETER, "--from", "0.96", "--to", "1", "--step", "0.05", "--doublings", "0"]
    code, out, err = in_this_process(["follow", str(path), *span, "-o", str(output), "--figure", str(figure)])
    assert (code, err) == (0, "")
    for said in (
        "1  P(1,1) at stop 1: its graze between impacts at 0.97375271868 meets P(2,1)",
        "its mirror image is P(1,1) at stop 2",
        "ends: graze of P(1,1), branch point of the symmetric P(2,1).",
        "symmetric; begun from P(2,1), 1 at stop 1, 1 at stop 2 at its pitchfork 0.97282429546",
    ):
        assert said in out
    assert "no cause was found" not in out
    with vi.open_dataset(output) as written:
        runs = written.vibroimpact.runs
        here = runs["orbit_special"].values == SpecialOrbit.branch_point
        np.testing.assert_allclose(runs["angular_frequency"].values[here], 0.972824295465, atol=1e-11)
        assert (runs["orbit_symmetric"].values[here] == 1).all()
        broken = runs["orbit_branch"].values == 2
        assert not runs["orbit_stable"].values[broken & ~here].any()
        assert runs["orbit_symmetric"].values[broken & ~here].any() == 0
        assert runs["angular_frequency"].values[broken].max() == pytest.approx(0.97375271868, abs=1e-10)


def test_equal_orbits_at_two_stops_are_told_apart(tmp_path: Path) -> None:
    path = tmp_path / "two.toml"
    path.write_text(SYMMETRIC, encoding="utf-8")
    span = ["--parameter", PARAMETER, "--from", "0.965", "--to", "0.973", "--step", "0.1", "--doublings", "0"]
    code, out, _ = in_this_process(["follow", str(path), *span, "--set", "forcing.angular_frequency=0.97"])
    assert code == 0
    assert "P(1,1) at stop 1" in out
    assert "P(1,1) at stop 2" in out


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


def test_orbits_are_told_and_drawn(tmp_path: Path) -> None:
    figure = tmp_path / "o.png"
    arguments = [
        "orbit",
        str(SCENE),
        "--set",
        "sweep={}",
        "--set",
        f"{PARAMETER}=1.4",
        "--figure",
        str(figure),
    ]
    code, out, err = in_this_process(arguments)
    assert (code, err) == (0, "")
    assert "1.884298559" in out
    assert "0.7874223201" in out
    assert "2 physical orbits." in out
    assert figure.is_file()
    code, out, _ = in_this_process([*arguments[:-2], "--impacts", "3", "--periods", "1"])
    assert (code, "No physical orbit P(3,1)." in out) == (0, True)


def test_unstable_orbits_of_two_impacts_are_found_and_the_run_ends_on_the_stable_one() -> None:
    scene = vi.Scene.from_text(SCENE.read_text(encoding="utf-8")).with_sweep({})
    (unstable,) = vi.find_orbits(scene.with_values({PARAMETER: 0.94}), 2, 2)
    assert not unstable.is_stable
    once, twice = vi.find_orbits(scene.with_values({PARAMETER: 0.8}))
    assert (once.name, once.is_stable, twice.name, twice.is_stable) == ("P(1,1)", False, "P(2,2)", True)


def test_an_orbit_between_two_stops_is_that_of_a_long_run() -> None:
    (orbit,) = vi.find_orbits(ROOT / "examples" / "two_stops.toml")
    assert orbit.name == "P(2,1)"
    assert orbit.contacts.tolist() == [0, 1]
    assert orbit.determinant == pytest.approx(orbit.exact_determinant, rel=1e-12)


def test_a_branch_ends_where_the_scene_allows_no_further() -> None:
    span = ["--parameter", "stop[1].restitution", "--from", "0.5", "--to", "1.5"]
    code, out, _ = in_this_process(
        ["follow", str(SCENE), "--set", "sweep={}", "--set", f"{PARAMETER}=1.2", *span]
    )
    assert code == 0
    assert "cannot be followed beyond 0.99999" in out


def test_what_was_followed_before_an_error_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from vibroimpact.analysis.orbits.following import Follower

    def fails(self: Follower, *arguments: object) -> object:
        raise OrbitError("orbit: expected something else.")

    monkeypatch.setattr(Follower, "leave", fails)
    output = tmp_path / "b.nc"
    code, out, err = in_this_process(
        ["follow", str(SCENE), "--parameter", PARAMETER, "--from", "0.6", "--to", "1.6", "-o", str(output)]
    )
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


def swept_scene(**forcing: float) -> dict[str, object]:
    """Return a two-sided oscillator whose frequency comes only from its sweep."""
    stop = {"position": 1.0, "restitution": 0.7}
    return {
        "scene": {"units": "nondimensional"},
        "body": {"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.04},
        "forcing": {"amplitude": 0.5, **forcing},
        "stop": [stop, {**stop, "side": "lower", "position": -1.0}],
        "record": {"recorded_periods": 8},
        "sweep": {PARAMETER: {"start": 0.95, "stop": 1.3, "points": 4}},
    }


def test_a_key_that_the_scene_leaves_to_its_sweep_is_followed() -> None:
    left, given = swept_scene(), swept_scene(angular_frequency=1.1)
    found = [vi.follow(scene, PARAMETER, 0.95, 1.0, step=0.2, doublings=0) for scene in (left, given)]
    np.testing.assert_array_equal(*(each.impact_velocity.values for each in found))
    assert "sweep" not in vi.Scene.from_text(found[0].attrs["scene"]).to_toml()


def test_another_key_that_is_left_to_the_sweep_is_asked_for_with_what_to_write(tmp_path: Path) -> None:
    file = tmp_path / "swept.toml"
    file.write_text(vi.Scene.from_dict(swept_scene()).to_toml(), encoding="utf-8")
    for command in (
        ["follow", str(file), "--parameter", "forcing.amplitude", "--from", "0.3", "--to", "0.5"],
        ["orbit", str(file)],
        ["maps", str(file)],
    ):
        code, _, err = in_this_process(command)
        assert code == 2
        assert err == (
            f"{file}: {PARAMETER}: expected a value beside those of the sweep, which is left out here, got none. "
            f"Add it to the scene, or give it: --set 'sweep={{}}' --set '{PARAMETER}=0.95'.\n"
        )


def test_orbits_of_a_stop_that_keeps_the_body_from_0_need_no_start(tmp_path: Path) -> None:
    scene = swept_scene(angular_frequency=2.2) | {"stop": [{"position": -0.1, "restitution": 0.7}]}
    scene.pop("sweep")
    written = scene | {"body": scene["body"] | {"displacement_start": -5.0}}  # type: ignore[operator]
    for found, expected in zip(vi.find_orbits(scene, 1), vi.find_orbits(written, 1), strict=True):
        np.testing.assert_array_equal(found.phases, expected.phases)
    branch = vi.follow(scene, PARAMETER, 2.1, 2.3, step=0.2, doublings=0)
    assert vi.Scene.from_text(branch.attrs["scene"]).value("body.displacement_start") == -0.1
    with pytest.raises(SceneError, match="a start on the free side of stop"):
        vi.run(scene)
    file = tmp_path / "below.toml"
    file.write_text(branch.attrs["scene"].replace("displacement_start = -0.1", ""), encoding="utf-8")
    assert in_this_process(["orbit", str(file), "--impacts", "1"])[0] == 0


def test_a_chain_whose_stops_exclude_0_is_searched_from_its_stops() -> None:
    chain = {"kind": "chain", "masses": [1.0, 1.0], "stiffnesses": [1.0, 1.0], "dampings": 0.1}
    document = {"body": chain, "stop": [{"position": -0.2}, {"position": 0.3, "side": "lower", "mass": 1}]}
    assert with_resting_start(document)["body"]["displacement_start"] == [0.3, -0.2]
    swept = {"stop[1].position": {"values": [-0.4, 0.1]}}
    assert with_resting_start(document | {"sweep": swept})["body"]["displacement_start"] == [0.3, -0.4]
    assert with_resting_start({"body": chain, "stop": [{"position": 0.0}]})["body"] == chain


@pytest.mark.parametrize(
    "document",
    [
        {},
        {"body": 3},
        {"body": {}, "stop": 7},
        {"body": {}, "stop": [{"position": "a"}, 4]},
        {"body": {"kind": []}},
    ],
)
def test_a_scene_of_any_content_is_left_to_its_rules(document: dict[str, object]) -> None:
    assert with_resting_start(document) == document


def test_without_an_orbit_of_one_impact_the_number_of_impacts_is_named() -> None:
    scene = swept_scene(angular_frequency=1.1)
    scene |= {"stop": [{**stop, "position": 0.5 * stop["position"]} for stop in scene["stop"]]}  # type: ignore[attr-defined]
    with pytest.raises(
        OrbitError,
        match=r"got none\. Try impacts=2, periods=1: runs at \d+ of these values end on P\(2,1\)\.",
    ):
        vi.follow(scene, PARAMETER, 1.0, 2.0)


def test_what_runs_end_on_and_no_branch_holds_is_said(tmp_path: Path) -> None:
    file = tmp_path / "two_stops.toml"
    file.write_text(vi.Scene.from_dict(swept_scene()).to_toml(), encoding="utf-8")
    command = [
        "follow",
        str(file),
        "--parameter",
        PARAMETER,
        "--from",
        "0.9",
        "--to",
        "1.3",
        "--step",
        "0.05",
        "--grazes",
        "0",
    ]
    code, out, err = in_this_process(command)
    assert code == 0, err
    said = [line for line in out.splitlines() if "not followed here" in line]
    assert re.fullmatch(
        r"Runs at \d+ of 25 values of the range end on P\(2,1\), which is not followed here: "
        r"--impacts 2 --periods 1\.",
        said[0],
    )
    _, out, _ = in_this_process([*command, "--impacts", "1"])
    assert "not followed here" not in out  # only this kind was requested


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
    found = vi.follow(scene, PARAMETER, 2.64, 2.7316, doublings=3, grazes=0, step=0.1)
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

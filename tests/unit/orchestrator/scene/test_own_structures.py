"""Bodies by matrices in a scene: equal to the chain that they are of, changed by --set, swept, joined, exported."""

from __future__ import annotations

from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w

import vibroimpact as vi
from vibroimpact.fmus.core import lanes
from vibroimpact.fmus.errors import SceneError
from vibroimpact.orchestrator.commands.cli import main
from vibroimpact.orchestrator.scene import Scene, load_scene
from vibroimpact.orchestrator.scene.body_models import StructureBody
from vibroimpact.orchestrator.structures import find
from vibroimpact.orchestrator.structures.find import find_modes
from vibroimpact.orchestrator.structures.modes import Modes
from vibroimpact.orchestrator.structures.request import Request

STIFFNESS, MASS = [900.0, 700.0, 500.0], [1.0, 0.5, 0.2]
TABLES: dict[str, Any] = {
    "body": [
        {
            "name": "rod",
            "kind": "matrices",
            "file": "rod.npz",
            "stiffness": "K",
            "mass": "M",
            "modes": 3,
            "residual": False,
            "damping_ratio": 0.02,
            "base": {"1": 1.0, "2": 1.0, "3": 1.0},
            "points": {"gap": {"3": 1.0, "2": -1.0}},
        }
    ],
    "forcing": {"at": "rod.3", "amplitude": 5.0, "frequency": 3.0},
    "stop": [{"at": "rod.3", "position": 0.004, "restitution": 0.7}],
    "record": {"transient_periods": 0, "recorded_periods": 40},
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    first, second, third = STIFFNESS
    stiffness = [[first + second, -second, 0.0], [-second, second + third, -third], [0.0, -third, third]]
    np.savez(tmp_path / "rod.npz", K=np.array(stiffness), M=np.diag(MASS))
    write(tmp_path)
    return tmp_path


def write(folder: Path, **tables: Any) -> Path:
    """Write the scene of a rod with other tables; `body` changes the keys of its body."""
    found = deepcopy(TABLES)
    found["body"][0] |= tables.pop("body", {})
    path = folder / "rod.toml"
    path.write_text(tomli_w.dumps(found | tables))
    return path


def modes_of(scene: Scene) -> Any:
    assert isinstance(scene.body, StructureBody)
    return scene.body.tables()["body[1]"]


def code_of(*arguments: str) -> int:
    """Return the exit code of a command."""
    with pytest.raises(SystemExit) as left:
        main(arguments)
    return int(left.value.code or 0)


JOINED: dict[str, Any] = {
    "contact": [{"between": ["rod.3", "ball"], "clearance": 0.002, "restitution": 0.8}],
    "link": [{"between": ["rod.2", "ball"], "stiffness": 30.0, "damping": 0.2}],
    "forcing": [
        {"kind": "base_acceleration", "amplitude": 2.0, "frequency": 3.0},
        {"at": "rod.1", "amplitude": 1.0, "frequency": 6.0},
        {"at": "rod.2", "signal": "constant", "amplitude": 0.3},
    ],
    "stop": [
        {"at": "rod.3", "position": -0.01, "side": "lower", "restitution": 0.5, "motion_amplitude": 1e-3}
    ],
}
JOINED["stop"][0]["motion_angular_frequency"] = 6.0 * np.pi


@pytest.mark.parametrize("joined", [{}, JOINED], ids=["alone", "joined"])
def test_a_chain_by_its_matrices_is_this_chain(folder: Path, joined: dict[str, Any]) -> None:
    chain = {"name": "rod", "kind": "chain", "masses": MASS, "stiffnesses": STIFFNESS}
    ball = {"name": "ball", "mass": 0.1, "stiffness": 20.0}
    tables = {**TABLES, **joined}
    rod = {**TABLES["body"][0], "damping_ratio": 0.0}
    path = folder / "rod.toml"
    path.write_text(tomli_w.dumps({**tables, "body": [rod, ball]}))
    given = vi.run(path, progress=False)
    known = vi.run(Scene.from_dict({**tables, "body": [chain, ball]}), progress=False)
    count = 12
    assert int(known.impact_count) > count
    np.testing.assert_allclose(given.impact_time[:count], known.impact_time[:count], rtol=1e-9)
    np.testing.assert_allclose(given.impact_velocity[:count], known.impact_velocity[:count], rtol=1e-6)


def test_the_scene_of_matrices_keeps_numbers_hashes_and_error_and_needs_no_file(folder: Path) -> None:
    scene = load_scene(folder / "rod.toml")
    (folder / "rod.npz").unlink()
    origin = modes_of(scene).origin
    assert list(origin.files) == ["rod.npz"]
    assert origin.error < 1e-9
    again = Scene.from_text(scene.text)
    assert again.text == scene.text
    dataset = vi.run(again, progress=False)
    assert "[body.origin.files]" in dataset.attrs["scene"]
    assert int(dataset.impact_count) > 5


def test_a_replay_names_a_degree_of_freedom(folder: Path) -> None:
    signals = [{"simulated": "displacement[rod.3]", "measured": "rod"}]
    replay = {"drive": "force", "from": "force", "at": "rod.2", "compare": signals}
    tables = {"body": TABLES["body"], "replay": replay, "record": {"observed": ["rod.3"]}}
    (folder / "replay.toml").write_text(tomli_w.dumps(tables))
    assert {"2", "3"} < modes_of(load_scene(folder / "replay.toml")).shapes.keys()


def test_of_too_many_points_of_matrices_a_scene_keeps_those_that_it_names(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(find, "MOST_NUMBERS", 12)
    points = {f"gap{number}": {"3": 1.0, "2": -1.0 / number} for number in range(1, 6)}
    path = write(folder, body={"points": points}, record={"recorded_periods": 40, "observed": ["rod.gap4"]})
    scene = load_scene(path)
    assert [*modes_of(scene).shapes] == ["gap1", "gap2", "gap4", "3"]
    assert modes_of(scene).origin.remarks == ("2 points that the scene does not name are left out.",)
    monkeypatch.undo()
    one, other = vi.run(scene, progress=False), vi.run(path, progress=False)
    np.testing.assert_array_equal(one.displacement_max, other.displacement_max)


def test_changes_reach_the_reduction_and_the_modes_that_it_finds(folder: Path) -> None:
    path = folder / "rod.toml"
    plain = modes_of(load_scene(path))
    fewer = load_scene(
        path, ["body[1].modes=2", "body[1].frequencies[1]=4.5", "body[1].damping_ratio=[0.1, 0.2]"]
    )
    assert modes_of(fewer).frequencies == (4.5, plain.frequencies[1])
    assert modes_of(fewer).damping_ratio == (0.1, 0.2)
    one = load_scene(path, ["body[1].angular_frequencies=[20, 40, 60]", "body[1].damping_ratio=0.1"])
    assert (modes_of(one).frequencies, modes_of(one).natural) == (None, (20.0, 40.0, 60.0))
    with pytest.raises(
        SceneError, match=r"body\[1\].frequencies\[4\]: expected body\[1\].frequencies\[1\] to"
    ):
        load_scene(path, ["body[1].frequencies[4]=1"])


def test_the_tolerance_and_the_highest_frequency_of_a_scene_are_those_of_the_number_of_modes(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[float, float]] = []

    def noted(request: Request) -> Modes:
        asked.append((request.tolerance, request.driven))
        return find_modes(request)

    monkeypatch.setattr(find, "find_modes", noted)
    for tolerance, frequency in (("0.3", 3.0), ("1e-6", 8.0)):
        changes = [f"execution.tolerance={tolerance}", f"forcing.frequency={frequency}"]
        load_scene(folder / "rod.toml", ["body[1].modes=auto", *changes])
    load_scene(folder / "rod.toml", ["body[1].modes=3", "forcing.frequency=5"])
    assert asked == [(0.3, 6.0 * np.pi), (1e-6, 16.0 * np.pi), (1e-3, 0.0)]


def test_keys_of_matrices_and_of_their_stop_and_force_are_swept_in_lanes(folder: Path) -> None:
    sweep = {
        "body[1].frequencies[2]": {"values": [7.0, 7.5]},
        "body[1].damping_ratio": {"values": [0.01, 0.02]},
        "stop[1].position": {"values": [0.003, 0.004]},
        "forcing.amplitude": {"values": [4.0, 5.0]},
    }
    scene = load_scene(write(folder, sweep=sweep))
    dataset = vi.run(scene, progress=False)
    assert dataset.attrs["execution"] == "lanes"
    point = dict(frequencies_2=7.5, damping_ratio=0.01, position=0.003, amplitude=4.0)
    values = {"body[1].frequencies[2]": 7.5, "body[1].damping_ratio": 0.01, "stop[1].position": 0.003}
    alone = vi.run(
        load_scene(write(folder)).with_values({**values, "forcing.amplitude": 4.0}), progress=False
    )
    assert float(dataset.sel(point).final_velocity) == float(alone.final_velocity)


def test_points_over_the_place_of_a_stop_and_the_force_run_in_lanes_at_once(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[int] = []

    def counted(plan: Any, points: Any, memory: Any) -> lanes.LanesEnd:
        calls.append(points.count)
        return run_lanes(plan, points, memory)

    run_lanes = lanes.run_lanes
    monkeypatch.setattr(lanes, "run_lanes", counted)
    sweep = {
        "stop[1].position": {"values": [0.0, 0.003, 0.2, 0.3]},
        "forcing.amplitude": {"start": 1.0, "stop": 2.0, "points": 5},
    }
    dataset = vi.run(load_scene(write(folder, sweep=sweep)), progress=False)
    assert dataset.attrs["execution"] == "lanes"
    assert set(calls) == {20}


def test_orbits_of_matrices_are_found_and_followed_over_a_frequency(folder: Path) -> None:
    forcing, stop = {**TABLES["forcing"], "frequency": 2.8}, {**TABLES["stop"][0], "position": 0.05}
    scene = load_scene(write(folder, forcing=forcing, stop=[stop]))
    (orbit,) = [each for each in vi.find_orbits(scene, impacts=1, periods=1) if each.is_stable]
    moved = scene.with_values({"body[1].frequencies[1]": 1.01 * modes_of(scene).frequencies[0]})
    assert any(each.is_stable for each in vi.find_orbits(moved, impacts=1, periods=1))
    long = vi.run(
        scene.with_values({"record.transient_periods": 500, "record.recorded_periods": 4}), progress=False
    )
    np.testing.assert_allclose(long.impact_velocity[-1], orbit.velocities[0], rtol=1e-6)


def test_an_exported_structure_by_matrices_runs_in_fmpy_as_here(folder: Path) -> None:
    fmpy = pytest.importorskip("fmpy")
    series = {"rate": 1000.0, "variables": ["displacement"]}
    path = write(folder, record={**TABLES["record"], "recorded_periods": 3, "time_series": series})
    expected = vi.run(load_scene(path), progress=False).displacement.values
    for version in ("2.0", "3.0"):
        fmu = folder / f"rod{version}.fmu"
        assert code_of("fmu", "export", str(path), "--fmi", version, "-o", str(fmu)) == 0
        found = fmpy.simulate_fmu(str(fmu), stop_time=0.99, output_interval=1e-3, fmi_type="CoSimulation")
        count = min(len(found), len(expected))
        assert count > 900
        np.testing.assert_allclose(found["displacement"][:count], expected[:count], atol=1e-11)


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ({"file": "none.npz"}, "body[1]: rod/none.npz: expected a file that can be read"),
        ({"stiffness": "A"}, "expected"),
        ({"points": {"gap": "9"}}, "expected a degree of freedom such as 1, 2, 3, got '9'"),
        ({"modes": 65}, "body[1].modes: expected a whole number from 1 to 64"),
        ({"mass": "N"}, "expected mass with a diagonal >= 0, got -0.5 at 2."),
        ({"stiffness": "S"}, "symmetric"),
        ({"mas": "M"}, "body[1].mas: expected a known key"),
        ({"base": "z"}, "expected a base direction"),
    ],
)
def test_mistakes_of_matrices_are_one_line_with_exit_code_2_and_nothing_is_written(
    folder: Path, capsys: pytest.CaptureFixture[str], body: dict[str, Any], said: str
) -> None:
    with np.load(folder / "rod.npz") as found:
        skew = found["K"] + np.array([[0.0, 5.0, 0.0], [-5.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
        np.savez(folder / "rod.npz", **found, N=np.diag([1.0, -0.5, 0.2]), S=skew)
    before = sorted(folder.iterdir())
    path = write(folder, body=body)
    assert code_of("run", str(path), "-o", str(folder / "out.nc")) == 2
    printed = capsys.readouterr().err.strip()
    assert len(printed.splitlines()) == 1
    assert said.replace("rod/", f"{folder}/") in printed
    assert sorted(folder.iterdir()) == before


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("base", 3),
        ("base", [0.0, 0.0]),
        ("base", {"42.z": "a"}),
        ("points", 3),
        ("points", {"tip": 3}),
        ("points", {"tip": {"42.z": "a"}}),
        ("points", {"tip": {"42.z": [1.0]}}),
    ],
)
def test_weights_that_are_none_are_one_line(key: str, value: object) -> None:
    # once a place within a table of weights ended in an AttributeError
    body = {"name": "p", "kind": "matrices", "stiffness": "k.mtx", "mass": "m.mtx", key: value}
    with pytest.raises(SceneError, match=rf"body\[1\]\.{key}.*: expected .*got ") as refused:
        Scene.from_dict({"body": [body], "record": {"recorded_time": 1.0}})
    assert len(refused.value.problems) == 1

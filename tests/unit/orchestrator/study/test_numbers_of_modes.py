"""Numbers of modes of structures as ways of a study of accuracy: of given modes, of matrices, and of beams."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.places import EXAMPLES
from support.replay_scenes import channel, pulse, written
from support.studied_scenes import ladder, studied_once

from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.study.accuracy import advice, dataset_of
from vibroimpact.orchestrator.study.errors import errors_of
from vibroimpact.orchestrator.study.references import observed, scales_of
from vibroimpact.orchestrator.study.ways.all_ways import remarks_on, ways_of
from vibroimpact.orchestrator.study.ways.numbers_of_modes import finest_modes

SOFT: dict[str, Any] = {"law": "kelvin_voigt", "position": 1e-4, "stiffness": 2e4, "damping": 1.0}
BOARD: dict[str, Any] = {
    **{"name": "board", "kind": "modes", "damping_ratio": [0.02, 0.01, 0.02, 0.03, 0.01]},
    "frequencies": [10.0, 62.7, 175.0, 340.0, 560.0],
    "shapes": {"tip": [2.0, -2.0, 2.0, -2.0, 2.0], "middle": [0.7, 1.4, 0.0, -1.4, -1.4]},
}
SCENE: dict[str, Any] = {
    "body": [BOARD],
    "forcing": [{"at": "board.middle", "amplitude": 0.5, "frequency": 11.0}],
    "stop": [{"at": "board.tip"} | SOFT],
    "record": {"recorded_periods": 3},
}
RIGID: dict[str, Any] = {"stop": [{"at": "board.tip", "position": 1e-4, "restitution": 0.6}]}


def test_given_modes_on_a_soft_stop_converge_to_all_of_them() -> None:
    study = studied_once(Scene.from_dict(SCENE))
    counts, errors = ladder(study, "modes")
    assert counts.tolist()[-2:] == [2.0, 4.0]
    assert errors[-1] < 0.2 * errors[-2]
    with_vectors, better = ladder(study, "residual vectors")
    assert with_vectors.tolist() == [4.0]  # two natural modes with two residual vectors
    assert better[0] < 0.5 * errors[-2]
    assert study.modes_reference == "5 modes of all bodies"
    assert advice(study).startswith("Take fused")
    assert "differs" not in advice(study)  # the scene has them all


def test_impacts_on_a_rigid_stop_are_compared_as_a_whole() -> None:
    study = studied_once(Scene.from_dict(SCENE | RIGID))
    models = [one for one in study.measured if one.way.model]
    assert {one.way.name for one in models} == {"modes", "residual vectors"}
    for one in models:
        known = {name for name, error in one.errors.of.items() if error == error}
        assert known == {"displacement_range", "mean_energy"}
        assert " of the reference" in one.errors.remark
    assert any("excites all modes" in remark for remark in study.remarks)
    found = dataset_of(study)
    assert "error_mean_energy" in found


def test_a_motion_without_forcing_has_a_range_too() -> None:
    start = BOARD | {"velocity_start": [0.05, 0.02]}
    scene = SCENE | RIGID | {"body": [start], "record": {"recorded_time": 0.3}}
    del scene["forcing"]
    study = studied_once(Scene.from_dict(scene))
    _, errors = ladder(study, "residual vectors")
    assert len(errors)


def test_beams_and_modes_are_taken_together() -> None:
    beam = {
        **{"name": "beam", "kind": "beam", "modes": 3, "damping_ratio": 0.02, "length": 0.25},
        **{"flexural_rigidity": 0.9333, "mass_per_length": 0.108},
    }
    tables = SCENE | {
        "body": [beam, BOARD, {"name": "ball", "mass": 0.1, "stiffness": 10.0}],
        "link": [{"between": ["beam", "ball"], "stiffness": 20.0}],
    }
    ways = [way for way in ways_of(Scene.from_dict(tables)) if way.model]
    bodies = [way.scene.body for way in ways if way.scene is not None]
    sizes = [tuple(part.size for part in body.parts) for body in bodies]  # type: ignore[union-attr]
    assert (1, 1, 1) in sizes
    assert (8, 5, 1) in sizes
    assert (3, 5, 1) in sizes  # the scene itself
    assert [way.is_own_model for way in ways].count(True) == 1
    assert all(way.against is not None and way.against.body.size == 18 for way in ways)


def test_matrices_give_more_modes_than_their_scene_has(tmp_path: Path) -> None:
    shutil.copytree(EXAMPLES / "tube", tmp_path / "tube")
    text = (EXAMPLES / "tube.toml").read_text()
    path = tmp_path / "tube.toml"
    path.write_text(text)
    scene = Scene.from_file(path)
    finest = finest_modes(scene)
    assert {place: len(modes.natural) for place, modes in finest.items()} == {0: 48}
    shutil.rmtree(tmp_path / "tube")
    assert finest_modes(scene) == {}  # and the scene's own modes are the most
    own = [way for way in ways_of(scene.unswept()) if way.model]
    assert max(way.setting for way in own) == 8
    path.write_text(text.replace('"tube/', f'"{EXAMPLES}/tube/').replace("modes = 10", "modes = 12"))
    assert finest_modes(Scene.from_file(path).with_values({"body[1].frequencies[1]": 9.0})) == {}


def test_a_replay_of_given_modes_has_fewer_samples_and_fewer_modes(tmp_path: Path) -> None:
    time = np.asarray(2e-5 * np.arange(1000), dtype=np.float64)
    path = written(
        tmp_path / "base.nc",
        channel("base", time, pulse(time), "m s-2", trigger="one"),
        channel("board", time, pulse(time), trigger="one"),
    )
    replay = {
        **{"recordings": [str(path)], "drive": "base_acceleration", "from": "base", "drive_offset": 0.0},
        "compare": [{"simulated": "sensor.acceleration", "measured": "board"}],
    }
    body = BOARD | {"participation": [1.0, 0.5, 0.3, 0.2, 0.1], "shapes": {"tip": BOARD["shapes"]["tip"]}}
    scene = Scene.from_dict({"body": [body], "sensor": {"gain": 1.0}, "replay": replay})
    ways = ways_of(scene)
    assert {way.name for way in ways if not way.model} == {"fused", "fewer samples"}
    whole, (one, _, four) = observed(scene), [way for way in ways if way.name == "modes"]
    few, more = (
        errors_of(observed(way.scene), whole, scales_of(scene)).of["samples"]
        for way in (one, four)
        if way.scene is not None
    )
    assert more < few < 1.0


def test_forces_and_moving_stops_name_the_ways_that_they_do_not_have() -> None:
    two = [{"amplitude": 0.5, "angular_frequency": 1.0}, {"amplitude": 0.2, "angular_frequency": 2.0}]
    tables = {
        "body": {"mass": 1.0, "stiffness": 1.0},
        "forcing": two,
        "stop": [{"position": 1.0, "restitution": 0.7}],
        "record": {"recorded_periods": 2},
    }
    scene = Scene.from_dict(tables)
    with pytest.raises(
        UsageError, match=r"simulated in one way\. It is exact: several bodies, several forces"
    ):
        studied_once(scene)
    assert any(remark.startswith("stops as FMUs of their own") for remark in remarks_on(scene))
    hertz = tables | {"stop": [{"law": "hertz", "position": 0.3, "stiffness": 1e3}]}
    study = studied_once(Scene.from_dict(hertz))
    _, errors = ladder(study, "fused")
    assert errors[-1] < 1e-8 < errors[0]

"""Scenes made and changed in Python: checked like files, refused in the words of files."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from support.places import ROOT

from vibroimpact.fmus.errors import SceneError
from vibroimpact.orchestrator.scene import Scene, load_scene, parse_scene

FREE = {"body": {"mass": 1.0, "stiffness": 4.0}, "record": {"recorded_time": 5.0}}


def problem_of(make) -> str:
    with pytest.raises(SceneError) as caught:
        make()
    return str(caught.value)


@pytest.mark.parametrize(
    "name", ["single_run.toml", "bifurcation.toml", "two_oscillators.toml", "two_stops.toml"]
)
def test_a_scene_of_tables_is_that_of_its_file(name):
    path = ROOT / "examples" / name
    tables = tomllib.loads(path.read_text(encoding="utf-8"))
    scene = Scene.from_dict(tables, str(path))
    assert scene.model_copy(update={"text": ""}) == Scene.from_file(path).model_copy(update={"text": ""})
    assert Scene.from_text(scene.to_toml(), str(path)) == scene
    assert Scene.from_file(path).to_toml() == path.read_text(encoding="utf-8")


def test_numbers_of_numpy_and_xarray_tuples_and_paths_are_values():
    sweep = {
        "body.mass": {"values": xr.DataArray(np.linspace(1.0, 2.0, 3), dims="mass")},
        "body.damping": {"values": (np.float32(0.5), np.int64(1))},
    }
    scene = Scene.from_dict({**FREE, "scene": {"title": "free"}, "sweep": sweep})
    assert [axis.values for axis in scene.sweep] == [(1.0, 1.5, 2.0), (0.5, 1.0)]
    assert scene.runs == 6
    assert "unknown key" in problem_of(lambda: Scene.from_dict({**FREE, "stop": [{"fmu": Path("a.fmu")}]}))


def test_values_are_checked_and_written_into_the_text():
    scene = parse_scene(
        "[body]\nmass = 1\nstiffness = 4\ndamping_ratio = 0.1\n[record]\nrecorded_time = 5\n", "s"
    )
    heavy = scene.with_values({"body.mass": np.float64(4.0), "body.damping": 0.2, "record.recorded_time": 7})
    assert (heavy.body.mass, heavy.body.damping, heavy.value("body.stiffness")) == (4.0, 0.2, 4.0)
    # other processes read the text, which gives the same scene
    assert parse_scene(heavy.to_toml(), "s") == heavy
    assert scene.body.mass == 1.0
    assert problem_of(lambda: scene.with_values({"body.mass": -1.0})).startswith(
        "s: body.mass: expected a number > 0"
    )


def test_a_swept_key_has_no_single_value():
    swept = Scene.from_dict(FREE).with_sweep({"body.mass": np.linspace(1, 2, 5)})
    assert swept.runs == 5
    message = problem_of(lambda: swept.with_values({"body.mass": 3.0}))
    assert message.startswith("scene: body.mass: expected a key that the scene does not sweep")
    assert swept.with_sweep({}).sweep == ()
    assert swept.with_sweep({}).runs == 1


def test_a_path_of_a_sweep_is_followed():
    scene = load_scene(ROOT / "examples" / "single_run.toml")
    axis = {"start": 0.6, "stop": 1.2, "points": 4, "path": "up-down"}
    assert scene.with_sweep({"forcing.angular_frequency": axis}).runs == 8


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Scene.from_dict([1]), "expected a mapping of the tables of a scene, got an array of 1"),
        (
            lambda: Scene.from_dict({**FREE, "body": {"mass": None}}),
            "body.mass: expected a value that TOML has",
        ),
        (lambda: Scene.from_dict({**FREE, 3: {}}), "expected keys that are text, got 3"),
        (lambda: Scene.from_dict({**FREE, "body": {"mass": 1 + 2j}}), "got (1+2j)"),
        (lambda: Scene.from_dict({**FREE, "body": {"masses": np.array(["a", "b"])}}), "masses"),
        (lambda: Scene.from_dict(FREE).with_values({"body.": 1.0}), "expected a key as messages write it"),
        (lambda: Scene.from_dict(FREE).with_values({3: 1.0}), "got 3"),
        (lambda: Scene.from_dict(FREE).with_values({"body.mas": 1.0}), "Did you mean mass?"),
        (lambda: Scene.from_dict(FREE).with_values({"stop[1].position": 1.0}), "stop[1].position: expected"),
        (
            lambda: Scene.from_dict(FREE).with_values({"body.mass": object()}),
            "body.mass: expected a value that TOML",
        ),
        (lambda: Scene.from_dict(FREE).with_sweep({"body.mass": 3.0}), "sweep"),
        (lambda: Scene.from_dict(FREE).with_sweep({"body.mass": []}), "sweep"),
        (lambda: Scene.from_dict(FREE).with_sweep({"body.size": [1.0]}), "body.size"),
        (lambda: Scene.from_text("mass ="), "end of file: expected valid TOML"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(make, words):
    message = problem_of(make)
    assert words in message
    assert message.startswith("scene: ")


def test_a_table_in_itself_ends():
    endless = {}
    endless["endless"] = endless
    assert "tables in each other" in problem_of(lambda: Scene.from_dict({**FREE, "body": endless}))


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.binary() | st.complex_numbers(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text() | st.integers(), inner, max_size=3),
    max_leaves=8,
)


@given(st.dictionaries(st.sampled_from(["body", "record", "forcing", "stop", "sweep", "component"]), VALUES))
def test_any_mapping_is_a_scene_or_one_error(tables):
    try:
        scene = Scene.from_dict(tables)
    except SceneError:
        return
    assert parse_scene(scene.to_toml(), scene.source) == scene


@given(
    st.dictionaries(
        st.text() | st.sampled_from(["body.mass", "record.warmup_time", "title"]), VALUES, max_size=3
    )
)
def test_any_change_is_a_scene_or_one_error(values):
    scene = Scene.from_dict(FREE)
    try:
        changed = scene.with_values(values)
    except SceneError:
        return
    assert parse_scene(changed.to_toml(), changed.source) == changed

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import vibroimpact as vi
from vibroimpact.orchestrator.campaign import run_campaign, run_scene
from vibroimpact.service.landed import LandedReader, files_of
from vibroimpact.service.page_api import examples_folder
from vibroimpact.service.point_process import simulated
from vibroimpact.service.slices import Selection, slice_of

SCENE = """
[scene]
units = "nondimensional"
[body]
mass = 1.0
stiffness = 1.0
damping_ratio = 0.1
[forcing]
amplitude = 0.5
angular_frequency = 1.0
[[stop]]
position = 1.0
restitution = 0.7
[record]
transient_periods = 20
recorded_periods = 6
[sweep]
"stop[1].restitution" = { values = [0.6, 0.8] }
"forcing.angular_frequency" = { start = 0.8, stop = 1.2, points = 20, path = "up-down" }
"""


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("landed")
    path = folder / "dataset.nc"
    run_scene(vi.Scene.from_text(SCENE), path)
    (folder / "scene.toml").write_text(SCENE, encoding="utf-8")
    return path


def test_a_slice_has_the_values_of_the_dataset(file: Path) -> None:
    landed = LandedReader().read([file], "displacement_range")
    assert landed is not None
    assert [axis.name for axis in landed.axes] == ["restitution", "angular_frequency"]
    found = slice_of(landed, Selection({}, {}), 5000)
    with vi.open_dataset(file) as dataset:
        runs = dataset.vibroimpact.runs
        assert found["value"] == runs.displacement_range.values.tolist()
        assert found["coordinates"][1] == runs.angular_frequency.values.tolist()
    assert found["shown"] == found["rows"] == 80


def test_a_slice_is_held_at_a_value_and_cut_to_a_range(file: Path) -> None:
    landed = LandedReader().read([file], "strobe_displacement")
    assert landed is not None
    selection = Selection.from_words(["restitution:0.61"], ["angular_frequency:0.9:1.0"])
    found = slice_of(landed, selection, 5000)
    assert set(found["coordinates"][0]) == {0.6}
    assert 0.9 <= min(found["coordinates"][1]) <= max(found["coordinates"][1]) <= 1.0
    for words in (["restitution"], ["restitution:nan"], ["restitution:1:2"], [":"]):
        with pytest.raises(ValueError, match="expected NAME:VALUE with finite numbers"):
            Selection.from_words(words, [])
    with pytest.raises(ValueError, match="expected a swept parameter"):
        slice_of(landed, Selection({"mass": 1.0}, {}), 10)


def test_a_large_slice_is_thinned_evenly_and_a_map_has_no_gaps(file: Path) -> None:
    reader = LandedReader()
    rows, cells = reader.read([file], "impact_velocity"), reader.read([file], "displacement_range")
    assert rows is not None
    assert cells is not None
    assert slice_of(rows, Selection({}, {}), 7)["shown"] == 7
    found = slice_of(cells, Selection({}, {}), 20)
    grid = {(one, other) for one, other in zip(*found["coordinates"], strict=True)}
    assert len(grid) == len(set(found["coordinates"][0])) * len(set(found["coordinates"][1]))


def test_parts_of_a_campaign_are_joined(file: Path) -> None:
    twice = LandedReader().read([file, file], "impact_velocity")
    once = LandedReader().read([file], "impact_velocity")
    assert twice is not None
    assert once is not None
    assert twice.values.size == 2 * once.values.size
    assert np.array_equal(twice.owners[once.owners.size :], once.owners + once.runs.size)
    assert LandedReader().read(files_of(file.parent / "nothing"), "impact_velocity") is None
    with pytest.raises(KeyError):
        LandedReader().read([file], "nothing")


def test_a_point_of_a_path_is_simulated_from_where_the_one_before_ended(file: Path) -> None:
    with vi.open_dataset(file) as dataset:
        runs = dataset.vibroimpact.runs
        for run in (0, 7, 33, 79):
            found = simulated(file.parent / "scene.toml", file.parent, run)
            json.dumps(found, allow_nan=False)
            # samples cut the flights between impacts, which changes their rounding
            assert found["periods"]["strobe_displacement"] == pytest.approx(
                runs.strobe_displacement.values[run].tolist(), rel=1e-9
            )
            assert found["coordinates"]["angular_frequency"] == runs.angular_frequency.values[run]
    with pytest.raises(vi.VibroimpactError, match="expected a point of this campaign, got 80"):
        simulated(file.parent / "scene.toml", file.parent, 80)


def test_a_point_of_a_later_round_is_simulated_from_where_it_began(tmp_path: Path, cluster: str) -> None:
    adaptive = 'points = 9, path = "up-down", adaptive = { tolerance = 0.001, at_most = 200 } }'
    text = SCENE.replace('points = 20, path = "up-down" }', adaptive)
    run_campaign(vi.Scene.from_text(text), tmp_path / "campaign", scheduler=cluster)
    scene = tmp_path / "scene.toml"
    scene.write_text(text, encoding="utf-8")
    with vi.open_dataset(tmp_path / "campaign") as dataset:
        runs = dataset.vibroimpact.runs.load()
    assert runs.sizes["run"] > 40, "there are rounds beside the first"
    for place in range(30, runs.sizes["run"], 7):
        found = simulated(scene, tmp_path / "campaign", int(runs.run_index[place]))
        assert found["coordinates"]["angular_frequency"] == runs.angular_frequency.values[place]
        assert found["periods"]["strobe_displacement"] == pytest.approx(
            runs.strobe_displacement.values[place].tolist(), rel=1e-6
        )


def test_failures_are_the_runs_with_their_outcome_and_reason(file: Path) -> None:
    assert LandedReader().failures([file], [3, 4, 5]) == []
    assert [one.run for one in LandedReader().failures([file], [0, 1])] == list(range(80))


def test_examples_are_there() -> None:
    assert (examples_folder() / "bifurcation.toml").is_file()

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import vibroimpact as vi
from vibroimpact.analysis.dataset.derived import largest_impact_velocity
from vibroimpact.analysis.orbits.classify import classify
from vibroimpact.orchestrator.campaign import run_campaign
from vibroimpact.orchestrator.running import run_scene
from vibroimpact.service.landed import READING, LandedReader, files_of
from vibroimpact.service.page_api import examples_folder
from vibroimpact.service.point_process import simulated
from vibroimpact.service.run_classes import ClassColumns
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


LOWER = """[[stop]]
side = "lower"
position = -1.5
restitution = 0.7
[record]"""


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


def test_a_thinned_map_says_how_many_points_it_leaves_out(file: Path) -> None:
    landed = LandedReader().read([file], "displacement_range")
    assert landed is not None
    found = slice_of(landed, Selection({}, {}), 20)
    assert (found["rows"], found["every"]) == (80, 2)
    assert found["shown"] == len(found["value"]) == 1 * 10 * 2
    assert slice_of(landed, Selection({}, {}), 80)["every"] == 1


def test_a_map_can_be_of_what_plot_draws_maps_of(file: Path) -> None:
    reader = LandedReader()
    answers = {}
    for name in ("largest_impact_velocity", "mean_impacts_per_period", "class"):
        landed = reader.read([file], name)
        assert landed is not None
        answers[name] = slice_of(landed, Selection({}, {}), 5000)
    with vi.open_dataset(file) as dataset:
        largest = largest_impact_velocity(dataset)
        mean = dataset["impacts_per_period"].mean("period")
        expected = {
            "largest_impact_velocity": largest,
            "mean_impacts_per_period": mean.where(mean > 0.0),
        }
        for name, values in expected.items():
            runs = dataset.assign(wanted=values).vibroimpact.runs["wanted"].values
            found = np.array(answers[name]["value"], dtype=np.float64)
            assert np.isfinite(found).any()
            np.testing.assert_array_equal(found, runs)
        names = [one.name for one in classify(dataset)]
    answer = answers["class"]
    assert [answer["classes"][int(place)] for place in answer["value"]] == names
    assert {"P(1,1)"} < set(names), "motions of several classes"
    counts = [names.count(name) for name in answer["classes"]]
    assert counts == sorted(counts, reverse=True)
    assert answers["largest_impact_velocity"]["classes"] == []


def test_other_files_can_be_read_while_classes_are_found(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    codes, locked = ClassColumns.codes, []

    def watched(columns: ClassColumns) -> NDArray[np.float64]:
        locked.append(READING.locked())
        return codes(columns)

    monkeypatch.setattr(ClassColumns, "codes", watched)
    landed = LandedReader().read([file], "class")
    assert landed is not None
    assert landed.values.size == landed.owners.size
    assert locked == [False]


def test_keys_that_move_together_are_one_axis_of_a_map(tmp_path: Path) -> None:
    gap = """
    "stop[1].position" = { values = [0.2, 0.4, 0.8], zip = "gap" }
    "body.mass" = { values = [1.0, 1.1, 1.2], zip = "gap" }
    """
    text = SCENE.replace('"stop[1].restitution" = { values = [0.6, 0.8] }', gap).replace("up-down", "up")
    run_scene(vi.Scene.from_text(text), tmp_path / "dataset.nc")
    landed = LandedReader().read([tmp_path / "dataset.nc"], "displacement_range")
    assert landed is not None
    assert [(axis.name, axis.along) for axis in landed.axes] == [
        ("position", "gap"),
        ("mass", "gap"),
        ("angular_frequency", ""),
    ]
    found = slice_of(landed, Selection({}, {}), 20)
    assert (found["rows"], found["every"], found["shown"]) == (60, 2, 20)
    # with one of them held, a single axis is left, and all of its points are drawn
    assert slice_of(landed, Selection({"mass": 1.1}, {}), 30)["shown"] == 20


def test_a_point_has_the_stops_that_limit_it_and_says_what_is_left_out(tmp_path: Path) -> None:
    text = SCENE.replace("recorded_periods = 6", "recorded_periods = 30").replace("[record]", LOWER)
    text = text[: text.index("[sweep]")] + '[sweep]\n"stop[1].position" = { values = [0.5, 0.7] }\n'
    run_scene(vi.Scene.from_text(text), tmp_path / "dataset.nc")
    (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    found = simulated(tmp_path / "scene.toml", tmp_path, 1)
    assert found["stops"] == {"displacement": [0.7, -1.5]}
    assert found["left_out"] == ["The first 20 of 30 recorded periods are shown."]


def test_a_stop_that_moves_is_not_drawn_at_rest(tmp_path: Path) -> None:
    shaken = "motion_amplitude = 0.01\nmotion_angular_frequency = 1.0\n[record]"
    text = SCENE.replace("[record]", LOWER).replace("[record]", shaken)
    text = text[: text.index("[sweep]")] + '[sweep]\n"stop[1].position" = { values = [0.5, 0.7] }\n'
    run_scene(vi.Scene.from_text(text), tmp_path / "dataset.nc")
    (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    found = simulated(tmp_path / "scene.toml", tmp_path, 1)
    assert found["stops"] == {"displacement": [0.7]}
    assert found["left_out"] == ["Stops that move are not drawn."]


@pytest.mark.parametrize(
    ("body", "stops"),
    [
        ('kind = "chain"\nmasses = [1.0, 1.0]\nstiffnesses = [1.0, 1.0]', {"displacement[1]": [0.5]}),
        (
            'kind = "beam"\nmodes = 2\nlength = 1.0\nflexural_rigidity = 1.0\nmass_per_length = 1.0',
            {"contact_displacement[1]": [0.5]},
        ),
    ],
)
def test_a_stop_limits_the_point_that_it_is_at(
    tmp_path: Path, body: str, stops: dict[str, list[float]]
) -> None:
    (name,) = stops
    place = "mass = 1" if "chain" in body else "location = 0.5"
    text = f"""
    [body]
    {body}
    damping_ratio = 0.1
    [forcing]
    amplitude = 0.5
    angular_frequency = 1.0
    [[stop]]
    position = 0.5
    restitution = 0.7
    {place}
    [record]
    recorded_periods = 2
    time_series = {{ rate = 10.0, variables = ["{name}"] }}
    """
    if "chain" in body:
        text = text.replace("amplitude = 0.5", "amplitude = [0.5, 0.0]").replace("damping_ratio = 0.1", "")
    run_scene(vi.Scene.from_text(text), tmp_path / "dataset.nc")
    (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    found = simulated(tmp_path / "scene.toml", tmp_path / "dataset.nc", 0)["stops"]
    assert found[name] == stops[name]
    # the observed tip of a beam has no stop; the observed mass of a chain is the mass at its first stop
    assert ("displacement" in found) == ("chain" in body)


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
            # samples cut the flights between impacts, which changes their rounding errors
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

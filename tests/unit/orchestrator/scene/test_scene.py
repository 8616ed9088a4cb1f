"""Scene files: reading, and messages on a wrong file."""

from __future__ import annotations

import math
import pickle
import time
from pathlib import Path

import pytest
from support.places import ROOT
from support.scenes import FORCED, changed, scene_of, swept

from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.scene import load_scene
from vibroimpact.orchestrator.scene.sweep import SweepAxis

MADE_BY_THE_USER = {"bouncing_ball", "user_contact_law"}  # need an FMU that is not shipped
EXAMPLES = [path for path in sorted((ROOT / "examples").glob("*.toml")) if path.stem not in MADE_BY_THE_USER]

FREE = "[body]\nmass = 2\nstiffness = 8\n[record]\nrecorded_time = 5\n"


# Reading.


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_every_example_is_a_scene(path: Path) -> None:
    scene = load_scene(path)
    assert scene.source == str(path)
    written = path.read_text(encoding="utf-8")
    assert scene.text == written or 'kind = "matrices"' in written  # bodies by files are kept by their modes
    assert scene.title


def test_the_example_of_the_thesis_figure_has_its_parameters() -> None:
    scene = load_scene(ROOT / "examples" / "bifurcation.toml")
    assert (scene.body.mass, scene.body.stiffness, scene.body.damping) == (1.0, 1.0, 0.1)
    assert scene.forcing is not None
    assert scene.forcing.amplitude == 0.5
    assert [(stop.position, stop.side, stop.restitution) for stop in scene.stops] == [(1.0, "upper", 0.7)]
    (axis,) = scene.sweep
    assert (axis.key, axis.path, len(axis.values)) == ("forcing.angular_frequency", "up-down", 401)
    assert (axis.values[0], axis.values[-1]) == (0.6, 1.6)


def test_what_is_left_out_has_its_documented_default() -> None:
    scene = scene_of(FREE)
    assert (scene.title, scene.units, scene.forcing, scene.stops, scene.sweep) == ("", "SI", None, (), ())
    assert (scene.body.kind, scene.body.damping, scene.body.displacement_start) == ("oscillator", 0.0, 0.0)
    assert (scene.execution.how, scene.execution.impact_limit, scene.execution.deadline) == (
        "auto",
        10**7,
        None,
    )


def test_damping_ratio_is_relative_to_critical_damping() -> None:
    body = scene_of(FREE.replace("stiffness = 8", "stiffness = 8\ndamping_ratio = 0.5")).body
    assert body.damping == 2 * 0.5 * math.sqrt(8 * 2)


def test_frequency_in_hertz_is_two_pi_times_smaller_than_angular_frequency() -> None:
    text = changed(FORCED, "angular_frequency = 0.8", "frequency = 5.0").replace("nondimensional", "SI")
    scene = scene_of(text)
    assert scene.forcing is not None
    assert scene.forcing.angular_frequency == 2 * math.pi * 5.0
    assert scene.period == pytest.approx(0.2, rel=1e-15)


def test_a_constant_force_has_no_period_and_counts_time() -> None:
    text = FREE + "[forcing]\namplitude = -9.81\nangular_frequency = 0\n"
    assert scene_of(text).period is None
    assert scene_of(FREE).period is None


def test_variables_of_a_period_are_not_recorded_where_there_is_none() -> None:
    record = scene_of(FREE + "strobe = true\n").record
    assert (record.impacts, record.extrema, record.strobe) == (True, False, False)


def test_a_start_exactly_on_the_stop_is_allowed() -> None:
    assert (
        scene_of(changed(FORCED, "damping = 0.1", "displacement_start = 1.0")).body.displacement_start == 1.0
    )


def test_continuation_values_ascend_and_independent_values_keep_their_order() -> None:
    scene = scene_of(
        swept(
            FORCED,
            '"forcing.angular_frequency" = { start = 1.6, stop = 0.6, points = 3, path = "up" }',
            '"body.mass" = { values = [3, 1, 2] }',
        )
    )
    assert scene.sweep == (
        SweepAxis("forcing.angular_frequency", (0.6, 1.1, 1.6), "up"),
        SweepAxis("body.mass", (3.0, 1.0, 2.0), "independent"),
    )


def test_a_swept_key_may_be_left_out_of_its_table() -> None:
    text = swept(FORCED, '"body.damping_ratio" = { values = [0.05, 0.1] }').replace("damping = 0.1\n", "")
    assert scene_of(text).body.damping_ratio == 0.05


def test_a_file_with_a_byte_order_mark_is_read(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_bytes(b"\xef\xbb\xbf" + FORCED.encode())
    assert load_scene(path).text == FORCED


# Values of a scene.


def test_at_a_point_changes_only_what_it_is_given() -> None:
    scene = scene_of(FORCED)
    other = scene.at({"forcing.angular_frequency": 1.2, "stop[1].position": 2.0, "body.mass": 3.0})
    assert [other.value(key) for key in ("forcing.angular_frequency", "stop[1].position", "body.mass")] == [
        1.2,
        2.0,
        3.0,
    ]
    assert scene.value("stop[1].position") == 1.0
    back = {key: scene.value(key) for key in ("forcing.angular_frequency", "stop[1].position", "body.mass")}
    assert other.at(back) == scene


def test_damping_follows_its_ratio_when_the_stiffness_is_swept() -> None:
    scene = scene_of(changed(FORCED, "damping = 0.1", "damping_ratio = 0.05"))
    assert scene.at({"body.stiffness": 4.0}).body.damping == 2 * 0.05 * 2.0


@pytest.mark.parametrize(
    ("key", "other"),
    [("body.damping", "body.damping_ratio"), ("forcing.angular_frequency", "forcing.frequency")],
)
def test_the_key_set_last_wins_over_its_relative(key: str, other: str) -> None:
    scene = scene_of(FORCED).at({other: 0.3}).at({key: 0.7})
    assert scene.value(key) == 0.7


def test_a_point_is_much_faster_than_reading_the_scene_again() -> None:
    scene = scene_of(FORCED)

    def best(action: object) -> float:
        assert callable(action)
        times = []
        for _ in range(20):
            start = time.perf_counter()
            action()
            times.append(time.perf_counter() - start)
        return min(times)

    changed = best(lambda: scene.at({"forcing.angular_frequency": 1.0, "stop[1].position": 2.0}))
    assert changed * 3 < best(lambda: scene_of(FORCED))


@pytest.mark.parametrize(
    "key", ["body.colour", "stop[2].position", "stop[0].position", "body.kind", "mass", ""]
)
def test_a_key_without_a_number_is_misuse(key: str) -> None:
    scene = scene_of(FORCED)
    with pytest.raises(UsageError, match="expected"):
        scene.value(key)
    with pytest.raises(UsageError, match="expected"):
        scene.at({key: 1.0})


def test_a_scene_travels_to_workers_and_cannot_be_changed() -> None:
    scene = scene_of(FORCED)
    assert pickle.loads(pickle.dumps(scene)) == scene
    with pytest.raises(ValueError, match="frozen"):
        scene.body.mass = 2.0


def test_coordinates_are_named_by_the_last_part_of_their_key_unless_two_clash() -> None:
    text = swept(
        FORCED,
        '"stop[1].position" = { values = [1.0] }',
        '"stop[2].position" = { values = [-1.0] }',
        '"body.mass" = { values = [1.0] }',
    ).replace("[record]", '[[stop]]\nposition = -1.0\nside = "lower"\nrestitution = 1\n[record]')
    scene = scene_of(text)
    names = [scene.sweep_coordinate_name(axis.key) for axis in scene.sweep]
    assert names == ["stop_1_position", "stop_2_position", "mass"]

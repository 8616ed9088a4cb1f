"""Bodies of modes from files: equal to those with the numbers in the scene, whose text then needs no file."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from support.modes_files import nodal_data, units

import vibroimpact as vi
from vibroimpact.fmus.errors import SceneError
from vibroimpact.orchestrator.scene import Scene

CSV = "frequency,10,62\ndamping_ratio,0.01,0.01\ntip,2,-2\nmiddle,0.7,1.4\n"
GIVEN: dict[str, Any] = {
    "frequencies": [10.0, 62.0],
    "damping_ratio": 0.01,
    "shapes": {"tip": [2.0, -2.0], "middle": [0.7, 1.4]},
}


def tables(body: dict[str, Any], tip: str = "tip", middle: str = "middle") -> dict[str, Any]:
    """Return the tables of a scene of one body."""
    return {
        "body": {"kind": "modes", **body},
        "forcing": {"at": f"body.{middle}", "amplitude": 0.5, "frequency": 11.0},
        "stop": [{"at": f"body.{tip}", "position": 1e-4, "restitution": 0.7}],
        "record": {"transient_periods": 0, "recorded_periods": 20},
    }


def scene_in(folder: Path, **texts: Any) -> Scene:
    """Return the scene of a file beside the file of its modes."""
    path = folder / "scene.toml"
    path.write_text(tomli_w.dumps(tables(**texts)))
    return Scene.from_file(path)


def test_modes_of_a_file_move_as_the_same_numbers_in_the_scene(tmp_path: Path) -> None:
    (tmp_path / "board.csv").write_text(CSV)
    scene = scene_in(tmp_path, body={"file": "board.csv"})
    (tmp_path / "board.csv").unlink()
    one, other = vi.run(scene), vi.run(Scene.from_dict(tables(GIVEN)))
    np.testing.assert_array_equal(one.impact_time, other.impact_time)
    assert int(one.impact_count) > 5
    assert Scene.from_text(scene.text).text == scene.text
    assert "board.csv" in scene.text
    assert hashlib.sha256(CSV.encode()).hexdigest() in scene.text
    assert "file =" not in scene.text


def test_a_universal_file_names_its_points_by_node_and_direction(tmp_path: Path) -> None:
    shapes = (
        {3: np.array([0.0, 0.0, 1.0]), 5: np.array([0.0, 0.0, 0.35])},
        {
            3: np.array([0.0, 0.0, -1.0]),
            5: np.array([0.0, 0.0, 0.7]),
        },
    )
    text = units() + "".join(
        nodal_data(number, (frequency, 0.25, 0.01, 0.0), shapes[number - 1])
        for number, frequency in ((1, 10.0), (2, 62.0))
    )
    (tmp_path / "board.uff").write_text(text)
    scene = scene_in(tmp_path, body={"file": "board.uff"}, tip="3.z", middle="5.z")
    one, other = vi.run(scene), vi.run(Scene.from_dict(tables(GIVEN)))
    np.testing.assert_array_equal(one.impact_time, other.impact_time)


def test_keys_beside_a_file_replace_those_of_the_file(tmp_path: Path) -> None:
    (tmp_path / "board.csv").write_text(CSV.replace("10,62", "11,70"))
    scene = scene_in(tmp_path, body={"file": "board.csv", "frequencies": [10.0, 62.0]})
    one, other = vi.run(scene), vi.run(Scene.from_dict(tables(GIVEN)))
    np.testing.assert_array_equal(one.impact_time, other.impact_time)


def test_a_file_of_many_modes_and_points_gives_the_lowest_modes_and_the_named_points(tmp_path: Path) -> None:
    rows = [
        [f"p{point}", *np.round(np.sin(np.arange(1.0, 71.0) * point), 3).tolist()] for point in range(1100)
    ]
    lines = [["frequency", *range(1, 71)], *rows]
    (tmp_path / "many.csv").write_text("\n".join(",".join(map(str, line)) for line in lines))
    scene = scene_in(tmp_path, body={"file": "many.csv", "damping_ratio": 0.01}, tip="p1099", middle="p7")
    assert [*scene.body.parts[0].points] == ["p0", "p1", "p7", "p1099"]
    assert "6 modes above the lowest 64 are left out." in scene.text
    assert "1096 points that the scene does not name are left out." in scene.text
    assert len(scene.text) < 2e4
    # equal modes of few points, given as numbers
    few = [row for row in lines if row[0] in ("frequency", "p0", "p7", "p1099")]
    (tmp_path / "few.csv").write_text("\n".join(",".join(map(str, line[:65])) for line in few))
    other = scene_in(tmp_path, body={"file": "few.csv", "damping_ratio": 0.01}, tip="p1099", middle="p7")
    assert [*other.body.parts[0].points] == ["p0", "p7", "p1099"]
    one, two = vi.run(scene), vi.run(other)
    np.testing.assert_array_equal(one.impact_time, two.impact_time)
    np.testing.assert_array_equal(one.displacement_max, two.displacement_max)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (CSV.replace("0.7", "x"), "board.csv: line 4: expected a number, got 'x'."),
        ("tip,1\n", "board.csv: expected a row frequency or angular_frequency, got neither."),
        (
            CSV.replace("tip,2,-2", "tip,2"),
            "board.csv: line 3: expected 2 numbers, one for each mode, got 1.",
        ),
    ],
)
def test_mistakes_of_a_file_have_one_line_with_its_key_and_place(
    tmp_path: Path, content: str, said: str
) -> None:
    (tmp_path / "board.csv").write_text(content)
    with pytest.raises(SceneError) as caught:
        scene_in(tmp_path, body={"file": "board.csv"})
    assert str(caught.value) == f"{tmp_path / 'scene.toml'}: body.file: {tmp_path}/{said}"


def test_a_missing_file_and_a_point_without_shape_are_told(tmp_path: Path) -> None:
    with pytest.raises(
        SceneError, match=r"body.file: .*none.uff: expected a file that can be read, got an error: No such"
    ):
        scene_in(tmp_path, body={"file": "none.uff"})
    (tmp_path / "board.csv").write_text(CSV)
    with pytest.raises(SceneError, match=r"stop\[1\].at: expected a point with shapes: \"body.tip\""):
        scene_in(tmp_path, body={"file": "board.csv"}, tip="top")

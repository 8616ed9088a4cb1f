"""Scenes that leave numbers to their sweep or start on a stop, and the runs on which branches begin."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.command_line import in_this_process as ran

import vibroimpact as vi
from vibroimpact.analysis.orbits import OrbitError
from vibroimpact.fmus.errors import SceneError
from vibroimpact.orchestrator.scene.changes import with_resting_start

PARAMETER = "forcing.angular_frequency"


def in_this_process(arguments: list[str]) -> tuple[int, str, str]:
    done = ran(*arguments)
    return done.returncode, done.stdout, done.stderr


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
    found = [
        vi.follow(scene, PARAMETER, 0.95, 1.0, impacts=1, step=0.2, doublings=0) for scene in (left, given)
    ]
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
        match=r"got none\. \d+ of 50 runs over the range end on P\(2,1\): impacts=2, periods=1\.",
    ):
        vi.follow(scene, PARAMETER, 1.0, 2.0, impacts=1)


def test_the_orbits_on_which_runs_end_are_followed_unless_others_are_wanted(tmp_path: Path) -> None:
    file = tmp_path / "two_stops.toml"
    file.write_text(vi.Scene.from_dict(swept_scene()).to_toml(), encoding="utf-8")
    ends = ["--from", "1.0", "--to", "1.2", "--step", "0.1", "--doublings", "0", "--grazes", "0"]
    command = ["follow", str(file), "--parameter", PARAMETER, *ends]
    code, out, err = in_this_process(command)
    assert (code, err) == (0, "")
    assert "1  P(2,1), 1 at stop 1, 1 at stop 2" in out
    assert "50 runs over the range, up and down, end on P(2,1) (50)." in out
    assert "Index sums over 1 and 2 periods are 1 in 1 of 1 range between special points." in out
    code, _, err = in_this_process([*command, "--impacts", "1"])
    assert code == 2
    assert err.endswith("50 of 50 runs over the range end on P(2,1): --impacts 2 --periods 1.\n")


def test_a_range_without_orbits_says_how_many_starts_were_tried_and_which_values_the_scene_refuses() -> None:
    scene = vi.Scene.from_dict(swept_scene(angular_frequency=1.1)).with_values({"forcing.amplitude": 0.01})
    with pytest.raises(
        OrbitError, match=r"got none near 2 trains of impacts at each\. Runs .* no impacts \(50\)"
    ):
        vi.follow(scene, PARAMETER, 1.0, 2.0, impacts=3, starts=2)
    with pytest.raises(
        OrbitError, match=r"The scene refuses 12 values of these: .*above the lower stop\[2\]"
    ):
        vi.follow(scene.with_values({"forcing.amplitude": 1e-4}), "stop[1].position", -2.0, 2.1)
    with pytest.raises(SceneError, match=r"^.*above the lower stop\[2\].*$"):
        vi.follow(scene, "stop[1].position", -3.0, -2.0)

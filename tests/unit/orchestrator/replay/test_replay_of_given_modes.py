"""Replays and fits of given modes: equal to those of the beam that has the same mode."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.replay_scenes import BOARD, Floats, channel, pulse, written

from vibroimpact.fmus.core import beam_modes
from vibroimpact.fmus.errors import SceneError, UsageError
from vibroimpact.orchestrator.replay import fit_replay, opened_replays
from vibroimpact.orchestrator.replay.fit import fit_keys
from vibroimpact.orchestrator.scene import Scene

TIME: Floats = np.asarray(2e-5 * np.arange(1500), dtype=np.float64)
MODE = beam_modes("clamped_clamped", 1)
GIVEN = f"""
[[body]]
name = "board"
kind = "modes"
frequencies = [800.0]
damping_ratio = 0.01
shapes = {{ middle = [{float(MODE.shapes([0.5])[0, 0])!r}] }}
participation = [{float(MODE.participation[0])!r}]
[sensor]
gain = 1.0
[replay]
drive = "base_acceleration"
from = "base"
compare = [{{ simulated = "sensor.acceleration", measured = "board" }}]
drive_offset = 0.0
"""


def scene(text: str = GIVEN) -> Scene:
    return Scene.from_text(text, "board.toml")


def recording(folder: Path, name: str, drive: str, values: Floats | None = None) -> Path:
    """Write a recording of a pulse, with a reading on the same clock."""
    unit = {"base": "m s-2", "force": "N"}[drive]
    read = pulse(TIME) if values is None else values
    return written(
        folder / name,
        channel(drive, TIME, pulse(TIME), unit, trigger="one"),
        channel("board", TIME, read, trigger="one"),
    )


def reading(scene: Scene, path: Path, execution: str = "auto", **values: float) -> Floats:
    numbers = {key.replace("__", "."): value for key, value in values.items()}
    with opened_replays(scene, [path], execution) as (replayer,):
        return replayer.simulate(numbers).readings[0]


def test_a_base_drives_a_given_mode_as_the_beam_with_this_mode(tmp_path: Path) -> None:
    path = recording(tmp_path, "base.nc", "base")
    beam = Scene.from_text(BOARD + "drive_offset = 0.0", "board.toml")
    expected = reading(beam, path, sensor__gain=1.0)
    found = reading(scene(), path)
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())
    with pytest.raises(UsageError, match="expected a fused replay of several bodies or given modes"):
        reading(scene(), path, "coupled")


def test_frequencies_and_damping_ratios_of_given_modes_are_fitted(tmp_path: Path) -> None:
    truth = {"body[1].frequencies[1]": 823.0, "body[1].damping_ratio": 0.017, "sensor.gain": 1.1}
    path = recording(tmp_path, "base.nc", "base")
    with opened_replays(scene(), [path]) as (replayer,):
        values = replayer.simulate(truth).readings[0]
    noise = np.random.default_rng(5).normal(0.0, 1e-3 * np.abs(values).max(), len(TIME))
    measured = recording(tmp_path, "measured.nc", "base", values + noise)
    with opened_replays(scene(), [measured]) as replayers:
        fit = fit_replay(replayers, fit_keys(scene(), ", ".join(truth)))
    np.testing.assert_array_less(np.abs(fit.values - list(truth.values())), 4.0 * fit.standard_error)
    np.testing.assert_array_less(fit.standard_error, [0.1, 1e-4, 0.01])
    assert scene().with_values(fit.numbers).value("body[1].frequencies[1]") == fit.values[0]


def test_a_force_drives_the_point_that_it_names(tmp_path: Path) -> None:
    text = GIVEN.replace('drive = "base_acceleration"', 'drive = "force"\nat = "board.edge"')
    text = text.replace('from = "base"', 'from = "force"').replace("shapes = { ", "shapes = { edge = [0.5], ")
    text = text.replace("sensor.acceleration", "displacement[board.middle]").replace(
        "[sensor]\ngain = 1.0\n", ""
    )
    observed = '[record]\nobserved = ["board.middle"]\n'
    path = written(
        tmp_path / "force.nc",
        channel("force", TIME, pulse(TIME), "N", trigger="one"),
        channel("board", TIME, pulse(TIME), "m", trigger="one"),
    )
    edge, middle = (
        reading(scene(text.replace('"board.edge"', at) + observed), path)
        for at in ('"board.edge"', '"board.middle"')
    )
    share = float(MODE.shapes([0.5])[0, 0]) / 0.5
    np.testing.assert_allclose(middle, share * edge, rtol=1e-9, atol=1e-12 * np.abs(middle).max())
    assert np.abs(edge).max() > 0.0


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "gain = 1.0",
            "gain = 1.0\nlocation = 0.5",
            "sensor.location: expected location beside one body alone",
        ),
        (
            '"base_acceleration"',
            '"force"',
            "replay.at: expected the point where the force acts, got nothing.",
        ),
        (
            'from = "base"',
            'from = "base"\nat = "board.middle"',
            'replay.at: expected drive = "force" beside it',
        ),
        (
            '"sensor.acceleration"',
            '"sensor.displacement[board.top]"',
            "replay.compare[1].simulated: expected a variable",
        ),
        (
            "participation",
            "displacement_start",
            "body[1].participation: expected it beside base_acceleration",
        ),
    ],
)
def test_mistakes_of_a_replay_of_given_modes_have_one_line(old: str, new: str, said: str) -> None:
    with pytest.raises(SceneError) as caught:
        scene(GIVEN.replace(old, new))
    assert said in str(caught.value).splitlines()[0]


def test_a_replayed_force_needs_a_point_that_is_there() -> None:
    text = GIVEN.replace('drive = "base_acceleration"', 'drive = "force"\nat = "board.top"')
    with pytest.raises(SceneError, match=r'replay\.at: expected a point with shapes: "board\.middle"'):
        scene(text)

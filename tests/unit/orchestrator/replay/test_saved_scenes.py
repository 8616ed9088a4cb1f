"""Scenes that a fit saves: they run by themselves, and no file is overwritten by accident."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support.replay_scenes import BOARD, channel, pulse, written

from vibroimpact.orchestrator.commands.cli import main
from vibroimpact.orchestrator.replay import opened_replays
from vibroimpact.orchestrator.scene import load_scene, parse_scene

TIME = 2e-5 * np.arange(900)
FIT = "sensor.gain,sensor.offset"
#: The gain as in the scene, with a comment of the user, and the recordings of the scene.
SCENE = BOARD.replace("gain = 0.9", "gain = 0.9  # by the maker") + 'recordings = ["one.nc"]\n'


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A scene in a folder of its own, and a recording of a board whose sensor reads 1.3 times as much, plus 5."""
    home = tmp_path / "home"
    home.mkdir()
    (home / "board.toml").write_text(SCENE)
    base = channel("base", TIME, pulse(TIME), trigger="one")
    written(home / "one.nc", base, channel("board", TIME, pulse(TIME), trigger="one"))
    with opened_replays(parse_scene(BOARD, "board.toml"), [home / "one.nc"]) as (replayer,):
        reading = 1.3 * replayer.simulate().readings[0] + 5.0
    noise = np.random.default_rng(3).normal(0.0, 1.0, len(TIME))
    written(home / "one.nc", base, channel("board", TIME, reading + noise, trigger="one"))
    return home


def replay(*arguments: str | Path) -> int:
    with pytest.raises(SystemExit) as left:
        main(["replay", *map(str, arguments)])
    return int(left.value.code or 0)


def test_a_saved_scene_gives_the_motion_of_the_fit_from_any_folder_also_when_saved_again(
    folder: Path,
) -> None:
    other = folder.parent / "other"
    other.mkdir()
    saved, again = other / "fitted.toml", folder / "again.toml"
    assert replay(folder / "board.toml", "-o", folder / "fit.nc", "--fit", FIT, "--save-scene", saved) == 0
    assert replay(saved, "-o", other / "alone.nc") == 0
    assert replay(saved, "-o", other / "second.nc", "--fit", FIT, "--save-scene", again) == 0
    with xr.open_dataset(folder / "fit.nc") as fit, xr.open_dataset(other / "alone.nc") as alone:
        size = float(abs(fit.board_simulated).max())
        assert float(abs(alone.board_simulated - fit.board_simulated).max()) <= 1e-12 * size
        assert alone.variance_accounted_for.item() == pytest.approx(
            fit.variance_accounted_for.item(), rel=1e-12
        )
        found = dict(zip(fit.parameter.values.tolist(), fit.fitted_value.values.tolist(), strict=True))
    assert found["sensor.gain"] == pytest.approx(1.17, rel=1e-3)
    assert {key: load_scene(saved).value(key) for key in found} == found
    text = again.read_text()
    assert text.count("# Fitted by vibroimpact replay to") == 1
    assert text.startswith(
        '# Fitted by vibroimpact replay to "one.nc"; +- is the standard error:\n# sensor.gain = 1.17'
    )
    assert "# by the maker" in text
    assert load_scene(again).replay is not None


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("--save-scene", "new.toml"), "--save-scene: expected --fit beside it, got nothing to save."),
        (
            ("--fit", FIT, "--save-scene", "there.toml"),
            "there.toml: expected a new file, got one that is there.",
        ),
        (
            ("--fit", FIT, "--save-scene", "board.toml"),
            "board.toml: expected a new file, got one that is read.",
        ),
        (("--fit", FIT, "--save-scene", "new.txt"), "new.txt: expected a name ending in .toml, got '.txt'."),
        (("--fit", FIT, "--save-scene", "no/new.toml"), "got no folder of that name"),
    ],
)
def test_a_scene_that_cannot_be_saved_is_refused_before_anything_is_computed(
    folder: Path, arguments: tuple[str, ...], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "there.toml").write_text("mine")
    given = [str(folder / text) if "." in text and "," not in text else text for text in arguments]
    assert replay(folder / "board.toml", "-o", folder / "fit.nc", *given) == 2
    assert told in capsys.readouterr().err
    assert (folder / "there.toml").read_text() == "mine"
    assert (folder / "board.toml").read_text() == SCENE
    assert not (folder / "fit.nc").exists()


def test_a_saved_scene_replaces_one_that_is_there_with_force_only(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    saved = folder / "fitted.toml"
    saved.write_text("mine")
    command = (folder / "board.toml", "-o", folder / "fit.nc", "--fit", "sensor.gain", "--save-scene", saved)
    assert replay(*command) == 2
    assert replay(*command, "--force") == 0
    assert f"Scene with the numbers found written to {saved}." in capsys.readouterr().out
    assert load_scene(saved).value("sensor.gain") == pytest.approx(1.17, rel=1e-2)

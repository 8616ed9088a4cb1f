"""The verdict on a replay as the command prints it: at the head, with and without a fit, never too strong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support.replay_scenes import BOARD, channel, pulse, written

from vibroimpact.orchestrator.commands.cli import main
from vibroimpact.orchestrator.replay import opened_replays
from vibroimpact.orchestrator.replay.replayer import is_linear
from vibroimpact.orchestrator.scene import parse_scene

TIME = 2e-5 * np.arange(900)
STOP = "[[stop]]\nposition = {position}\nlocation = 0.5\nrestitution = 0.5\n"


@pytest.fixture
def board(tmp_path: Path) -> Path:
    """A recording of the board of the scene, with noise."""
    base = channel("base", TIME, pulse(TIME), trigger="one")
    path = written(tmp_path / "one.nc", base, channel("board", TIME, pulse(TIME), trigger="one"))
    with opened_replays(parse_scene(BOARD, "board.toml"), [path]) as (replayer,):
        reading = replayer.simulate().readings[0]
    noise = np.random.default_rng(3).normal(0.0, 1.0, len(TIME))
    return written(path, base, channel("board", TIME, reading + noise, trigger="one"))


def replayed(
    scene: str, recording: Path, capsys: pytest.CaptureFixture[str], *more: str
) -> tuple[str, xr.Dataset]:
    """Replay a scene; return the printed text and the dataset."""
    path, output = recording.with_name("scene.toml"), recording.with_name("out.nc")
    path.write_text(scene)
    with pytest.raises(SystemExit) as left:
        main(["replay", str(path), str(recording), "-o", str(output), "--force", *more])
    assert left.value.code in (0, None)
    with xr.open_dataset(output) as dataset:
        return capsys.readouterr().out, dataset.load()


def test_a_replay_without_a_fit_begins_with_its_verdict(
    board: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said, dataset = replayed(BOARD, board, capsys)
    first = said.splitlines()[0]
    assert first.startswith(
        "This linear replay is to be trusted for events like these, over the whole record (12.98 ms"
    )
    assert "if its numbers do not come from this record: on one.nc it errs by" in first
    assert dataset.attrs["verdict"] == first
    assert dataset.attrs["trusted"] == 1
    assert dataset["held"].values.tolist() == ["over the whole record (12.98 ms)"]


def test_a_replay_that_gets_out_of_step_says_where(board: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said, dataset = replayed(BOARD.replace("frequency = 800.0", "frequency = 812.0"), board, capsys)
    first, second = said.splitlines()[:2]
    assert first.startswith("Do not trust this linear replay: on one.nc it errs by ")
    assert second.startswith("  also: on one.nc it errs by at most 25 % only to ")
    assert dataset.attrs["trusted"] == 0


def test_the_verdict_of_a_fit_comes_before_its_numbers_and_tables(
    board: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = board.with_name("two.nc")
    other.write_bytes(board.read_bytes())
    said, _ = replayed(BOARD, board, capsys, "--fit", "sensor.gain", "--score", str(other))
    places = [
        said.index(text) for text in ("This linear replay", "sensor.gain", "Simulated against measured")
    ]
    assert places == sorted(places)
    assert places[0] == 0


def test_a_replay_with_stops_is_not_called_linear(board: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said, dataset = replayed(BOARD + STOP.format(position=1.0), board, capsys)
    assert said.startswith("This replay is to be trusted for events like these, over the whole record")
    assert "linear" not in dataset.attrs["verdict"]


def test_linear_is_what_has_no_stops_and_does_not_follow_the_amplitude() -> None:
    slopes = [
        BOARD.replace("modes = 1", f"modes = 2\nfrequency_slope = {slope}")
        for slope in ("[0.0, 0.0]", "[0.0, -5.0]")
    ]
    texts = (BOARD, *slopes, BOARD + STOP.format(position=1.0))
    assert [is_linear(parse_scene(text, "board.toml")) for text in texts] == [True, True, False, False]
    followed = parse_scene(BOARD, "board.toml").at({"body.damping_reciprocal": 1e-6})
    assert not is_linear(followed)


def test_the_table_of_a_replay_may_be_written_in_any_way(
    board: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = BOARD[BOARD.index("[replay]") :]
    keys = ", ".join(line for line in table.splitlines()[1:] if line)
    said, _ = replayed(f"replay = {{ {keys} }}\n" + BOARD.replace(table, ""), board, capsys)
    assert said.startswith("This linear replay is to be trusted")


def test_a_recording_that_is_fitted_earns_no_trust_by_being_scored(
    board: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene, output = board.with_name("board.toml"), board.with_name("x.nc")
    scene.write_text(BOARD)
    again = board.parent / "." / ".." / board.parent.name / board.name
    with pytest.raises(SystemExit) as left:
        main(
            [
                "replay",
                str(scene),
                str(board),
                "-o",
                str(output),
                "--fit",
                "sensor.gain",
                "--score",
                str(again),
            ]
        )
    assert left.value.code == 2
    assert "--score: expected a recording that is not fitted, got " in capsys.readouterr().err
    assert not output.exists()

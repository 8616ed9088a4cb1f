"""`vibroimpact import` on the command line, and the settings files it reads."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from vibroimpact.analysis.recording import open_recording
from vibroimpact.fmus.errors import UsageError
from vibroimpact.hardware.recordings import read_settings
from vibroimpact.hardware.recordings.settings import checked
from vibroimpact.orchestrator.commands import cli


def command(*arguments: str | Path) -> int:
    with pytest.raises(SystemExit) as left:
        cli.main(["import", *map(str, arguments)])
    code = left.value.code
    assert isinstance(code, int)
    return code


@pytest.fixture
def pair(tmp_path: Path) -> tuple[Path, Path]:
    """Two files of one test: the base, clipped at 3, and the board, with an overrange."""
    time = np.arange(400) * 1e-3
    ring = np.round(5.0 * np.exp(-5.0 * time) * np.sin(200.0 * time), 4)
    base, board = tmp_path / "base.txt", tmp_path / "board.txt"
    base.write_text("".join(f"{t:.3f} {min(a, 3.0)}\n" for t, a in zip(time, ring, strict=True)))
    rows = [
        f"{t:.3f} {'OVRNG' if k in (7, 8) else a}\n" for k, (t, a) in enumerate(zip(time, ring, strict=True))
    ]
    board.write_text("".join(rows))
    return base, board


def test_two_files_become_one_recording_with_two_triggers_and_a_table_tells_what_is_odd(
    pair: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output, figure = tmp_path / "run.nc", tmp_path / "run.png"
    names = ["--name", "base", "--name", "board", "--unit", "g"]
    assert command(*pair, *names, "-o", output, "--figure", figure) == 0
    told = capsys.readouterr().out
    recording = open_recording(output)
    assert list(recording.channels) == ["base", "board"]
    base, board = recording.channels["base"], recording.channels["board"]
    assert (base.axis.trigger, board.axis.trigger) == ("base.txt", "board.txt")
    assert base.unit == "9.80665 m s-2"
    clipped = int((base.quality & 1 != 0).sum())
    assert f"{clipped} samples are clipped, at 3 g" in told
    assert "2 samples are marked as overrange" in told
    assert "2 triggers: the lag between their time axes is not known" in told
    assert figure.read_bytes().startswith(b"\x89PNG")
    assert recording.attrs["source_file"] == "base.txt, board.txt"
    assert len(recording.attrs["source_sha256"].split(", ")) == 2
    assert str(tmp_path) not in "".join(map(str, recording.attrs.values())).replace(str(output), "")


def test_the_table_shows_units_as_the_file_gives_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "bench.csv"
    path.write_text(
        "t [s],deflection [mm],force [mN]\n" + "".join(f"{k / 10},{k % 7},{k % 5}\n" for k in range(40))
    )
    assert command(path, "-o", tmp_path / "bench.nc") == 0
    told = capsys.readouterr().out
    assert " mm " in told
    assert " mN " in told
    assert "0.001" not in told


def test_settings_in_a_file_beside_the_recording_do_the_same_as_options(
    pair: tuple[Path, Path], tmp_path: Path
) -> None:
    base = pair[0]
    base.with_name("base.txt.toml").write_text(
        'name = "base"\nunit = "g"\nscale = -2.0\nrate = 500\nstart = 1.5\n'
    )
    assert command(base, "-o", tmp_path / "file.nc") == 0
    base.with_name("base.txt.toml").unlink()
    options = ["--name", "base", "--unit", "g", "--scale", "-2", "--rate", "500", "--start", "1.5"]
    assert command(base, *options, "-o", tmp_path / "options.nc") == 0
    one, other = (open_recording(tmp_path / name) for name in ("file.nc", "options.nc"))
    np.testing.assert_array_equal(one.channels["base"].values, other.channels["base"].values)
    np.testing.assert_array_equal(one.channels["base"].time, other.channels["base"].time)
    assert one.channels["base"].time[0] == 1.5
    assert json.loads(one.attrs["import_settings"]) == json.loads(other.attrs["import_settings"])


def test_options_come_before_the_settings_file(pair: tuple[Path, Path], tmp_path: Path) -> None:
    mine = tmp_path / "mine.toml"
    mine.write_text('rate = 500.0\nname = ["one"]\n')
    assert command(pair[0], "--settings", mine, "--rate", "250", "-o", tmp_path / "x.nc") == 0
    channel = open_recording(tmp_path / "x.nc").channels["one"]
    assert channel.axis.rate == pytest.approx(250.0)


def test_columns_and_the_column_of_instants_can_be_chosen(tmp_path: Path) -> None:
    path = tmp_path / "many.csv"
    path.write_text("a,clock,b,c\n" + "".join(f"{k},{k * 0.5},{-k},{k % 3}\n" for k in range(30)))
    assert command(path, "--time-column", "clock", "--columns", "c,1", "-o", tmp_path / "x.nc") == 0
    recording = open_recording(tmp_path / "x.nc")
    assert list(recording.channels) == ["c", "a"]
    assert recording.channels["a"].axis.interval == 0.5
    assert command(path, "--time-column", "none", "--rate", "10", "-o", tmp_path / "x.nc") == 0
    assert list(open_recording(tmp_path / "x.nc").channels) == ["a", "clock", "b", "c"]


def test_events_window_and_masked_spans_reach_the_event_train(tmp_path: Path) -> None:
    path = tmp_path / "beats.txt"
    beats = np.cumsum(np.random.default_rng(3).uniform(300.0, 600.0, 50))
    path.write_text("beats (ms)\n" + "\n".join(map(str, beats)))
    options = ["--events", "--window", "0:60", "--masked", "5:6", "--masked", "7:7.5"]
    assert command(path, *options, "-o", tmp_path / "x.nc") == 0
    train = open_recording(tmp_path / "x.nc").events["beats"]
    np.testing.assert_allclose(train.times, beats / 1000.0, rtol=1e-12)
    assert train.window == (0.0, 60.0)
    assert train.attrs["masked"].tolist() == [5.0, 6.0, 7.0, 7.5]


def test_masked_spans_of_a_channel_are_missing(pair: tuple[Path, Path], tmp_path: Path) -> None:
    assert command(pair[0], "--masked", "0.1:0.2", "-o", tmp_path / "x.nc") == 0
    channel = next(iter(open_recording(tmp_path / "x.nc").channels.values()))
    hidden = (channel.time >= 0.1) & (channel.time <= 0.2)
    assert np.isnan(channel.values[hidden]).all()
    assert np.isfinite(channel.values[~hidden]).all()


def test_all_problems_of_a_settings_file_are_told_at_once(tmp_path: Path) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(
        'unitt = "g"\nrate = -1\nunit = ["blips"]\nwindow = [3, 1]\nscale = 0\nmasked = [[1, 2], [4, 3]]\n'
    )
    with pytest.raises(UsageError) as caught:
        read_settings(path)
    lines = str(caught.value).splitlines()
    assert len(lines) == 6
    assert all(line.startswith(f"{path}: ") and "expected" in line and "got" in line for line in lines)
    assert "Did you mean unit?" in str(caught.value)


@pytest.mark.parametrize("text", ["rate = ", "rate = 1e", "\xff", "a = [[[[", 'name = "x"\nname = "y"'])
def test_a_settings_file_that_is_no_toml_is_one_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "bad.toml"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(UsageError) as caught:
        read_settings(path)
    assert len(str(caught.value).splitlines()) == 1


def test_numbers_in_settings_are_numbers(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="rate: expected samples per second > 0"):
        checked({"rate": "fast"}, "command line")
    with pytest.raises(UsageError, match=r"offset\[2\]: expected a finite number"):
        checked({"offset": [1.0, float("nan")]}, "command line")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["missing.txt"], "expected a file to read"),
        (["."], "expected a regular file"),
        (["base.txt", "--rate", "0"], "command line: rate: expected samples per second"),
        (["base.txt", "--window", "later"], "--window: expected START:END"),
        (["base.txt", "--unit", "blips"], "command line: unit"),
        (["base.txt", "--columns", "nine"], "columns: expected a heading or a number from 1 to 2"),
        (["base.txt", "--time-column", "7"], "time_column: expected a heading or a number from 1 to 2"),
        (["base.txt", "--name", "a", "--name", "b"], "name: expected at most 1"),
        (["base.txt", "--delimiter", "dot"], "delimiter: expected tab, comma"),
        (["base.txt", "--settings", "none.toml"], "none.toml: expected a settings file"),
        (["base.txt", "--figure", "base.gif"], "expected a name ending in .png"),
    ],
)
def test_misuse_is_one_clear_error_with_exit_code_2_and_no_file(
    pair: tuple[Path, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    said: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    before = set(tmp_path.iterdir())
    assert command(*arguments, "-o", "x.nc") == 2
    streams = capsys.readouterr()
    assert said in streams.err
    assert len(streams.err.splitlines()) == 1
    assert not streams.out
    assert set(tmp_path.iterdir()) == before


def test_the_file_that_is_read_is_never_written_over(
    pair: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    content = pair[0].read_bytes()
    assert command(pair[0], "-o", pair[0]) == 2
    assert "expected a new file" in capsys.readouterr().err
    assert pair[0].read_bytes() == content


def test_an_output_that_cannot_be_written_is_told(
    pair: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    assert command(pair[0], "-o", pair[0].parent / "nowhere" / "x.nc") == 2
    assert "expected a place where a file can be written" in capsys.readouterr().err

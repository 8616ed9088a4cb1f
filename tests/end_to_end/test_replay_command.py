"""`vibroimpact replay` as a user calls it, on a recording made by the test itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support.command_line import in_this_process
from support.replay_scenes import BOARD, channel, pulse, written

from vibroimpact.analysis import open_dataset
from vibroimpact.orchestrator.replay import opened_replays
from vibroimpact.orchestrator.scene import parse_scene

TIME = 2e-5 * np.arange(900)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a scene and two recordings of a board that rings at 812 Hz: pulses of two sizes."""
    home = tmp_path_factory.mktemp("replay")
    (home / "board.toml").write_text(BOARD)
    for name, size in (("one", 4000.0), ("two", 2500.0)):
        base = pulse(TIME, size)
        dummy = written(home / "drive.nc", channel("base", TIME, base), channel("board", TIME, base))
        with opened_replays(parse_scene(BOARD, "board.toml"), [dummy]) as (replayer,):
            reading = replayer.simulate({"body.frequency": 812.0}).readings[0]
        noise = np.random.default_rng(len(name)).normal(0.0, 1.0, len(TIME))
        written(
            home / f"{name}.nc",
            channel("base", TIME, base, trigger="one"),
            channel("board", TIME, reading + noise, trigger="one"),
        )
    return home


def test_replay_fits_scores_draws_and_gives_its_verdict(folder: Path) -> None:
    done = in_this_process(
        *("replay", folder / "board.toml", folder / "one.nc", "-o", folder / "fit.nc"),
        *(
            "--figure",
            folder / "fit.png",
            "--fit",
            "body.frequency,sensor.gain",
            "--score",
            folder / "two.nc",
        ),
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(
        "This linear replay is to be trusted for events like these, over the whole record"
    )
    assert ": on two.nc, which it was not fitted on, it errs by" in done.stdout.splitlines()[0]
    with xr.open_dataset(folder / "fit.nc") as found:
        assert found.fitted_value.values == pytest.approx([812.0, 0.9], rel=1e-3)
        assert found.use.values.tolist() == ["fitted", "scored"]
        assert (found.variance_accounted_for.values > 99.9).all()
    assert (folder / "fit.png").read_bytes().startswith(b"\x89PNG")
    drawn = in_this_process("plot", folder / "fit.nc", "-o", folder / "again.png")
    assert drawn.returncode == 0, drawn.stderr


def test_a_campaign_of_replays_runs_over_recordings_and_the_grid_and_resumes(
    folder: Path, cluster: str
) -> None:
    scene = folder / "grid.toml"
    scene.write_text(BOARD + '[sweep]\n"body.frequency" = { values = [800.0, 812.0, 824.0] }\n')
    command = (
        "replay",
        scene,
        folder / "one.nc",
        folder / "two.nc",
        "-o",
        folder / "campaign",
        "--scheduler",
        cluster,
    )
    done = in_this_process(*command)
    assert done.returncode == 0, done.stderr
    with open_dataset(folder / "campaign") as found:
        scores = found.variance_accounted_for.sel(compared="beam.sensor.acceleration ~ board")
        best = scores.idxmax("frequency")
        assert best.sel(recording=1).item() == best.sel(recording=2).item() == 812.0
        assert scores.sizes == {"frequency": 3, "recording": 2}
        assert (scores.sel(frequency=812.0) > 99.9).all()
    again = in_this_process(*command)
    assert "Nothing to do: all 6 points" in again.stdout


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("one.nc",), "--output: expected a dataset"),
        (("-o", "x.nc"), "expected a recording to replay, got none"),
        (("absent.nc", "-o", "x.nc"), "absent.nc: expected a dataset file, got no such file"),
        (("one.nc", "-o", "x.nc", "--fit", "body.mas"), "scene key: expected a numeric key"),
        (("one.nc", "-o", "x.nc", "--score", "two.nc"), "--score: expected --fit beside it"),
        (("one.nc", "-o", "folder", "--fit", "sensor.gain"), "Campaigns replay; they do not fit"),
        (("one.nc", "-o", "no/such/x.nc"), "expected a place where a file can be written"),
        (("one.nc", "-o", "x.nc", "--fit", ""), "--fit: expected keys such as"),
        (("one.nc", "-o", "X.NC"), "expected a dataset NAME.nc or the folder of a campaign"),
    ],
)
def test_misuse_is_one_line_exit_code_2_and_no_file(
    folder: Path, arguments: tuple[str, ...], expected: str
) -> None:
    given = [folder / text if text.endswith(".nc") else text for text in arguments]
    done = in_this_process("replay", folder / "board.toml", *given)
    assert done.returncode == 2
    assert expected in done.stderr
    assert "Traceback" not in done.stderr
    assert not (folder / "x.nc").exists()


def test_run_of_a_replay_scene_needs_recordings_in_it(folder: Path) -> None:
    done = in_this_process("run", folder / "board.toml", "-o", folder / "x.nc")
    assert done.returncode == 2
    assert "replay.recordings: expected a recording, got none" in done.stderr

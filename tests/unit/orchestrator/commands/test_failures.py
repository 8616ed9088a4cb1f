"""Failed points are listed with their values and messages; a single failed run prints its message once, exit code
1."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.command_line import in_this_process
from support.dataset_examples import failed, record

from vibroimpact.analysis import open_dataset
from vibroimpact.analysis.dataset import Direction, RunRecord, build_dataset, write_dataset
from vibroimpact.orchestrator.commands.failures import MOST_LISTED, failure_lines

TOO_LARGE = """
[scene]
units = "nondimensional"
[body]
mass = 1.0
stiffness = 1.0
[forcing]
amplitude = 1e300
angular_frequency = 0.8
[[stop]]
position = 0.0
restitution = 0.7
[record]
transient_periods = 2
recorded_periods = 3
"""


def lines_of(folder: Path, runs: list[RunRecord]) -> list[str]:
    positions = {"stop_position": np.arange(len(runs), dtype=np.float64)}
    directions = [Direction.independent] * len(runs)
    names = ("displacement", "velocity")
    dataset = build_dataset(
        runs,
        coordinates=positions,
        direction=directions,
        run_index=np.arange(len(runs)),
        sample_variables=names,
        unit_of={"stop_position": "m"},
    )
    write_dataset(dataset, folder / "runs.nc")
    with open_dataset(folder / "runs.nc") as opened:
        return list(failure_lines(opened))


def test_a_single_failed_run_says_its_message_once_and_exits_1(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(TOO_LARGE)
    done = in_this_process("run", tmp_path / "scene.toml", "-o", tmp_path / "run.nc")
    assert done.returncode == 1
    assert done.stderr.count("expected finite numbers") == 1
    assert done.stderr.count("body:") == 1
    assert done.stderr.count("fmi3DoStep") == 1
    assert (tmp_path / "run.nc").exists()


def test_failed_points_of_a_sweep_are_listed_and_the_others_are_kept(tmp_path: Path) -> None:
    sweep = '[sweep]\n"forcing.amplitude" = { values = [1.0, 1e300] }\n'
    (tmp_path / "scene.toml").write_text(TOO_LARGE + sweep)
    done = in_this_process("run", tmp_path / "scene.toml", "-o", tmp_path / "run.nc")
    assert done.returncode == 0
    assert "1 point ended with the outcome error:\n  amplitude = 1e+300: body:" in done.stderr


@pytest.mark.parametrize("count", [1, MOST_LISTED, MOST_LISTED + 3])
def test_a_list_of_failed_points_is_bounded(tmp_path: Path, count: int) -> None:
    runs = [record(1.0), *(failed(f"it broke\nat step {k}") for k in range(count))]
    lines = lines_of(tmp_path, runs)
    assert lines[0].startswith(f"{count} point")
    assert lines[1] == "  stop_position = 1.0: it broke at step 0"
    assert len(lines) == 1 + min(count, MOST_LISTED) + (count > MOST_LISTED)
    assert count <= MOST_LISTED or lines[-1].startswith("  3 more")


def test_nothing_is_said_where_nothing_failed(tmp_path: Path) -> None:
    assert lines_of(tmp_path, [record(1.0), record(2.0)]) == []

"""What all figures share: their style, their size, their title."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import matplotlib
from dataset_examples import up_down

from vibroimpact.analysis import figures, open_dataset, write_dataset

DRAWING = """
from vibroimpact.analysis import figures, open_dataset
figures.save(figures.draw(open_dataset("runs.nc")), "figure.png")
"""


def test_a_matplotlibrc_of_the_current_folder_is_not_read(tmp_path: Path) -> None:
    # what matplotlib itself cannot import with
    (tmp_path / "matplotlibrc").write_bytes(b"lines.linewidth: 9\nno.such: 1\n\xff\xfe\x00")
    write_dataset(up_down(), tmp_path / "runs.nc")
    command = [sys.executable, "-W", "error", "-c", DRAWING]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    figures.save(figures.draw(open_dataset(tmp_path / "runs.nc")), tmp_path / "here.png")
    assert (tmp_path / "figure.png").read_bytes() == (tmp_path / "here.png").read_bytes()


def test_what_a_user_has_set_for_his_own_figures_changes_none_of_ours(tmp_path: Path) -> None:
    write_dataset(up_down(), tmp_path / "runs.nc")
    dataset = open_dataset(tmp_path / "runs.nc")
    figures.save(figures.draw(dataset), tmp_path / "plain.png")
    with matplotlib.rc_context({"axes.facecolor": "pink", "axes.grid": True, "savefig.facecolor": "red"}):
        figures.save(figures.draw(dataset), tmp_path / "set.png")
        assert matplotlib.rcParams["axes.grid"] is True
    assert (tmp_path / "set.png").read_bytes() == (tmp_path / "plain.png").read_bytes()

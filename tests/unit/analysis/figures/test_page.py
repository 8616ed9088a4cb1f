"""The common properties of all figures: their style, their size, their title."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import matplotlib
import pytest
import xarray as xr
from support.dataset_examples import up_down

from vibroimpact.analysis import figures, open_dataset, write_dataset
from vibroimpact.fmus.errors import UsageError

DRAWING = """
from vibroimpact.analysis import figures, open_dataset
figures.save(figures.draw(open_dataset("runs.nc")), "figure.png")
"""


def sweep(folder: Path) -> xr.Dataset:
    write_dataset(up_down(), folder / "runs.nc")
    return open_dataset(folder / "runs.nc")


def test_a_matplotlibrc_of_the_current_folder_is_not_read(tmp_path: Path) -> None:
    # a file with which matplotlib itself cannot be imported
    (tmp_path / "matplotlibrc").write_bytes(b"lines.linewidth: 9\nno.such: 1\n\xff\xfe\x00")
    dataset = sweep(tmp_path)
    command = [sys.executable, "-W", "error", "-c", DRAWING]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    figures.save(figures.draw(dataset), tmp_path / "here.png")
    assert (tmp_path / "figure.png").read_bytes() == (tmp_path / "here.png").read_bytes()


def test_what_a_user_has_set_for_his_own_figures_changes_none_of_ours(tmp_path: Path) -> None:
    dataset = sweep(tmp_path)
    figures.save(figures.draw(dataset), tmp_path / "plain.png")
    with matplotlib.rc_context({"axes.facecolor": "pink", "axes.grid": True, "savefig.facecolor": "red"}):
        figures.save(figures.draw(dataset), tmp_path / "set.png")
        assert matplotlib.rcParams["axes.grid"] is True
    assert (tmp_path / "set.png").read_bytes() == (tmp_path / "plain.png").read_bytes()


def test_a_figure_has_the_size_and_the_title_that_were_asked_for(tmp_path: Path) -> None:
    dataset = sweep(tmp_path)
    figure = figures.draw(dataset, title="Impact oscillator", width=120.0, height=90.0)
    assert figure.get_size_inches() * 25.4 == pytest.approx([120.0, 90.0])
    assert figure.get_suptitle() == "Impact oscillator"
    assert figures.draw(dataset, width=120.0).get_figheight() == figures.draw(dataset).get_figheight()
    assert figures.draw(dataset).get_suptitle() == ""


@pytest.mark.parametrize(
    ("size", "message"),
    [
        ({"width": 5.0}, "expected 20 to 1000 mm, got 5 x 105 mm"),
        ({"height": 0.0}, "expected 20 to 1000 mm, got 85 x 0 mm"),
        ({"width": float("nan")}, "expected 20 to 1000 mm, got nan x 105 mm"),
        ({"width": 22.0, "height": 21.0}, "expected room for 2 panels, got 22 x 21 mm"),
    ],
)
def test_a_size_without_room_is_refused(size: dict[str, float], message: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=message):
        figures.draw(sweep(tmp_path), **size)


def test_a_title_may_have_a_formula_and_one_that_cannot_be_set_is_refused(tmp_path: Path) -> None:
    dataset = sweep(tmp_path)
    assert figures.draw(dataset, title=r"$\zeta = .05$, 5 \$").axes
    with pytest.raises(UsageError, match="title: expected text, formulas of matplotlib between dollar signs"):
        figures.draw(dataset, title=r"$\nosuch$")

"""A measured sweep over a simulated one: each period a point, separate marks for up and down, marks for flags."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from numpy.typing import NDArray
from support.command_line import in_this_process

from vibroimpact.analysis import figures, open_dataset
from vibroimpact.analysis.dataset import Direction, Outcome, RunRecord, build_dataset, write_dataset
from vibroimpact.fmus.errors import DatasetError, UsageError

PLACES = np.array([18.0, 19.0, 20.0])
CLIPPED, DRIFT = 1, 4


def record(size: float) -> RunRecord:
    """Return a run of two periods: one of this range, and one a tenth larger."""
    periods = np.full((2, 5), np.nan)
    periods[:, 0], periods[:, 1] = [0.5 * size, 0.6 * size], [-0.5 * size, -0.5 * size]
    return RunRecord(Outcome.ok, "", periods)


def sweep(
    folder: Path, name: str, *, flags: list[int] | None = None, key: str = "frequency", factor: float = 1.0
) -> xr.Dataset:
    """Return a sweep up and down of ranges 1, 2, 3 and 30, 20, 10 mm."""
    places: NDArray[np.float64] = np.concatenate([PLACES, PLACES[::-1]]) * factor
    dataset = build_dataset(
        [record(1e-3 * size) for size in (1, 2, 3, 10, 20, 30)],
        coordinates={key: places},
        direction=[Direction.up] * 3 + [Direction.down] * 3,
        run_index=range(6),
        unit_of={"frequency": "Hz", "angular_frequency": "rad s-1", "stiffness": "N m-1"},
        omit=["strobe_displacement", "strobe_velocity", "impacts_per_period"],
        measured=None if flags is None else {"measurement_flags": np.array(flags)},
        attrs={"title": name},
    )
    write_dataset(dataset, folder / f"{name}.nc")
    return open_dataset(folder / f"{name}.nc")


def points(figure: figures.Figure, label: str) -> list[tuple[float, float]]:
    """Return the points of a line by its name in the legend."""
    (line,) = [line for line in figure.axes[0].lines if line.get_label() == label]
    pairs = zip(np.asarray(line.get_xdata()), np.asarray(line.get_ydata()), strict=True)
    return sorted((round(float(x), 9), round(float(y), 9)) for x, y in pairs)


def test_each_period_of_both_sweeps_is_a_point_and_the_measured_ones_lie_on_top(tmp_path: Path) -> None:
    measured, simulated = sweep(tmp_path, "m", flags=[0] * 6), sweep(tmp_path, "s")
    figure = figures.draw(measured, over=simulated)
    labels = [str(line.get_label()) for line in figure.axes[0].lines]
    assert labels == [
        "up sweep, simulated",
        "down sweep, simulated",
        "up sweep, measured",
        "down sweep, measured",
    ]
    assert points(figure, "up sweep, measured")[:2] == [(18.0, 0.001), (18.0, 0.0011)]
    assert points(figure, "down sweep, measured") == points(figure, "down sweep, simulated")
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == labels


def test_an_angular_frequency_is_drawn_as_the_frequency_that_it_is(tmp_path: Path) -> None:
    measured = sweep(tmp_path, "m", flags=[0] * 6)
    simulated = sweep(tmp_path, "s", key="angular_frequency", factor=2.0 * np.pi)
    figure = figures.draw(measured, over=simulated)
    assert points(figure, "up sweep, simulated") == points(figure, "up sweep, measured")
    turned = figures.draw(simulated, over=measured)
    assert points(turned, "up sweep, measured") == points(turned, "up sweep, simulated")


def test_a_clipped_step_has_a_mark_in_place_of_points_and_another_flag_a_ring(tmp_path: Path) -> None:
    measured = sweep(tmp_path, "m", flags=[0, CLIPPED, DRIFT, 0, CLIPPED | DRIFT, 0])
    figure = figures.draw(measured)
    assert {x for x, _ in points(figure, "up sweep")} == {18.0, 20.0}
    assert {x for x, _ in points(figure, "down sweep")} == {18.0, 20.0}
    assert [x for x, _ in points(figure, "clipped, not drawn")] == [19.0]
    assert points(figure, "flagged") == [(20.0, 0.00315)]


def test_two_sweeps_of_one_kind_are_told_apart_by_their_titles(tmp_path: Path) -> None:
    figure = figures.draw(sweep(tmp_path, "soft"), over=sweep(tmp_path, "hard"))
    assert [str(line.get_label()) for line in figure.axes[0].lines][::2] == [
        "up sweep, hard",
        "up sweep, soft",
    ]


def test_what_does_not_lie_below_a_sweep_is_refused(tmp_path: Path) -> None:
    measured = sweep(tmp_path, "m", flags=[0] * 6)
    with pytest.raises(DatasetError, match="over: expected a sweep of frequency, got one of stiffness"):
        figures.draw(measured, over=sweep(tmp_path, "k", key="stiffness"))
    with pytest.raises(DatasetError, match="expected one swept parameter, got 0"):
        figures.draw(measured, over=measured.isel(frequency=0, direction=0))
    with pytest.raises(UsageError, match="over: expected none for a dataset of runs drawn as run, got one"):
        figures.draw(measured, run=1, over=measured)


def test_the_command_draws_both_and_reads_both_before(tmp_path: Path) -> None:
    sweep(tmp_path, "m", flags=[0] * 6).close()
    sweep(tmp_path, "s").close()
    drawn = in_this_process("plot", tmp_path / "m.nc", "--over", tmp_path / "s.nc", "-o", tmp_path / "b.png")
    assert drawn.returncode == 0, drawn.stderr
    assert (tmp_path / "b.png").stat().st_size > 5000
    missing = in_this_process(
        "plot", tmp_path / "m.nc", "--over", tmp_path / "no.nc", "-o", tmp_path / "c.png"
    )
    assert missing.returncode != 0
    assert "no.nc" in missing.stderr
    assert not (tmp_path / "c.png").exists()

"""The dataset, the table and the figure of comparisons. References: the attributes of the comparisons."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from rich.console import Console
from support.replay_signals import FREQUENCY, HIT, INTERVAL, channel, clock, ring

from vibroimpact.analysis import figures
from vibroimpact.analysis.dataset.results import write_results
from vibroimpact.analysis.figures.measured.replay import draw_replay
from vibroimpact.analysis.recording import TimeAxis
from vibroimpact.analysis.replay import Comparison, compare, comparison_dataset, print_comparison
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.fmus.printing import with_error

TIME = clock()
MODEL = ring(TIME - HIT)


def board() -> Comparison:
    record = channel(0.3 - ring(TIME - HIT - 0.01), limit=0.95)
    return compare(
        TIME,
        0.98 * MODEL,
        record,
        most_lag=0.02,
        windows=[(0.0, 0.03), (0.0, 0.1)],
        peak_window=(0.02, 0.04),
        measured_events=np.array([0.05, 0.07]),
        simulated_events=np.array([0.04]),
        simulated_name="beam.sensor.acceleration",
    )


def tip() -> Comparison:
    axis = TimeAxis(2.0 * INTERVAL * np.arange(1500), 2.0 * INTERVAL, trigger="second")
    record = channel(ring(axis.time - HIT, 0.5 * FREQUENCY), name="tip", axis=axis)
    return compare(TIME, ring(TIME - HIT, 0.5 * FREQUENCY), record, lag=0.0, polarity=1)


def opened(comparisons: list[Comparison], folder: Path) -> xr.Dataset:
    write_results(comparison_dataset(comparisons), folder / "replay.nc", kind="replay")
    with xr.open_dataset(folder / "replay.nc") as dataset:
        return dataset.load()


def test_measured_and_simulated_are_on_the_clock_of_the_recording(tmp_path: Path) -> None:
    first, second = board(), tip()
    dataset = opened([first, second], tmp_path)
    assert dataset.attrs["results_kind"] == "replay"
    assert dataset["board_measured"].dims == ("time",)
    assert dataset["tip_simulated"].dims == ("time_2",)
    assert np.array_equal(dataset["time_2"].values, second.measured.time)
    residual = dataset["board_measured"] - dataset["board_simulated"]
    assert np.array_equal(residual.values, dataset["board_residual"].values, equal_nan=True)
    assert int(np.count_nonzero(dataset["board_quality"])) == first.counts["clipped"]
    assert dataset["board_measured"].attrs["offset_removed"] == first.offset


def test_scores_are_one_number_for_each_channel(tmp_path: Path) -> None:
    first, second = board(), tip()
    dataset = opened([first, second], tmp_path)
    assert dataset["comparison"].values.tolist() == ["board", "tip"]
    assert dataset["variance_accounted_for"].values.tolist() == [first.variance, second.variance]
    assert dataset["polarity"].values.tolist() == [-1.0, 1.0]
    assert dataset["lag"].values[0] == first.alignment.lag
    # two windows were requested for the board, none for the tip
    assert dataset["window_variance"].values[0].tolist() == first.window_variance.tolist()
    assert np.all(np.isnan(dataset["window_variance"].values[1]))
    assert dataset["board_event_missed"].values.tolist() == [0.07]
    assert "clipped" in dataset.attrs["remarks"]


def test_two_comparisons_with_one_channel_keep_their_names(tmp_path: Path) -> None:
    dataset = opened([board(), board()], tmp_path)
    assert dataset["comparison"].values.tolist() == ["board", "board_2"]
    assert "board_2_residual" in dataset


def test_table_says_score_lag_sign_and_what_was_left_out() -> None:
    text = io.StringIO()
    comparison = board()
    print_comparison(Console(file=text, width=120), [comparison])
    said = text.getvalue()
    for expected in (
        f"{comparison.variance:.2f} %",
        with_error(1e3 * comparison.alignment.lag, 1e3 * comparison.alignment.lag_error, "ms"),
        f"{comparison.counts['clipped']} clipped",
        "1 matched, 1 missed, 0 extra",
        "not scored",
    ):
        assert expected in said


def test_table_has_the_offset_in_the_unit_of_the_channel() -> None:
    text, comparison = io.StringIO(), board()
    in_g = replace(
        comparison, measured=replace(comparison.measured, unit="9.80665 m s-2"), offset=3.0 * 9.80665
    )
    print_comparison(Console(file=text, width=120), [in_g])
    (line,) = [line for line in text.getvalue().splitlines() if "offset removed" in line]
    assert line.split() == ["offset", "removed", "3", "g"]


def test_figure_shows_both_signals_their_residual_and_scores(tmp_path: Path) -> None:
    dataset = opened([board(), tip()], tmp_path)
    figure = draw_replay(dataset)
    labels = [line.get_label() for line in figure.axes[0].lines]
    assert {"measured", "simulated", "clipped"} <= set(labels)
    said = [text.get_text() for text in figure.axes[0].texts]
    assert any(f"VAF {float(dataset['variance_accounted_for'][0]):.2f} %" in text for text in said)
    figures.save(figure, tmp_path / "replay.png")
    assert (tmp_path / "replay.png").read_bytes().startswith(b"\x89PNG")


def test_figure_of_another_channel_is_chosen_by_name(tmp_path: Path) -> None:
    dataset = opened([board(), tip()], tmp_path)
    drawn = draw_replay(dataset, "tip").axes[0].lines[0].get_ydata()
    assert np.nanmax(np.abs(np.asarray(drawn, dtype=float))) == pytest.approx(
        float(np.abs(dataset["tip_measured"]).max())
    )
    with pytest.raises(DatasetError, match="expected one of board, tip"):
        draw_replay(dataset, "base")

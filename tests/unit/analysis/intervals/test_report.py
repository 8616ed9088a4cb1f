import io
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure
from numpy.typing import NDArray
from rich.console import Console

from vibroimpact.analysis import figures
from vibroimpact.analysis.dataset.results import write_results
from vibroimpact.analysis.figures.measured.intervals import draw_intervals
from vibroimpact.analysis.intervals import interval_report, print_intervals, seams
from vibroimpact.analysis.intervals.dimension import verdict
from vibroimpact.fmus.errors import EstimationError, UsageError

Floats = NDArray[np.float64]


def skipping_train() -> Floats:
    """Return a train of 1 s with jitter, about every twentieth spike missed, and some spurious spikes."""
    rng = np.random.default_rng(1)
    true = np.arange(500.0) + 0.01 * rng.normal(size=500)
    return np.sort(np.concatenate([true[rng.random(500) > 0.05], rng.uniform(0.0, 499.0, 10)]))


def printed(report: xr.Dataset) -> str:
    stream = io.StringIO()
    print_intervals(Console(file=stream, width=200), report)
    return stream.getvalue()


def panel_texts(figure: Figure) -> list[str]:
    return [text.get_text() for axis in figure.axes for text in axis.texts]


def test_the_report_is_a_results_file_and_comes_back_from_it(tmp_path: Path) -> None:
    report = interval_report(skipping_train(), forcing_period=1.0)
    write_results(report, tmp_path / "intervals.nc", kind="intervals")
    with xr.open_dataset(tmp_path / "intervals.nc") as back:
        assert float(back["rate"]) == float(report["rate"])
        assert back.attrs["cycle"] == report.attrs["cycle"]
        assert np.array_equal(back["slope_log"], report["slope_log"])


def test_the_same_seed_gives_the_same_surrogates_and_another_does_not() -> None:
    times = np.cumsum(np.random.default_rng(2).exponential(size=400))
    first, again, other = (interval_report(times, seed=seed) for seed in (1, 1, 2))
    assert first.identical(again)
    assert not np.array_equal(first["surrogate_slope_raw"], other["surrogate_slope_raw"])
    # results without a surrogate do not depend on the seed
    assert np.array_equal(first["slope_raw"], other["slope_raw"])


def test_no_slope_is_printed_without_its_surrogate_its_window_and_its_verdict() -> None:
    report = interval_report(np.cumsum(np.random.default_rng(3).exponential(size=400)))
    text = printed(report)
    assert "C from 0.001 to 0.1" in text
    assert "shuffled" in text
    assert "no saturation: noise-like" in text
    assert "no slope above about 5.2 can be told" in text
    assert np.all(np.isfinite(report["surrogate_slope_log"]))


def test_the_tables_say_what_was_missed_and_how_sure_that_is() -> None:
    text = printed(interval_report(skipping_train(), forcing_period=0.5))
    assert "missed spikes" in text
    assert "with 95 % confidence" in text
    assert "delay points, (I, I)" in text
    assert "Motion: P(1,2)" in text


def test_a_few_events_are_reported_with_reasons_instead_of_statistics() -> None:
    text = printed(interval_report(np.array([0.0, 1.0, 2.5, 3.0])))
    assert "expected at least 30 events, got 4" in text
    assert "refused: expected at least 200 intervals, got 3" in text


def test_gaps_are_listed_with_what_is_missing_in_them() -> None:
    report = interval_report(np.delete(np.arange(100.0), [50, 51]))
    assert report["gap_missing"].values.tolist() == [2]
    assert report["gap_start"].values.tolist() == [49.0]
    assert "1 found, 2 missed beats" in printed(report)


def test_masks_between_all_vectors_leave_no_dimension_but_a_report() -> None:
    times = np.cumsum(np.random.default_rng(4).exponential(size=600))
    report = interval_report(times, masked=seams(times[-1] / 200.0, (0.0, float(times[-1]))))
    assert "too few successive intervals" in report.attrs["dimension_raw"]


def test_coinciding_events_are_left_out_of_the_logarithms_only() -> None:
    rng = np.random.default_rng(5)
    times = np.cumsum(np.where(rng.random(600) < 0.05, 0.0, rng.exponential(size=600)))
    report = interval_report(times)
    assert np.all(np.isfinite(report["slope_log"]))
    assert np.count_nonzero(report["interval"].values == 0.0) > 10


@pytest.mark.parametrize("name", ["forcing_period", "count_bin"])
def test_a_period_or_a_bin_of_nothing_is_refused(name: str) -> None:
    with pytest.raises(UsageError, match=f"{name}: expected more than 0 s, got 0"):
        interval_report(np.arange(10.0), **{name: 0.0})  # type: ignore[arg-type]


def test_the_theiler_window_and_the_embedding_are_options_and_stated() -> None:
    times = np.cumsum(np.random.default_rng(7).exponential(size=400))
    report = interval_report(times, theiler=5, embedding=3)
    assert report.attrs["theiler"] == 5
    assert report["embedding"].values.tolist() == [1, 2, 3]
    with pytest.raises(UsageError, match="Theiler window of 0 or more, got 6 and -1"):
        interval_report(times, theiler=-1)


def test_a_train_that_is_masked_everywhere_has_no_report() -> None:
    with pytest.raises(EstimationError, match="Mask less"):
        interval_report(np.repeat(np.arange(4.0), 2), masked=between(np.arange(4.0)))
    with pytest.raises(EstimationError, match="Mask less"):
        interval_report(np.arange(10.0), masked=seams(1.0, (0.0, 9.5), 0.0))


def between(times: Floats) -> list[tuple[float, float]]:
    """Return a seam in the middle of each interval."""
    return [(middle, middle) for middle in (0.5 * (times[1:] + times[:-1])).tolist()]


def test_intervals_whose_neighbours_are_all_masked_show_no_cycle_and_no_lattice() -> None:
    # Every second interval is masked: the others are equal two places on, but no two neighbours are known.
    beats = np.arange(40.0)
    alternate = interval_report(beats[:20], masked=between(beats[:20])[::2])
    assert alternate.attrs["cycle"].startswith("the intervals repeat after no cycle")
    # One interval is left, as long as the lattice's, but between two spurious spikes.
    shifted = np.sort(np.append(np.delete(beats, 11), [10.5, 11.5]))
    alone = interval_report(shifted, masked=[s for s in between(shifted) if s[0] != 11.0])
    assert "no two places of it side by side" in alone.attrs["lattice"]


def test_the_verdict_on_slopes_follows_their_surrogate() -> None:
    growing = np.array([1.0, 1.9, 2.8, 3.7, 4.5, 5.2])
    flat = np.array([1.0, 1.6, 2.0, 2.2, 2.3, 2.35])
    assert verdict(growing, growing).startswith("no saturation: noise-like")
    assert verdict(flat, flat).startswith("flattens as its shuffled surrogate")
    assert verdict(np.minimum(growing, 1.9), growing).startswith("saturation at 1.90 from m = 2 on")
    assert verdict(0.8 * growing, growing).startswith("not decided: grows slower")
    assert verdict(growing, 0.3 * flat).startswith("no saturation: noise at these radii")
    assert verdict(np.full(6, np.nan), growing).startswith("not decided: too few radii")
    assert verdict(np.zeros(6), growing).startswith("slope 0")


def test_an_embedding_without_a_slope_does_not_lose_the_verdict_of_the_others() -> None:
    growing = np.array([np.nan, 1.9, 2.8, 3.7, 4.5, 5.2])
    said = verdict(growing, growing)
    assert said.startswith(
        "no saturation: noise-like, as its shuffled surrogate (5.20 at m = 6, shuffled 5.20)"
    )
    assert said.endswith("without m = 1: too few radii with C in the window")
    assert "from m = 3 on" in verdict(np.minimum(growing, 2.8), growing)
    assert "(4.50 at m = 5, shuffled 4.50); without m = 6:" in verdict(
        np.append(growing[1:2] / 2.0, [*growing[1:5], np.nan]), np.append(growing[1:2] / 2.0, growing[1:])
    )
    assert verdict(np.array([np.nan, 1.9, np.nan, 3.7, 4.5, np.nan]), growing).startswith("not decided")


@pytest.mark.parametrize("mean", [0.02, 0.03])
def test_intervals_on_a_coarse_grid_have_a_verdict_without_their_first_embedding(mean: float) -> None:
    # at 2 ms, twice the grid, a tenth of all pairs are near already; at 30 ms all radii lie between 2 and 3 ms
    times = 1e-3 * np.round(np.cumsum(np.random.default_rng(1).exponential(1e3 * mean, 800)))
    report = interval_report(times, resolution=1e-3)
    assert np.isfinite(report["slope_raw"].values).tolist() == [False] + 5 * [True]
    assert report.attrs["dimension_raw"].startswith("no saturation: noise-like")
    assert "without m = 1" in report.attrs["dimension_raw"]
    assert "without m = 1" in printed(report)


def test_the_figure_shows_delay_points_density_and_every_embedding(tmp_path: Path) -> None:
    report = interval_report(np.cumsum(np.random.default_rng(6).exponential(size=400)))
    figure = draw_intervals(report)
    delay, density, raw, logarithms = figure.axes
    assert len(delay.lines[0].get_xdata()) == 398
    assert [text.get_text() for text in density.get_legend().get_texts()][1] == "peaks: 1"
    for axis in (raw, logarithms):
        assert [text.get_text() for text in axis.texts] == ["1", "2", "3", "4", "5", "6"]
        # three lines for each embedding: all C, C in the window, the surrogate
        assert len(axis.lines) == 3 * 6
    figures.save(figure, tmp_path / "intervals.png")
    assert np.ptp(matplotlib.image.imread(tmp_path / "intervals.png")) > 0.5


def test_the_figure_says_why_a_panel_is_empty() -> None:
    texts = panel_texts(draw_intervals(interval_report(np.arange(20.0))))
    assert len(texts) == 2
    assert "expected at least 200" in " ".join(texts[0].split())

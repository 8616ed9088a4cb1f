"""Kinds of figures (strobe, return map, spectrum, impacts per period, work-precision), and the data that fit each."""

from __future__ import annotations

import itertools
from pathlib import Path

import matplotlib.colors
import numpy as np
import pytest
import typer
import xarray as xr
from support.dataset_examples import dataset_of, opened, record, up_down
from support.replay_signals import HIT, channel, clock, ring
from typer.testing import CliRunner

from vibroimpact.analysis import figures, write_dataset
from vibroimpact.analysis.dataset import Direction, Outcome, RunRecord
from vibroimpact.analysis.dataset.results import write_results
from vibroimpact.analysis.figures.families import FAMILIES
from vibroimpact.analysis.figures.kinds import fitting
from vibroimpact.analysis.figures.measured.intervals import draw_intervals
from vibroimpact.analysis.intervals import interval_report
from vibroimpact.analysis.recording import Channel, Recording, TimeAxis, write_recording
from vibroimpact.analysis.replay import compare, comparison_dataset
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.orchestrator.commands.typer_form import add_commands


def grid(impacts: list[float], folder: Path) -> xr.Dataset:
    """Runs over mass and position, with these impacts per period, all of velocity 10 to this power."""
    runs = [record(1.0, impacts=1) for _ in impacts]
    for run, number in zip(runs, impacts, strict=True):
        assert run.periods is not None
        assert run.impacts is not None
        run.periods[:, 4] = number
        run.impacts[:, 2] = 10.0**number
    width = len(impacts) // 2
    coordinates = {
        "mass": np.repeat([1.0, 2.0], width),
        "position": np.tile(0.1 * np.arange(1, width + 1), 2),
    }
    return opened(dataset_of(runs, coordinates=coordinates), folder)


def test_impacts_per_period_are_a_map_with_gray_where_there_are_none(tmp_path: Path) -> None:
    figure = figures.draw(grid([0.0, 0.5, 1.0, 1.0, 1.5, 2.0], tmp_path), "impacts-per-period")
    axis, bar = figure.axes
    (mesh,) = axis.collections
    # mass is horizontal: a row for each position
    values = np.ma.filled(mesh.get_array(), np.nan).reshape(3, 2)
    np.testing.assert_array_equal(values, [[np.nan, 1.0], [0.5, 1.5], [1.0, 2.0]])
    assert axis.get_title() == "gray: no impact"
    assert bar.get_ylabel() == "impacts per forcing period (-)"
    assert len(bar.get_yticks()) >= 2


def test_a_map_whose_impacts_span_decades_is_on_a_log_scale_that_is_said(tmp_path: Path) -> None:
    figure = figures.draw(grid([-1.0, -0.9, -1.1, -0.5, -1.0, 2.0], tmp_path))
    even, uneven = figure.axes[0].collections[0], figure.axes[1].collections[0]
    assert isinstance(uneven.norm, matplotlib.colors.LogNorm)
    assert not isinstance(even.norm, matplotlib.colors.LogNorm)
    assert figure.axes[3].get_ylabel() == "largest impact velocity (m/s), log scale"
    ticks = [tick for tick in figure.axes[3].get_yticks() if 0.08 <= tick <= 100.0]
    assert len(ticks) >= 2
    figure.draw_without_rendering()
    assert all(text.get_text() for text in figure.axes[3].get_yticklabels())


def test_one_grazing_impact_does_not_make_a_scale_logarithmic(tmp_path: Path) -> None:
    figure = figures.draw(grid([-8.0, 0.0, 0.1, 0.2, 0.1, 0.3], tmp_path))
    assert not isinstance(figure.axes[1].collections[0].norm, matplotlib.colors.LogNorm)


def test_a_strobe_of_a_sweep_has_each_recorded_period_at_its_parameter_below_zero_too(tmp_path: Path) -> None:
    dataset = up_down()
    dataset.strobe_displacement.values -= 4.0
    (axis,) = figures.draw(opened(dataset, tmp_path), "strobe").axes
    up, _ = axis.get_lines()
    assert up.get_xdata().tolist() == np.repeat([0.0, 1.0, 2.0], 3).tolist()
    assert up.get_ydata().tolist() == np.repeat([-3.5, -2.5, -1.5], 3).tolist()
    assert axis.get_ylim()[0] < -3.5
    assert axis.get_ylabel() == "strobe displacement (m)"


def test_the_strobe_of_one_run_is_its_poincare_section(tmp_path: Path) -> None:
    dataset = opened(up_down(), tmp_path)
    (axis,) = figures.draw(dataset, "strobe", run=4).axes
    points = axis.get_lines()[0].get_xydata()
    assert points.tolist() == [[4.5, 4.25]] * 3
    # a single point defines no scale
    assert axis.get_xlim() == pytest.approx((2.25, 6.75))


@pytest.mark.parametrize("kind", ["strobe", "run"])
def test_the_only_run_of_a_dataset_can_be_named(kind: str, tmp_path: Path) -> None:
    # its index has no dimension, as in a scene with one point
    one = opened(up_down(), tmp_path).sel(angular_frequency=1.0, direction="down")
    assert not one["run_index"].dims
    runs = one.vibroimpact.runs
    assert {runs[name].dims for name in ("run_index", "direction")} == {("run",)}
    named = figures.draw(one, kind, run=int(one["run_index"]))
    unnamed = figures.draw(one, kind)
    for axis, other in zip(named.axes, unnamed.axes, strict=True):
        assert [line.get_xydata().tolist() for line in axis.lines] == [
            line.get_xydata().tolist() for line in other.lines
        ]


def test_a_return_map_joins_each_impact_with_the_next_on_its_own_stop() -> None:
    hits = np.ones((6, 7))
    hits[:, 0] = np.arange(6)
    hits[:, 2] = [1.0, 10.0, 2.0, 20.0, 3.0, 30.0]
    hits[:, 4] = [1, 2, 1, 2, 1, 2]
    run = RunRecord(Outcome.ok, "", None, hits, np.empty((0, 3)), None, 0.0, 0.0, 0.0, 1e-3)
    figure = figures.draw(dataset_of([run], coordinates={}, sample_variables=[]), "return-map")
    first, second, _ = figure.axes[0].get_lines()
    assert first.get_xydata().tolist() == [[1.0, 2.0], [2.0, 3.0]]
    assert second.get_xydata().tolist() == [[10.0, 20.0], [20.0, 30.0]]


def forced(scene: str, units: str = "SI") -> xr.Dataset:
    """Return ten and a half periods of 2 Hz with a third harmonic, about a mean of 5."""
    time = np.arange(0.0, 5.25, 0.005)
    wave = 5.0 + 3.0 * np.cos(4.0 * np.pi * time) + 0.3 * np.sin(12.0 * np.pi * time)
    rows = np.column_stack([time, wave])
    run = RunRecord(Outcome.ok, "", None, None, None, rows, 0.0, 0.0, 0.0, 1e-3)
    return dataset_of(
        [run], coordinates={}, sample_variables=["displacement"], units=units, attrs={"scene": scene}
    )


def peaks(line: object) -> dict[float, float]:
    x, y = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
    inner = np.flatnonzero((y[1:-1] > y[:-2]) & (y[1:-1] > y[2:]) & (y[1:-1] > 1e-2)) + 1
    return {round(float(x[k]), 3): round(float(y[k]), 3) for k in inner}


def test_a_spectrum_has_a_peak_of_its_amplitude_at_each_harmonic_and_marks_the_multiples() -> None:
    figure = figures.draw(forced("[forcing]\nfrequency = 2.0\n"), "spectrum")
    (axis,) = figure.axes
    line, *multiples = axis.get_lines()
    assert peaks(line) == {2.0: 3.0, 6.0: 0.3}
    assert [mark.get_xdata()[0] for mark in multiples] == pytest.approx(2.0 * np.arange(1, 11))
    assert (axis.get_xlabel(), axis.get_ylabel()) == ("frequency (Hz)", "amplitude (m)")


def test_the_spectrum_of_a_nondimensional_scene_is_over_its_angular_frequency() -> None:
    scene = f"[forcing]\nangular_frequency = {4.0 * np.pi}\n"
    (axis,) = figures.draw(forced(scene, "nondimensional"), "spectrum").axes
    assert list(peaks(axis.get_lines()[0])) == pytest.approx([12.566, 37.699], abs=1e-3)
    assert axis.get_xlabel() == "angular frequency (-)"


def recording(values: np.ndarray) -> Recording:
    axis = TimeAxis(np.arange(len(values)) / 100.0, 0.01)
    return Recording({"board": Channel("board", values, "V", axis, np.zeros(len(values), np.uint8))})


def test_the_spectrum_of_a_recording_is_that_of_its_longest_stretch_without_a_gap() -> None:
    values = 2.0 * np.cos(2.0 * np.pi * 10.0 * np.arange(1000) / 100.0)
    values[300:400] = np.nan
    (axis,) = figures.draw(recording(values), "spectrum").axes
    assert peaks(axis.get_lines()[0]) == {10.0: 2.0}


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (np.full(100, np.nan), "board: expected 16 samples without a gap for a spectrum, got 0."),
        (
            np.where(np.arange(100) % 10, 1.0, np.nan),
            "expected 16 samples without a gap for a spectrum, got 9.",
        ),
    ],
)
def test_what_has_no_spectrum_is_said(values: np.ndarray, message: str) -> None:
    with pytest.raises(DatasetError, match=message):
        figures.draw(recording(values), "spectrum")


def test_a_constant_signal_has_an_empty_spectrum() -> None:
    (axis,) = figures.draw(recording(np.full(100, 3.0)), "spectrum").axes
    assert axis.get_yscale() == "linear"


def ladder() -> xr.Dataset:
    step = 0.1 * 0.5 ** np.arange(4)
    axes = ("exchange", "macro_step")
    seconds = np.array([[1.0, 2.0, 4.0, 8.0], [3.0, 6.0, np.nan, 24.0]])
    error = np.stack([step, -(step**2)])
    error[0, 0] = 0.0
    return xr.Dataset(
        {
            "error": (axes, error, {"units": "m"}),
            "wall_time": (axes, 1e-3 * seconds, {"units": "s"}),
        },
        coords={"exchange": ["jacobi", "iterated"], "macro_step": ("macro_step", step, {"units": "s"})},
    )


def test_work_precision_has_each_error_over_the_seconds_that_it_took() -> None:
    figure = figures.draw(ladder(), "work-precision")
    (axis,) = figure.axes
    jacobi, iterated = axis.get_lines()
    # from small steps to large ones; an exact value, or one without a time, leaves a gap
    assert jacobi.get_xdata().tolist() == pytest.approx([0.008, 0.004, 0.002])
    assert iterated.get_xdata().tolist() == pytest.approx([0.024, 0.006, 0.003])
    assert iterated.get_ydata() == pytest.approx(np.array([0.0125, 0.05, 0.1]) ** 2)
    assert (axis.get_xscale(), axis.get_yscale(), axis.get_xlabel()) == ("log", "log", "wall time (s)")


@pytest.mark.parametrize("last", [0.1001, 0.11, 0.15, 0.2, 0.35, 0.6, 0.8, 1.5, 5.0, 12.0, 20.0, 1e3])
def test_no_second_of_a_work_precision_is_written_over_another(last: float) -> None:
    seconds = xr.DataArray(np.geomspace(0.1, last, 8).reshape(2, 4), dims=("exchange", "macro_step"))
    figure = figures.draw(ladder().assign(wall_time=seconds.assign_attrs(units="s")), "work-precision")
    figure.draw_without_rendering()
    (axis,) = figure.axes
    low, high = axis.get_xlim()
    labels = zip(axis.get_xticks(), axis.get_xticklabels(), strict=True)
    labels = [*labels, *zip(axis.get_xticks(minor=True), axis.get_xticklabels(minor=True), strict=True)]
    shown = sorted((at, label) for at, label in labels if low <= at <= high and label.get_text())
    boxes = [label.get_window_extent() for _, label in shown]
    assert len(boxes) >= 2
    assert all(left.x1 < right.x0 for left, right in itertools.pairwise(boxes))


@pytest.mark.parametrize("change", [lambda d: d.drop_vars("wall_time"), lambda d: d.drop_vars("macro_step")])
def test_a_ladder_without_seconds_or_steps_has_no_work_precision(change: object) -> None:
    with pytest.raises(DatasetError, match=r"expected error and wall_time \(s\) on a ladder of steps"):
        figures.draw(change(ladder()), "work-precision")


TIME = clock()


def replay(folder: Path, *, named: bool = True) -> Path:
    """Return a replay of one recording used in the fit, and of another, three times as large, not used in it."""
    both = [
        compare(TIME, ring(TIME - HIT), channel(size * ring(TIME - HIT)), lag=0.0, polarity=1)
        for size in (1.0, 3.0)
    ]
    dataset = comparison_dataset(both)
    if named:
        words = {"units": "1", "long_name": "recording"}
        dataset["recording"] = ("comparison", ["a0.nc", "a1.nc"], words)
        dataset["use"] = ("comparison", ["fitted", "scored"], words)
    write_results(dataset, folder / "fit.nc", kind="replay")
    return folder / "fit.nc"


@pytest.mark.parametrize("recording", ["a1.nc", "a1", "board_2"])
def test_a_recording_that_was_not_fitted_is_drawn_by_its_name_which_the_figure_says(
    recording: str, tmp_path: Path
) -> None:
    with xr.open_dataset(replay(tmp_path)) as dataset:
        figure = figures.draw(dataset, recording=recording)
        assert np.nanmax(figure.axes[0].get_lines()[0].get_ydata()) == pytest.approx(
            float(dataset.board_2_measured.max())
        )
        assert "a1.nc, not fitted on" in [text.get_text() for text in figure.axes[0].texts]
        assert "a0.nc, fitted on" in [text.get_text() for text in figures.draw(dataset).axes[0].texts]


def plotted(*arguments: str) -> str:
    app = typer.Typer()
    app.callback()(lambda: None)
    add_commands(app, ["plot"])
    done = CliRunner().invoke(app, ["plot", *arguments])
    if done.exception is not None:
        assert isinstance(done.exception, DatasetError | UsageError), done.exception
        return done.exception.typed
    return done.output


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--run", "4"], "Name a recording (--recording): board (a0.nc, fitted), board_2 (a1.nc, scored)."),
        (
            ["--kind", "run"],
            "figure: kind: expected one that fits a replay (spectrum, density, replay), got 'run'.",
        ),
        (
            ["--recording", "b"],
            "expected one of board (a0.nc, fitted), board_2 (a1.nc, scored), got none named 'b'.",
        ),
        (["--from", "9"], "window: expected a part of"),
    ],
)
def test_what_does_not_fit_a_replay_is_one_line_with_what_does(
    arguments: list[str], message: str, tmp_path: Path
) -> None:
    said = plotted(str(replay(tmp_path)), "-o", str(tmp_path / "a.png"), *arguments)
    assert message in said
    assert "\n" not in said
    assert not (tmp_path / "a.png").exists()


def test_a_replay_of_an_older_file_is_drawn_by_the_name_of_its_comparison(tmp_path: Path) -> None:
    path = replay(tmp_path, named=False)
    assert "Figure written" in plotted(str(path), "-o", str(tmp_path / "a.png"), "--recording", "board_2")
    said = plotted(str(path), "-o", str(tmp_path / "a.png"), "--recording", "a1.nc")
    assert "expected one of board, board_2, got none named 'a1.nc'" in said


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["--recording", "a"],
            "recording: expected none for a dataset of runs drawn as bifurcation, got one.",
        ),
        (
            ["--kind", "replay"],
            "expected one that fits a dataset of runs (bifurcation, impact-frequency, strobe, run,",
        ),
        (
            ["--kind", "energies"],
            "expected one that fits this dataset (bifurcation, impact-frequency, strobe, run, portrait,",
        ),
        (
            ["--kind", "energies", "--run", "1"],
            "Kinds that fit: bifurcation, impact-frequency, strobe, run, portrait,",
        ),
        (
            ["--periods", "3"],
            "It goes with run, steps, portrait, impact-map, return-map, spectrum, density, energies.",
        ),
        (["--kind", "strobe", "--run", "7"], "expected one run of those there are (0, 1, 2, 3, 4, 5)"),
    ],
)
def test_what_does_not_fit_a_sweep_is_one_line_with_what_does(
    arguments: list[str], message: str, tmp_path: Path
) -> None:
    write_dataset(up_down(), tmp_path / "runs.nc")
    said = plotted(str(tmp_path / "runs.nc"), "-o", str(tmp_path / "a.png"), *arguments)
    assert message in said
    assert "\n" not in said


def test_the_command_has_the_options_of_the_function(tmp_path: Path) -> None:
    values = 2.0 * np.cos(2.0 * np.pi * 10.0 * np.arange(1000) / 100.0)
    write_recording(recording(values), tmp_path / "rec.nc")
    options = [
        "--kind",
        "spectrum",
        "--from",
        "1",
        "--to",
        "5",
        "--title",
        "a",
        "--width",
        "60",
        "--height",
        "50",
    ]
    said = plotted(str(tmp_path / "rec.nc"), "-o", str(tmp_path / "a.png"), *options)
    assert "Figure written" in said
    size = (tmp_path / "a.png").read_bytes()[16:24]
    assert [int.from_bytes(size[k : k + 4], "big") for k in (0, 4)] == pytest.approx([708, 590], abs=1)


def test_kinds_that_fit_are_those_that_can_be_drawn(tmp_path: Path) -> None:
    directions = [Direction.independent] * 6
    sweep = opened(
        dataset_of([record(float(k), impacts=4, samples=20) for k in range(6)], direction=directions),
        tmp_path,
    )
    for kind in fitting(sweep):
        takes_run = "run" in FAMILIES["runs"].drawings[kind].takes
        assert figures.draw(sweep, kind, run=3 if takes_run else None).axes
    assert fitting(sweep) == [
        "bifurcation",
        "impact-frequency",
        "strobe",
        "run",
        "portrait",
        "impact-map",
        "return-map",
        "spectrum",
        "density",
    ]


def decay(damping: list[float]) -> xr.Dataset:
    """A free decay and its damping ratio in windows of falling amplitude."""
    time = np.linspace(0.0, 1.0, 200)
    motion = ("time", np.exp(-time) * np.cos(40.0 * time), {"units": "m"})
    number = len(damping)
    windows = {
        "window_amplitude": np.geomspace(1.0, 0.01, number),
        "window_frequency": np.full(number, 40.0),
        "window_frequency_error": np.full(number, 0.1),
        "window_damping": np.array(damping),
        "window_damping_error": np.full(number, 1e-4),
    }
    return xr.Dataset(
        {"measured": motion, "exponential_fit": motion}
        | {name: ("window", values, {"units": "m"}) for name, values in windows.items()},
        coords={"time": ("time", time, {"units": "s"})},
        attrs={"results_kind": "estimates", "estimates": "decay", "channel": "arm"},
    )


def test_a_damping_beyond_the_frame_is_an_arrow_with_its_value() -> None:
    axis = figures.draw(decay([0.010, 0.011, 0.012] * 6 + [0.25, 0.31])).axes[-1]
    assert axis.get_ylim()[1] < 0.2
    (arrows,) = [line for line in axis.get_lines() if line.get_marker() == "^"]
    assert arrows.get_xdata().tolist() == pytest.approx([0.01274, 0.01], abs=1e-4)
    assert [text.get_text() for text in axis.texts] == ["0.31"]
    inside = figures.draw(decay([0.010, 0.011, 0.012, 0.013])).axes[-1]
    assert not inside.texts


def test_slopes_of_intervals_end_at_the_grid_on_which_the_instants_were_written() -> None:
    times = np.round(np.cumsum(np.random.default_rng(6).exponential(size=400)), 2)
    figure = draw_intervals(interval_report(times, resolution=0.01))
    raw = figure.axes[2]
    for axis, grid in ((raw, 0.01), (figure.axes[3], 0.01 / float(np.median(np.diff(times))))):
        drawn = [line.get_xdata()[np.isfinite(line.get_ydata())] for line in axis.get_lines()]
        assert min(x.min() for x in drawn if x.size) >= grid
    # each number stands to the left of its own line
    for text, line in zip(raw.texts, raw.get_lines()[::3], strict=True):
        x = line.get_xdata()[np.isfinite(line.get_ydata())]
        assert text.xy[0] in x
        assert (x >= text.xy[0]).sum() >= 0.8 * x.size


def test_runs_that_replayed_nothing_have_no_scores() -> None:
    runs = dataset_of([record(1.0), record(2.0)], coordinates={"mass": np.array([1.0, 2.0])})
    with pytest.raises(
        DatasetError, match="expected replays over a grid of values or of recordings, got none"
    ):
        figures.draw(runs, "scores")


def test_a_density_has_the_mean_square_of_its_signal_and_says_how_it_was_computed() -> None:
    values = 2.0 * np.cos(2.0 * np.pi * 10.0 * np.arange(1000) / 100.0)
    figure = figures.draw(recording(values), "density", segment=256)
    (axis,) = figure.axes
    frequency, height = axis.get_lines()[0].get_data()
    assert np.sum(height) * (frequency[1] - frequency[0]) == pytest.approx(2.0, rel=0.02)
    assert (
        axis.get_xlabel()
        == "frequency (Hz)\nWelch, Bartlett window\n6 segments, half overlapping, of 256 samples"
    )
    assert axis.get_ylabel().startswith("density (")
    assert axis.get_ylabel().endswith("²/Hz)")


def test_the_density_of_a_nondimensional_scene_is_over_its_angular_frequency() -> None:
    scene = "[forcing]\nangular_frequency = 2.0\n"
    (axis,) = figures.draw(forced(scene, "nondimensional"), "density", segment=64).axes
    assert axis.get_xlabel().startswith("angular frequency (-)")
    frequency, height = axis.get_lines()[0].get_data()
    (other,) = figures.draw(forced(scene, "SI"), "density", segment=64).axes
    in_hertz, of_hertz = other.get_lines()[0].get_data()
    np.testing.assert_allclose(frequency, 2.0 * np.pi * in_hertz)
    np.testing.assert_allclose(height, of_hertz / (2.0 * np.pi))


def test_a_segment_goes_with_a_density_alone() -> None:
    with pytest.raises(
        UsageError, match=r"segment: expected none for a recording drawn as spectrum.*density"
    ):
        figures.draw(recording(np.ones(100)), "spectrum", segment=64)
    with pytest.raises(UsageError, match="segment: expected a power of two of 16 to 100 samples"):
        figures.draw(recording(np.arange(100.0)), "density", segment=128)


@pytest.mark.parametrize("kind", ["energies", "resonances"])
def test_what_is_no_result_of_its_command_is_not_drawn_as_one(kind: str) -> None:
    with pytest.raises(DatasetError, match=f"expected what `vibroimpact {kind}` writes, got none of"):
        figures.draw(xr.Dataset(attrs={"results_kind": kind}))

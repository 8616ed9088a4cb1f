"""The command plot, and the ladders of benchmarks that it draws."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import typer
import xarray as xr
from support.dataset_examples import dataset_of, record, up_down
from support.figure_texts import smallest_font, texts
from typer.testing import CliRunner

from vibroimpact.analysis import figures, write_dataset
from vibroimpact.analysis.files.fingerprints import LINE_LENGTH
from vibroimpact.analysis.landmarks import observed_order
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.orchestrator.commands.typer_form import add_commands

PNG = b"\x89PNG\r\n"


def ladder() -> xr.Dataset:
    """Errors of first, second and fourth order, as a benchmark of coupling would measure them."""
    step = 0.1 * 0.5 ** np.arange(7)
    error = np.stack([0.8 * step, 0.3 * step**2, 0.2 * step**4])
    drift = np.stack([0.5 * step, -0.1 * step**2, np.zeros(7)])
    return xr.Dataset(
        {
            "error": (("exchange", "macro_step"), error, {"units": "m"}),
            "energy_drift": (("exchange", "macro_step"), drift, {"units": "1"}),
        },
        coords={
            "exchange": ["jacobi", "gauss_seidel", "iterated"],
            "macro_step": ("macro_step", step, {"units": "s"}),
        },
        attrs={"title": "Two coupled oscillators"},
    )


def test_a_ladder_of_macro_steps_shows_the_order_of_each_exchange() -> None:
    figure = figures.convergence(ladder())
    above, below = figure.axes
    orders = [[text.get_text() for text in axis.get_legend().get_texts()] for axis in figure.axes]
    assert orders == [
        ["Jacobi 1.00", "Gauss-Seidel 2.00", "iterated 4.00"],
        ["Jacobi 1.00", "Gauss-Seidel 2.00", "iterated (none)"],
    ]
    assert (above.get_xscale(), above.get_yscale(), below.get_yscale()) == ("log", "log", "log")
    # A drift may have either sign; only its magnitude falls.
    assert (below.get_lines()[1].get_ydata() > 0).all()
    assert texts(figure) == ["error (m)", "macro step (s)", "energy drift (-)"]
    assert figure.get_suptitle() == "Two coupled oscillators"
    assert figure.get_figwidth() == pytest.approx(85 / 25.4)
    assert smallest_font(figure) >= 7


def test_the_order_of_an_error_is_not_led_astray_by_rounding_or_by_one_step_that_is_too_large() -> None:
    step = 0.1 * 0.5 ** np.arange(9)
    error = 0.3 * step**2
    error[0] *= 10
    error[-2:] = 3e-6, 0.0
    assert observed_order(step[::-1], error[::-1]) == pytest.approx(2.0)
    assert np.isnan(observed_order(step[:1], error[:1]))


def test_what_is_no_ladder_is_refused_by_name() -> None:
    with pytest.raises(DatasetError, match="got no energy_drift\\. Draw what"):
        figures.draw(ladder().drop_vars("energy_drift"), "convergence")
    across = ladder().isel(exchange=0).assign(energy_drift=ladder()["energy_drift"])
    with pytest.raises(DatasetError, match="got no error on them"):
        figures.draw(across, "convergence")


def command_line() -> typer.Typer:
    app = typer.Typer()
    app.callback()(lambda: None)
    add_commands(app, ["plot"])
    return app


def test_plot_writes_the_figure_and_nothing_else(tmp_path: Path) -> None:
    write_dataset(up_down(), tmp_path / "dataset.nc")
    done = CliRunner().invoke(command_line(), ["plot", str(tmp_path), "-o", str(tmp_path / "figure.png")])
    assert done.exit_code == 0, done.output
    assert (tmp_path / "figure.png").read_bytes().startswith(PNG)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["dataset.nc", "figure.png"]


def test_plot_draws_what_a_benchmark_measured(tmp_path: Path) -> None:
    ladder().to_netcdf(tmp_path / "ladder.nc")
    arguments = ["plot", str(tmp_path / "ladder.nc"), "-o", str(tmp_path / "a.png"), "--kind", "convergence"]
    done = CliRunner().invoke(command_line(), arguments)
    assert done.exit_code == 0, done.output
    assert (tmp_path / "a.png").read_bytes().startswith(PNG)


def test_plot_help_has_an_example() -> None:
    done = CliRunner().invoke(command_line(), ["plot", "--help"])
    assert "Example: vibroimpact plot" in done.output


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        (
            ["missing.nc", "-o", "a.png"],
            DatasetError,
            "missing.nc: expected a dataset file, got no such file",
        ),
        (["corrupt.nc", "-o", "a.png"], DatasetError, "corrupt.nc: expected a readable NetCDF dataset"),
        (
            ["corrupt.nc", "-o", "a.png", "--kind", "convergence"],
            DatasetError,
            "expected a readable NetCDF dataset",
        ),
        (
            ["none.nc", "-o", "a.png", "--kind", "convergence"],
            DatasetError,
            "expected a dataset file, got no such file",
        ),
        (
            ["runs.nc", "-o", "a.png", "--kind", "convergence"],
            DatasetError,
            "kind: expected one that fits a dataset of runs (bifurcation, impact-frequency, strobe, run, portrait,",
        ),
        (["runs.nc", "-o", "a.docx"], UsageError, "expected a name ending in .png, .pdf, .svg, got '.docx'"),
        (
            ["runs.nc", "-o", "none/a.png"],
            UsageError,
            "expected a place where a file can be written, got no folder of that name",
        ),
        (
            ["runs.nc", "-o", "a.png", "--kind", "pie"],
            UsageError,
            "kind: expected one of auto, bifurcation, branches, classes, map, impacts-per-period, impact-frequency",
        ),
    ],
)
def test_plot_says_what_is_wrong_with_its_files(
    arguments: list[str],
    error: type[Exception],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    write_dataset(up_down(), tmp_path / "runs.nc")
    Path("corrupt.nc").write_bytes(Path("runs.nc").read_bytes()[:5000])
    done = CliRunner().invoke(command_line(), ["plot", *arguments])
    assert isinstance(done.exception, error)
    assert message in str(done.exception)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["corrupt.nc", "runs.nc"]


def test_a_file_that_is_damaged_in_its_data_is_one_message_too(tmp_path: Path) -> None:
    path = tmp_path / "runs.nc"
    write_dataset(dataset_of([record(float(k), impacts=400) for k in range(3)]), path, compression=1)
    content = bytearray(path.read_bytes()[:-LINE_LENGTH])  # as a file of version 0.1, without its hash
    # Damage in the middle of the compressed values; the structure of the file stays intact.
    middle = slice(len(content) // 2, len(content) * 3 // 4)
    content[middle] = bytes(len(content[middle]))
    path.write_bytes(content)
    done = CliRunner().invoke(command_line(), ["plot", str(path), "-o", str(tmp_path / "a.png")])
    assert isinstance(done.exception, DatasetError)
    assert "expected a readable NetCDF dataset" in str(done.exception)

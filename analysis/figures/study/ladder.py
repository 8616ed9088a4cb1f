"""Figures of a ladder of steps or tolerances: decrease of the errors with the step, and their cost."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator
from numpy.typing import NDArray

from vibroimpact.analysis.figures.families import Drawing, Family, register, whole
from vibroimpact.analysis.figures.page import COLOURS, canvas, label, legend_above, page_style
from vibroimpact.analysis.figures.study.needed import missing_from, refuse_missing
from vibroimpact.analysis.landmarks import observed_order

_QUANTITIES = ("error", "energy_drift")
_MARKERS = "os^Dvx"
_MEASURED = "Draw what a benchmark of coupling measured."
#: Largest number of steps that are all labelled in one column's width.
MOST_LABELS = 4
_WORDS = {"gauss_seidel": "Gauss-Seidel", "jacobi": "Jacobi"}


def convergence(dataset: xr.Dataset) -> Figure:
    """Draw error and energy drift of each exchange against the macro step, with the observed orders.

    Parameters
    ----------
    dataset : xarray.Dataset
        `error` and `energy_drift` on `exchange` (names) and `macro_step` (numbers, with `units`), as a benchmark
        measures them; magnitudes are drawn. The attribute `title` is written above.

    Returns
    -------
    matplotlib.figure.Figure
        One column (85 mm) wide.

    Raises
    ------
    DatasetError
        If a variable or dimension is missing.

    Examples
    --------
    >>> step = np.array([0.01, 0.1])
    >>> error = xr.DataArray([step, step**2], dims=("exchange", "macro_step"))
    >>> axes = {"exchange": ["jacobi", "iterated"], "macro_step": step}
    >>> figure = convergence(xr.Dataset({"error": error, "energy_drift": error}, coords=axes))
    >>> [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    ['Jacobi 1.00', 'iterated 2.00']
    """
    _refuse_other(dataset)
    with page_style():
        figure = canvas(120)
        axes = figure.subplots(2, 1, sharex=True)
        for axis, name in zip(axes, _QUANTITIES, strict=True):
            _draw_ladder(axis, dataset[name].transpose("exchange", "macro_step"))
        axes[-1].set_xlabel(label(dataset["macro_step"]))
        figure.suptitle(str(dataset.attrs.get("title", "")), fontsize=8)
    return figure


def work_precision(dataset: xr.Dataset) -> Figure:
    """Draw the cost of accuracy: the errors of a ladder over their wall time.

    Parameters
    ----------
    dataset : xarray.Dataset
        `error`, optionally `energy_drift`, and `wall_time` (s), all on the steps or tolerances of the ladder. Several
        methods have a second dimension with their names. Magnitudes are drawn; a missing error or time leaves a gap.
        The attribute `title` is written above.

    Returns
    -------
    matplotlib.figure.Figure
        One column (85 mm) wide.

    Raises
    ------
    DatasetError
        If a variable is missing, or there is no ladder.

    Examples
    --------
    >>> tolerance = np.array([1e-3, 1e-6, 1e-9])
    >>> error = xr.DataArray(tolerance, dims="tolerance", attrs={"units": "m"})
    >>> seconds = xr.DataArray([0.01, 0.02, 0.05], dims="tolerance", attrs={"units": "s"})
    >>> figure = work_precision(xr.Dataset({"error": error, "wall_time": seconds}, {"tolerance": tolerance}))
    >>> figure.axes[0].get_xlabel(), figure.axes[0].get_ylabel()
    ('wall time (s)', 'error (m)')
    """
    along, dim = _ladder_of(dataset)
    panels = [name for name in _QUANTITIES if name in dataset and along in dataset[name].dims]
    with page_style():
        figure = canvas(10 + 55 * len(panels))
        axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
        for axis, name in zip(axes, panels, strict=True):
            for place, method in enumerate(dataset[dim].values if dim else [""]):
                line = (dataset.sel({dim: method}) if dim else dataset).sortby(along)
                values, seconds = line[name].values, line["wall_time"].values
                shown = (values != 0.0) & np.isfinite(values) & (seconds > 0.0)
                _draw_line(axis, seconds[shown], np.abs(values[shown]), place, _method_words(str(method)))
            axis.set(xscale="log", yscale="log", ylabel=label(dataset[name]))
        axes[-1].set_xlabel(label(dataset["wall_time"]))
        _label_seconds(axes[-1])
        if dim:
            figure.legend(
                *axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False
            )
        figure.suptitle(str(dataset.attrs.get("title", "")), fontsize=8)
    return figure


def _label_seconds(axis: Axes) -> None:
    """Label few values of time over less than two decades, without overlap; matplotlib would label more."""
    first, last = axis.get_xlim()
    if last < 100.0 * first:
        few = MaxNLocator(MOST_LABELS) if last < 10.0 * first else LogLocator(subs=(1.0, 2.0, 5.0))
        axis.xaxis.set_major_locator(few)
        axis.xaxis.set_major_formatter("{x:.9g}")
        axis.xaxis.set_minor_locator(NullLocator())


def _ladder_of(dataset: xr.Dataset) -> tuple[str, str | None]:
    """Return the dimension of the steps or tolerances, and the dimension of the compared methods."""
    expected = "error and wall_time (s) on a ladder of steps or tolerances"
    refuse_missing(missing_from(dataset, ("error", "wall_time")), expected, _MEASURED)
    dims = [str(name) for name in dataset["error"].dims]
    numbers = [name for name in dims if name in dataset.coords and dataset[name].dtype.kind == "f"]
    others = [name for name in dims if name not in numbers and name in dataset.coords]
    is_ladder = len(numbers) == 1 and len(dims) == 1 + len(others) <= 2
    if not is_ladder or set(dataset["wall_time"].dims) != set(dims):
        refuse_missing(["ladder that both of them are on"], expected, _MEASURED)
    return numbers[0], others[0] if others else None


def _refuse_other(dataset: xr.Dataset) -> None:
    """Raise DatasetError unless a dataset is a ladder of macro steps."""
    missing = missing_from(dataset, (*_QUANTITIES, "exchange", "macro_step"))
    other = [
        f"{name} on them"
        for name in _QUANTITIES
        if name not in missing and set(dataset[name].dims) != {"exchange", "macro_step"}
    ]
    refuse_missing([*missing, *other], "error and energy_drift on exchange and macro_step", _MEASURED)


def _draw_ladder(axis: Axes, quantity: xr.DataArray) -> None:
    """Draw one quantity, a line for each exchange."""
    step = quantity["macro_step"].values
    order = np.argsort(step)
    for place, exchange in enumerate(quantity["exchange"].values):
        values = quantity.values[place]
        # A logarithm has no zero: an exact value leaves a gap.
        shown = np.where(values == 0.0, np.nan, np.abs(values))
        words = _entry(str(exchange), observed_order(step, values))
        _draw_line(axis, step[order], shown[order], place, words)
    axis.set(xscale="log", yscale="log", ylabel=label(quantity))
    _mark_steps(axis, step[order])
    legend_above(
        axis,
        "center",
        title="observed order",
        title_fontsize=7.5,
        columnspacing=0.8,
        handletextpad=0.4,
        handlelength=1.4,
    )


def _draw_line(axis: Axes, x: NDArray[np.float64], y: NDArray[np.float64], place: int, words: str) -> None:
    """Draw the line of one method, with its colour and its marker."""
    axis.plot(
        x,
        y,
        color=COLOURS[place % len(COLOURS)],
        marker=_MARKERS[place % len(_MARKERS)],
        markersize=3,
        fillstyle="none",
        label=words,
    )


def _mark_steps(axis: Axes, steps: NDArray[np.float64]) -> None:
    """Label the measured steps, only every other one if they are many."""
    marked = steps[:: 1 if len(steps) <= MOST_LABELS else 2]
    axis.set_xticks(marked, [f"{step:.3g}" for step in marked])
    axis.xaxis.set_minor_locator(NullLocator())


def _entry(exchange: str, order: float) -> str:
    """Return the legend entry of one exchange; without errors to compare it has no order."""
    name = _method_words(exchange)
    return f"{name} {order:.2f}" if np.isfinite(order) else f"{name} (none)"


def _method_words(name: str) -> str:
    """Return the name of an exchange or of another method, in words."""
    return _WORDS.get(name, name.replace("_", " "))


register(
    Family(
        "ladder",
        "what a benchmark measured",
        {
            "convergence": Drawing(whole(convergence)),
            "work-precision": Drawing(whole(work_precision)),
        },
        is_of_results=False,
    )
)

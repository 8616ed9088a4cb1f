"""Figures of sweeps: bifurcation diagrams and maps over two parameters."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.derived import (
    LARGEST_IMPACT,
    MEAN_IMPACTS,
    RANGE,
    largest_impact_velocity,
    mean_of_periods,
)
from vibroimpact.analysis.dataset.schema import (
    POINT_COLUMNS,
    SCATTERED,
    SWEPT_ALONG,
    scene_of,
    standing_for,
    swept_names,
)
from vibroimpact.analysis.figures.page import COLUMN_WIDTH, canvas, label, legend_above, legend_outside
from vibroimpact.analysis.figures.scene_text import column_of, contact_label, swept_keys
from vibroimpact.analysis.figures.sweep.map_overview import block_values, edges_of_blocks
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.fmus.messages import Argument, message

# Relative difference of runs on one orbit: rounding, and remains of their transients.
_NOISE = 1e-9

# The small dark crosses lie inside the large light rings where both sweeps agree, and both stay visible.
_SWEEPS: dict[str, dict[str, Any]] = {
    "up": {"marker": "o", "color": "#56A5DC", "markersize": 2.6, "markeredgewidth": 0.5, "fillstyle": "none"},
    "down": {"marker": "x", "color": "#B5410B", "markersize": 1.5, "markeredgewidth": 0.5},
    "independent": {"marker": ".", "color": "#20567D", "markersize": 1.6, "markeredgewidth": 0.0},
}
# Changes of this style for impacts on the second and third stop: marks stay visible where stops agree.
_OF_STOPS: tuple[dict[str, dict[str, Any]], ...] = (
    {"up": {}, "down": {}, "independent": {}},
    {
        "up": {"marker": "s", "color": "#E0B53A", "markersize": 3.4},
        "down": {"marker": "+", "color": "#5B2C83", "markersize": 2.4},
        "independent": {"color": "#D55E00", "markersize": 1.1},
    },
    {
        "up": {"marker": "D", "color": "#9AD0A5", "markersize": 3.8},
        "down": {"marker": "1", "color": "#222222", "markersize": 2.8},
        "independent": {"color": "#009E73", "markersize": 0.8},
    },
)

# Distinct values above which a column is crowded, then the area (points squared) and the smallest opacity of its
# points. The last number is the distance, over the largest value, below which two values are equal.
_CROWDED, _DOT, _FAINTEST, _DISTINCT_STEP = 20, 0.7, 0.3, 1e-3
# Median of a map, over its largest value, below which a linear scale would leave half of the map dark.
_DARK = 0.15
# Quantile of the values at the start of a logarithmic scale, so that one grazing impact does not stretch it.
_LOWEST = 0.01
# Ratio of the ends of a swept range above which a logarithmic axis shows more.
_WIDE_RANGE = 8.0
# Largest ratio of the ends of a logarithmic scale.
_WIDEST = 1e6
# Cells of a map of scattered points along each axis.
_CELLS = 500
# Variables of runs, of their periods and of their impacts that are drawn over a swept parameter.
_OF_PERIODS = (
    *("displacement_range", "displacement_max", "displacement_min"),
    *("strobe_displacement", "strobe_velocity", "impacts_per_period"),
)
_OF_IMPACTS = (
    *("impact_velocity", "impact_phase", "impact_impulse"),
    *("impact_duration", "impact_peak_force", "impact_restitution"),
)
_NEITHER = (
    "figure: expected extrema or impacts in the dataset, got neither. "
    "Set extrema = true or impacts = true in [record]."
)


def varied(dataset: xr.Dataset) -> list[str]:
    """Return the swept parameters with more than one value; one stands for parameters that move together."""
    together: dict[str, list[str]] = {}
    for name in swept_names(dataset):
        along = dataset[name].attrs.get(SWEPT_ALONG, name)
        if dataset[name].size > 1:
            # points without a grid stand for two parameters
            together.setdefault(name if along == SCATTERED else along, []).append(name)
    return [_standing_for(dataset, along, names) or names[0] for along, names in together.items()]


def _standing_for(dataset: xr.Dataset, along: str, names: list[str]) -> str | None:
    return standing_for(along, {name: dataset[name].values for name in names})


def on_axes(values: xr.DataArray, along: str, across: str) -> xr.DataArray:
    """Return values over two swept parameters, shape (across, along), both ascending.

    The axis of parameters that move together is the parameter that stands for all. Otherwise it is their place.
    """
    axes = []
    for name in (across, along):
        dimension = str(values[name].dims[0])
        if np.array_equal(values.get_index(dimension), values[name].values):
            values = values.swap_dims({dimension: name})
            axes.append(name)
        else:
            axes.append(f"place along {dimension}")
            values = values.rename({dimension: axes[-1]})
    return values.transpose(*axes).sortby(axes)


def in_order_of_the_scene(dataset: xr.Dataset, names: list[str]) -> list[str]:
    """Return swept parameters in the order of the scene; a displacement comes before a velocity."""
    listed = [column_of(key, names) for key in swept_keys(scene_of(dataset.attrs))]
    plane = ("displacement_start", "velocity_start")

    def rank(name: str) -> tuple[int, int]:
        in_plane = plane.index(name) if set(plane) <= set(names) and name in plane else 0
        return in_plane, listed.index(name) if name in listed else len(listed)

    return sorted(names, key=rank)


def one_value(values: Any) -> float | None:
    """Return the common value of numbers that differ only by rounding; None if they differ, or without numbers.

    >>> one_value([3.0037242956181855, 3.003724295618186, float("nan")]), one_value([1.0, 1.001])
    (3.0037242956181855, None)
    """
    finite = np.asarray(values, dtype=np.float64)
    finite = finite[np.isfinite(finite)]
    if finite.size == 0:
        return None
    low, high = float(finite.min()), float(finite.max())
    return low if high - low <= _NOISE * max(abs(low), abs(high)) else None


def is_logarithmic(values: Any) -> bool:
    """Return whether values come from a sweep with `spacing = "log"`: one ratio, one sign, and a wide range.

    >>> is_logarithmic([10.0, 100.0, 1000.0]), is_logarithmic([1.0, 2.0, 3.0]), is_logarithmic([2.0, 2.2, 2.42])
    (True, False, False)
    """
    ordered = np.sort(np.asarray(values, dtype=np.float64))
    if ordered.size < 3 or not ordered[0] > 0.0 or ordered[-1] < _WIDE_RANGE * ordered[0]:
        return False
    steps = np.diff(np.log(ordered))
    return bool(np.ptp(steps) <= _NOISE * abs(float(steps.max())))


def edges(values: Any) -> Any:
    """Return the edges of the cells around ascending or descending values, in their own spacing."""
    logarithmic = is_logarithmic(values)
    places = np.log(values) if logarithmic else np.asarray(values, dtype=np.float64)
    half = np.diff(places) / 2.0
    inner = places[:-1] + half
    found = np.concatenate([[places[0] - half[0]], inner, [places[-1] + half[-1]]])
    return np.exp(found) if logarithmic else found


def drawable_variables(dataset: xr.Dataset) -> list[str]:
    """Return the variables that can be drawn over a swept parameter: of runs, their periods and their impacts."""
    names = [name for name in (*_OF_PERIODS, *_OF_IMPACTS) if name in dataset.variables]
    further = (str(name) for name, variable in dataset.variables.items() if "period" in variable.dims)
    return [*names, *(name for name in further if name not in names and name.startswith(POINT_COLUMNS))]


def refuse_variable(dataset: xr.Dataset, variable: str, whose: str) -> None:
    """Raise DatasetError unless a dataset has a variable that can be drawn over a swept parameter."""
    known = drawable_variables(dataset)
    if variable not in known:
        raise DatasetError(
            message(
                *("figure: ", Argument("variable")),
                f": expected one that {whose} recorded ({', '.join(known) or 'none is there'}), got {variable!r}.",
            )
        )


def draw_bifurcation(dataset: xr.Dataset, variable: str | None = None) -> Figure:
    """Draw displacement range and impact velocity against the swept parameter, with separate marks for up and down.

    A variable of `drawable_variables` replaces both. Variables that were not recorded raise DatasetError.
    """
    if variable is not None:
        refuse_variable(dataset, variable, "the sweep")
        return draw_diagram(dataset, [variable])
    panels = [q for q in ("displacement_range", "impact_velocity") if q in dataset.variables]
    if not panels:
        raise DatasetError(_NEITHER)
    return draw_diagram(dataset, panels)


def draw_diagram(dataset: xr.Dataset, panels: list[str]) -> Figure:
    """Draw quantities against the single swept parameter, a panel for each: every run, period or impact is a point."""
    if len(varied(dataset)) != 1:
        raise DatasetError(wrong_sweep("one swept parameter", dataset))
    (name,) = varied(dataset)
    runs = dataset.vibroimpact.runs
    figure = canvas(15 + 45 * len(panels))
    axes = np.atleast_1d(figure.subplots(len(panels), 1, sharex=True))
    directions = [d for d in _SWEEPS if d in np.unique(runs["direction"].values)]
    for axis, quantity in zip(axes, panels, strict=True):
        hit = _stops_hit(dataset) if dataset[quantity].dims == ("impact",) else [None]
        for direction in directions:
            x, y, owner = _points(dataset, runs, name, quantity, direction)
            for stop in hit:
                shown = np.full(len(x), True) if stop is None else owner == stop[0]
                _draw_branch(axis, x, y, direction, stop, shown)
        if len(hit) > 1 and axis is not axes[0]:
            legend_above(axis, "center", ncols=2, markerscale=2.2, fontsize=7, handlelength=1.0)
        axis.set_ylabel(label(dataset[quantity]))
        drawn = np.concatenate(
            [np.asarray(line.get_ydata()) for line in axis.lines]
            + [np.asarray(dots.get_offsets())[:, 1] for dots in axis.collections]
        )
        _fit_limits(axis, drawn)
        if drawn.size > 1 and one_value(drawn) is not None:
            title = f"one value, to {_NOISE:g} of it: {one_value(drawn):.9g}"
            axis.set_title(title, fontsize=7, loc="left")
    axes[-1].set_xlabel(label(dataset[name]))
    if is_logarithmic(dataset[name].values):
        axes[-1].set_xscale("log")
    axes[-1].margins(x=0.02)
    if len(axes[0].get_legend_handles_labels()[1]) > 1:
        legend_outside(figure, axes[0], ncols=2, markerscale=2.2)
    return figure


def _stops_hit(dataset: xr.Dataset) -> list[tuple[int, str] | None]:
    """Return the stops with separate marks, by number and name; a single None if only one stop is hit."""
    if "impact_contact" not in dataset.variables:
        return [None]
    numbers = map(int, np.unique(dataset["impact_contact"].values))
    found: list[tuple[int, str] | None] = [(number, contact_label(dataset, number)) for number in numbers]
    return found if len(found) > 1 else [None]


def wrong_sweep(expected: str, dataset: xr.Dataset) -> str:
    """Return the message for a dataset that sweeps another number of parameters."""
    swept = varied(dataset)
    return (
        f"figure: expected {expected}, got {len(swept)} ({', '.join(swept) or 'none'}). "
        "Select some in Python before drawing, or draw one run."
    )


def _draw_branch(
    axis: Axes, x: Any, y: Any, direction: str, stop: tuple[int, str] | None, shown: Any
) -> None:
    """Draw the points of one branch, or of one stop; points in a crowded column are small and faint."""
    crowd, style, words = crowded(x, y)[shown], dict(_SWEEPS[direction]), [f"{direction} sweep"]
    if stop is not None:
        number, name = stop
        style |= _OF_STOPS[(number - 1) % len(_OF_STOPS)][direction]
        words = [*(words if direction != "independent" else []), name]
    draw_points(axis, x[shown], y[shown], crowd, label=", ".join(words), **style)


def draw_points(axis: Axes, x: Any, y: Any, crowd: Any, **style: Any) -> None:
    """Draw points as marks; points of crowded columns (`crowded`) are small, and the fainter the more there are."""
    single = crowd <= 1.0
    axis.plot(x[single], y[single], linestyle="none", rasterized=True, **style)
    if not single.all():
        opacity = np.clip(1.0 / crowd[~single], _FAINTEST, 1.0)
        faded = {"color": style["color"], "alpha": opacity, "linewidths": 0.0}
        axis.scatter(x[~single], y[~single], s=_DOT, rasterized=True, **faded)


def _fit_limits(axis: Axes, drawn: Any) -> None:
    """Fit the vertical axis to its points, from 0 if none is below; rounding does not fill it."""
    low, high = float(np.nanmin(drawn, initial=np.inf)), float(np.nanmax(drawn, initial=-np.inf))
    if not low < 0.0:
        axis.set_ylim(0.0, 1.05 * high if high > 0.0 else 1.0)
    elif one_value(drawn) is not None:
        axis.set_ylim(1.5 * low, 0.5 * low)
    else:
        axis.set_ylim(low - 0.05 * (high - low), high + 0.05 * (high - low))


def _points(
    dataset: xr.Dataset, runs: xr.Dataset, name: str, quantity: str, direction: str
) -> tuple[Any, Any, Any]:
    """Return the points of one branch and their stops: one point for each run, or for each period or impact.

    Points other than impacts have stop 0.
    """
    parameter = runs[name].values
    # one direction alone is a scalar
    chosen = np.broadcast_to(runs["direction"].values == direction, parameter.shape)
    if dataset[quantity].dims != ("impact",):
        values = runs[quantity].values[chosen]
        x = np.repeat(parameter[chosen], values[:1].size)
        return x, values.ravel(), np.zeros(x.size)
    # Positions of the runs in the file map each impact to the parameter of its run.
    at = np.full(int(dataset["impact_run"].values.max(initial=-1)) + 1, np.nan)
    ids = runs["run_id"].values
    inside = chosen & (ids < at.size)
    at[ids[inside]] = parameter[inside]
    x = at[dataset["impact_run"].values]
    kept = np.isfinite(x)
    stops = dataset["impact_contact"].values if "impact_contact" in dataset.variables else np.zeros(x.size)
    return x[kept], dataset[quantity].values[kept], stops[kept]


def crowded(x: Any, y: Any) -> Any:
    """Return the crowding of the column of each point: its distinct values over the largest distinguishable number.

    >>> crowded([1.0] * 3 + [2.0] * 300, [0.5] * 3 + [k / 300 for k in range(300)])[[0, -1]].tolist()
    [0.05, 15.0]
    """
    places, owner = np.unique(x, return_inverse=True)
    values = np.asarray(y, dtype=np.float64)
    size = float(np.nanmax(np.abs(values), initial=0.0)) or 1.0
    rounded = np.unique(np.column_stack([owner, np.round(values / (_DISTINCT_STEP * size))]), axis=0)
    distinct = np.bincount(rounded[:, 0].astype(np.intp), minlength=places.size)
    return distinct[owner] / _CROWDED


def draw_map(dataset: xr.Dataset) -> Figure:
    """Draw displacement range and largest impact velocity as colours over two swept parameters."""
    quantities = []
    if RANGE in dataset.variables:
        ranges = _Mapped.of(dataset, RANGE, lambda: dataset[RANGE])
        quantities.append(replace(ranges, text=label(dataset[RANGE]), missing="no value"))
    if "impact_velocity" in dataset.variables:
        speeds = _Mapped.of(dataset, LARGEST_IMPACT, lambda: largest_impact_velocity(dataset))
        name = f"largest {label(dataset['impact_velocity'])}"
        quantities.append(replace(speeds, text=name, missing="no impact"))
    if not quantities:
        raise DatasetError(_NEITHER)
    return _draw_maps(dataset, quantities)


def draw_impacts_per_period(dataset: xr.Dataset) -> Figure:
    """Draw the mean number of impacts in a forcing period as colours over two swept parameters.

    Motions P(p,q) are flat regions of p / q; chaos is uneven.
    """
    if "impacts_per_period" not in dataset.variables:
        raise DatasetError(
            "figure: expected the impacts of each period in the dataset, got none recorded. "
            "Set impacts = true in [record] of a forced scene."
        )
    impacts = dataset["impacts_per_period"]
    means = _Mapped.of(dataset, MEAN_IMPACTS, lambda: impacts.reduce(mean_of_periods, "period"))
    return _draw_maps(dataset, [replace(means, text="impacts per forcing period (-)", missing="no impact")])


@dataclass(frozen=True, slots=True)
class _Mapped:
    """A quantity over two parameters: of all points, or of blocks of the points of a large map."""

    values: xr.DataArray
    spread: Any
    """Values that set the scale of the colours."""
    starts: Mapping[str, NDArray[np.int64]] = field(default_factory=dict)
    """First points of blocks along each dimension; empty: each point has a cell."""
    text: str = ""
    missing: str = ""
    """Words for points without a value."""

    @classmethod
    def of(cls, dataset: xr.Dataset, name: str, whole: Callable[[], xr.DataArray]) -> _Mapped:
        """Return a quantity from the overview of a large map, else as a whole."""
        blocks = block_values(dataset, name)
        if blocks is not None:
            return cls(blocks.values, blocks.spread, blocks.starts)
        values = whole()
        return cls(values, values.values)

    def edges(self, axis: xr.DataArray) -> Any:
        """Return the edges of the cells along an axis of all points."""
        return edges_of_blocks(edges(axis.values), self.starts.get(str(axis.name)))


def _draw_maps(dataset: xr.Dataset, quantities: list[_Mapped]) -> Figure:
    """Draw values over two swept parameters: a row for each quantity, a column for each direction."""
    if len(varied(dataset)) != 2:
        raise DatasetError(wrong_sweep("two swept parameters", dataset))
    along, across = in_order_of_the_scene(dataset, varied(dataset))
    if dataset["run_id"].dims == (SCATTERED,):
        quantities = [replace(one, values=_nearest(one.values, along, across)) for one in quantities]
    elif "run" in dataset["run_id"].dims:
        raise DatasetError(
            "figure: expected a grid of two parameters, got scattered runs. "
            "Sweep each parameter over its own values."
        )
    directions = np.atleast_1d(dataset["direction"].values).tolist()
    figure = canvas(5 + 60 * len(quantities), COLUMN_WIDTH * len(directions))
    axes = np.asarray(
        figure.subplots(len(quantities), len(directions), sharex=True, sharey=True, squeeze=False)
    )
    for row, mapped in zip(axes, quantities, strict=True):
        values = mapped.values
        for axis, direction in zip(row, directions, strict=True):
            branch = values.sel(direction=direction) if "direction" in values.dims else values
            notes = [f"{direction} sweep"] if len(directions) > 1 else []
            branch = on_axes(branch.squeeze(), along, across)
            places = [dataset[name] if name in mapped.starts else branch[name] for name in branch.dims]
            notes += _colours(axis, branch, mapped, *places)
            notes += [] if np.isfinite(branch.values).all() else [f"gray: {mapped.missing}"]
            axis.set_title("; ".join(notes), fontsize=8 if len(notes) == 1 else 7)
    return figure


def _nearest(values: xr.DataArray, along: str, across: str) -> xr.DataArray:
    """Return values of scattered points on a fine grid; each cell has the value of the nearest point."""
    from scipy.spatial import cKDTree

    columns = [values[along].values, values[across].values]
    spans = [np.ptp(column) or 1.0 for column in columns]
    grid = [np.linspace(column.min(), column.max(), _CELLS) for column in columns]
    tree = cKDTree(np.stack([c / span for c, span in zip(columns, spans, strict=True)], axis=1))
    x, y = np.meshgrid(grid[0] / spans[0], grid[1] / spans[1], indexing="ij")
    _, place = tree.query(np.stack([x.ravel(), y.ravel()], axis=1))
    coordinates = {
        name: (name, axis, values[name].attrs) for name, axis in zip((along, across), grid, strict=True)
    }
    return xr.DataArray(values.values[place].reshape(_CELLS, _CELLS), coordinates, dims=(along, across))


def _colours(
    axis: Axes, values: xr.DataArray, mapped: _Mapped, vertical: xr.DataArray, horizontal: xr.DataArray
) -> list[str]:
    """Draw one colour map over (vertical, horizontal) with its bar; return the notes about it.

    All branches share the colours of the quantity; the axes are those of all points.
    """
    text, norm, same = mapped.text, _norm(mapped.spread), one_value(mapped.spread)
    axis.set_facecolor("0.88")
    # a logarithm gives no colour to values below its scale
    lowest = float(norm.vmin or 0.0) if isinstance(norm, LogNorm) else -math.inf
    mesh = axis.pcolormesh(
        mapped.edges(horizontal),
        mapped.edges(vertical),
        np.maximum(values.values, lowest),
        cmap="viridis",
        norm=norm,
        rasterized=True,
    )
    # Long numbers of small distances would overlap.
    axis.xaxis.set_major_locator(MaxNLocator(4))
    for places, set_scale in ((horizontal, axis.set_xscale), (vertical, axis.set_yscale)):
        if is_logarithmic(places.values):
            set_scale("log")
    axis.set(xlabel=label(horizontal), ylabel=label(vertical))
    axis.label_outer()
    bar = axis.figure.colorbar(mesh, ax=axis)
    bar.set_label(text)
    if isinstance(norm, LogNorm):
        bar.set_label(f"{text}, log scale")
        bar.ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        bar.ax.yaxis.set_major_formatter("{x:g}")
        bar.ax.yaxis.set_minor_locator(NullLocator())
    if same is None:
        return []
    bar.set_ticks([same], labels=[f"{same:.6g}"])
    return [f"one value, to {_NOISE:g} of it"]


def _norm(of_all: Any) -> Normalize:
    """Return the scale of the colours: logarithmic where a linear one would leave half of the map dark."""
    finite, same = of_all[np.isfinite(of_all)], one_value(of_all)
    if not finite.size:
        return Normalize(0.0, 1.0)
    if same is not None:
        # a range of rounding errors would look like a pattern
        room = max(0.5 * abs(same), sys.float_info.min)
        return Normalize(same - room, same + room)
    low, high = float(finite.min()), float(finite.max())
    positive = finite[finite > 0.0]
    if low < 0.0 or np.median(finite) > _DARK * high or positive.size < 2:
        return Normalize(low, high)
    return LogNorm(max(float(np.quantile(positive, _LOWEST)), high / _WIDEST), high)

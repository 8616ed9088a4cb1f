"""Figures of sampled variables over time, with the events or impacts of the run."""

from __future__ import annotations

import math
import re

import numpy as np
import numpy.typing as npt
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator, ScalarFormatter

from vibroimpact.analysis.dataset.schema import RULES
from vibroimpact.analysis.figures.page import (
    COLOURS,
    MARK,
    STOP,
    Floats,
    canvas,
    label,
    legend_above,
    title,
    unit_symbol,
)
from vibroimpact.analysis.figures.scene_text import fixed_positions, forcing_rate, in_scene_order, limits
from vibroimpact.analysis.figures.window import SHOWN_PERIODS, View, Window
from vibroimpact.fmus.errors import DatasetError

_STYLES = ("-", "--", ":", "-.")
_PANEL_MM = 34
_ROW_MM = 4
# Letters of a label next to a panel, and of a row above it; letters of the line before each name.
_LONGEST_LABEL = 24
_LONGEST_QUANTITY = 18
_ROW_LETTERS = 52
_LINE_LETTERS = 7
# Number of instants above which full marks would cover the panel; height at which shorter marks begin.
_MOST_LINES, _TICKS_FROM = 25, 0.94
# Parts of a name that separate variables of one quantity: contact_displacement_1, displacement_2; energy_kinetic.
_PARTICULARS = re.compile(r"^contact_|_[0-9]+$|(?<=^energy)_.*")
# The point or mode in a long name; the number and the signal of a force.
_PLACE = re.compile(
    r"(?:displacement|velocity|acceleration|force|energy) (?:of|on|between) (?:the body at )?(.+)"
)
_FORCE = re.compile(r"(force [0-9]+) of the scene(, .+)")
_CONTACT_FORCE = re.compile(r"contact_force(?:_([0-9]+))?$")
# First instant, over the width of the panel, above which time counts from it.
_LATE_START = 10.0
# Kinds of instants, and the variables with their times.
_INSTANTS = (("event", "event_time"), ("impact", "impact_time"))


def sampled_variables(dataset: xr.Dataset) -> list[str]:
    """Return the names of the sampled variables that are one number for each sample."""
    return [
        name
        for name in _all_sampled(dataset)
        if dataset.variables[name].ndim == 1 and dataset.variables[name].dtype.kind in "fiu"
    ]


def _all_sampled(dataset: xr.Dataset) -> list[str]:
    return [
        str(name)
        for name, variable in dataset.variables.items()
        if variable.dims[:1] in (("sample",), ("time",)) and name not in RULES and name != "sample_run"
    ]


def left_out(dataset: xr.Dataset) -> str:
    """Return the sampled arrays and texts, which no figure draws, in words; empty without any."""
    drawn = sampled_variables(dataset)
    names = [name for name in _all_sampled(dataset) if name not in drawn]
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return f", without {', '.join(names[:3])}{more} (arrays, texts)" if names else ""


def draw_series(dataset: xr.Dataset, view: View) -> Figure:
    """Draw the sampled variables of one run against time: a panel for each quantity, with stops and event marks.

    Panels and lines are in the order of the scene. Without a window, a long record shows its first forcing periods.
    """
    samples = dataset.vibroimpact.samples(**selected(view.run))
    part, words = time_part(dataset, samples, view.window)
    words += left_out(samples)
    time = samples["time"].values
    samples = samples.isel(time=(time >= part[0]) & (time <= part[1]))
    panels: dict[tuple[str, str], list[xr.DataArray]] = {}
    for name in in_scene_order(dataset, sampled_variables(samples)):
        panels.setdefault((unit_symbol(samples[name]), _quantity(samples[name])), []).append(samples[name])
    kind, instants = _instants(dataset, view.run)
    instants = instants[(instants >= part[0]) & (instants <= part[1])]
    rows = sum(-(-len(variables) // _columns(variables)) for variables in panels.values())
    figure = canvas(8 + _PANEL_MM * len(panels) + _ROW_MM * rows)
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for axis, variables in zip(axes, panels.values(), strict=True):
        lines = _draw_lines(axis, samples["time"].values, variables)
        _draw_stops(axis, dataset, samples["time"].values, variables)
        marks = _draw_instants(axis, kind, instants)
        peaks = _draw_peaks(axis, dataset, view.run, part, variables)
        # The legend of the marks appears once, above the first panel.
        _name_lines(axis, variables, lines, [*(marks if axis is axes[0] else []), *peaks])
        axis.margins(x=0.0)
    count_time(axes[-1], samples["time"], view.window, words)
    return figure


def time_part(dataset: xr.Dataset, samples: xr.Dataset, window: Window) -> tuple[tuple[float, float], str]:
    """Return the first and last instant to draw (s), and a note for the label of the time axis."""
    time, rate = samples["time"].values, forcing_rate(dataset, samples)
    if not len(time):
        raise DatasetError("figure: expected samples of the run, got none. Its outcome and message say why.")
    period = None if rate is None else 2.0 * math.pi / rate
    part = window.part(time, period)
    if window.given or period is None or part == window.whole(time):
        return part, ""
    return part, f", first {SHOWN_PERIODS} of {round(float(np.ptp(time)) / period, 1):g} periods"


def count_time(axis: Axes, time: xr.DataArray, window: Window, words: str) -> None:
    """Label the instants of a panel, counted from the first one if a long transient came before the record.

    With a window, instants stay those of the file, as in the panel's data.
    """
    # long numbers of late instants would overlap
    axis.xaxis.set_major_locator(MaxNLocator(6))
    axis.set_xlabel(label(time) + words)
    low, high = axis.dataLim.intervalx
    first = float(time.values[0])
    if window.given or not first > _LATE_START * (high - low) > 0.0:
        return
    axis.xaxis.set_major_locator(_CountedFrom(first))
    digits = math.ceil(6.0 - math.log10(high - low))  # without the rounding of late instants
    axis.xaxis.set_major_formatter(
        FuncFormatter(
            lambda instant, _: ScalarFormatter.fix_minus(f"{round(instant - first, digits) + 0.0:.6g}")
        )
    )
    axis.set_xlabel(f"time from {first:.8g} on ({unit_symbol(time)}){words}")


class _CountedFrom(MaxNLocator):
    """Puts ticks at whole numbers after an instant."""

    def __init__(self, first: float) -> None:
        super().__init__(6)
        self._first = first

    def tick_values(self, vmin: float, vmax: float) -> list[float]:
        """Return the ticks between two instants."""
        ticks = super().tick_values(vmin - self._first, vmax - self._first)
        return [self._first + float(tick) for tick in ticks]


def selected(run: int | None) -> dict[str, int]:
    """Return the selection of a run for the accessor of a dataset; empty for the only run."""
    return {} if run is None else {"run_index": run}


def samples_within(dataset: xr.Dataset, view: View) -> xr.Dataset:
    """Return the samples of a run in a window, or all of them."""
    samples: xr.Dataset = dataset.vibroimpact.samples(**selected(view.run))
    if not view.window.given:
        return samples
    (start, stop), _ = time_part(dataset, samples, view.window)
    time = samples["time"].values
    return samples.isel(time=np.flatnonzero((time >= start) & (time <= stop)))


def impacts_within(dataset: xr.Dataset, view: View) -> xr.Dataset:
    """Return the impacts of a run in a window, or all of them."""
    hits: xr.Dataset = dataset.vibroimpact.impacts(**selected(view.run))
    if not view.window.given:
        return hits
    time, rate = hits["impact_time"].values, forcing_rate(dataset, hits)
    start, stop = view.window.part(time, None if rate is None else 2.0 * math.pi / rate)
    return hits.isel(impact=np.flatnonzero((time >= start) & (time <= stop)))


def first_after_impacts(dataset: xr.Dataset, run: int | None, time: Floats) -> npt.NDArray[np.intp]:
    """Return the places of the first instants after the impacts of a run, for impacts between two instants."""
    if "impact" not in dataset.dims:
        return np.empty(0, dtype=np.intp)
    impacts: Floats = dataset.vibroimpact.impacts(**selected(run))["impact_time"].values
    places = np.searchsorted(time, impacts)
    return places[(places > 0) & (places < time.size)]


def with_gaps(values: Floats, places: npt.NDArray[np.intp]) -> Floats:
    """Return values with a gap before each place, so that no line is drawn across a jump."""
    return np.insert(values.astype(np.float64), places, np.nan)


def _quantity(variable: xr.DataArray) -> str:
    """Return the common name of the variables in a panel: displacement for displacement_2."""
    name, bracket, _ = str(variable.attrs.get("component_variable", "")).partition("[")
    if bracket and "." not in name:
        return name  # of an observed point: displacement[ball]
    if "component_variable" in variable.attrs:
        return ""
    return _PARTICULARS.sub("", str(variable.name))


def _instants(dataset: xr.Dataset, run: int | None) -> tuple[str, Floats]:
    """Return the kind of the instants of the run, and their times (s)."""
    for kind, clock in _INSTANTS:
        if kind in dataset.dims:
            rows = getattr(dataset.vibroimpact, f"{kind}s")(**selected(run))
            return kind, rows[clock].values
    return "event", dataset["time"].values[:0]


def _draw_lines(axis: Axes, time: Floats, variables: list[xr.DataArray]) -> list[Artist]:
    """Draw variables of one unit, each in its own colour."""
    lines: list[Artist] = []
    for place, variable in enumerate(variables):
        lines += axis.plot(
            time,
            variable.values,
            color=COLOURS[place % len(COLOURS)],
            linestyle=_STYLES[place // len(COLOURS) % len(_STYLES)],
            label=_line_name(variable),
            rasterized=True,
        )
    return lines


def _draw_stops(axis: Axes, dataset: xr.Dataset, time: Floats, variables: list[xr.DataArray]) -> None:
    """Draw the stops that displacements may meet; with several displacements, each in its colour.

    A stop farther away than the width of the motion would compress it, and is not drawn.
    """
    for place, variable in enumerate(variables):
        colour = COLOURS[place % len(COLOURS)] if len(variables) > 1 else STOP
        low, high = float(variable.min()), float(variable.max())
        found = limits(dataset, str(variable.name))
        for stop in found:
            if stop.motion:
                axis.plot(
                    time, stop.course(time)[0], color=colour, linestyle=(0, (5, 3)), linewidth=0.6, zorder=0
                )
        for position in fixed_positions(found):
            if low - (high - low) <= position <= high + (high - low):
                axis.axhline(position, color=colour, linestyle=(0, (5, 3)), linewidth=0.6, zorder=0)


def _draw_instants(axis: Axes, kind: str, instants: Floats) -> list[Artist]:
    """Draw thin lines at instants: over the whole panel, or only at its top where they are many."""
    if not instants.size:
        return []
    marks = axis.vlines(
        instants,
        0.0 if instants.size <= _MOST_LINES else _TICKS_FROM,
        1.0,
        transform=axis.get_xaxis_transform(),
        color=STOP,
        linewidth=0.4,
        zorder=0,
        label=kind,
        rasterized=True,
    )
    return [marks]


def _draw_peaks(
    axis: Axes, dataset: xr.Dataset, run: int | None, part: tuple[float, float], variables: list[xr.DataArray]
) -> list[Artist]:
    """Draw the largest force of each contact over its duration: samples may miss this force."""
    forces = [_CONTACT_FORCE.match(str(variable.name)) for variable in variables]
    if "impact_peak_force" not in dataset.variables or not any(forces):
        return []
    hits = dataset.vibroimpact.impacts(**selected(run))
    begin, peak = hits["impact_time"].values, hits["impact_peak_force"].values
    end = begin + hits["impact_duration"].values
    shown = np.isfinite(peak) & (end >= part[0]) & (begin <= part[1])
    artists: list[Artist] = []
    for place, force in enumerate(forces):
        stop = force and force.group(1)
        own = shown & (hits["impact_contact"].values == int(stop)) if stop else shown
        if force is None or not own.any():
            continue
        colour = COLOURS[place % len(COLOURS)] if len(variables) > 1 else MARK
        axis.hlines(peak[own], begin[own], end[own], color=colour, linewidth=0.6, rasterized=True)
        middle = 0.5 * (begin[own] + end[own])
        artists += axis.plot(
            middle,
            peak[own],
            ".",
            color=colour,
            markersize=2.5,
            label="largest of a contact",
            rasterized=True,
        )
    return artists[:1]


def _name_lines(axis: Axes, variables: list[xr.DataArray], lines: list[Artist], marks: list[Artist]) -> None:
    """Name the lines above their panel; for a single short name the axis label is enough."""
    axis_label = label(variables[0])
    entries = marks
    if len(variables) > 1 or len(axis_label) > _LONGEST_LABEL:
        axis_label = f"{_common(variables)} ({unit_symbol(variables[0])})".strip()
        entries = [*lines, *marks]
    axis.set_ylabel(axis_label)
    if entries:
        legend_above(axis, ncols=_columns(variables), handles=entries)


def _common(variables: list[xr.DataArray]) -> str:
    """Return the quantity of all variables of a panel: their common words, or the last part of their names."""
    quantities = {_quantity(variable) or _last_name(title(variable)) for variable in variables}
    words = min(quantities).replace("_", " ") if len(quantities) == 1 else ""
    return words if len(words) <= _LONGEST_QUANTITY else ""


def _last_name(name: str) -> str:
    """Return the kind of a component's variable, without component and number.

    >>> _last_name("soft.displacement[3]"), _last_name("load")
    ('displacement', 'load')
    """
    return name.rpartition(".")[2].partition("[")[0]


def _line_name(variable: xr.DataArray) -> str:
    """Return the name of a line: its point, mode or force in words, else its title.

    >>> words = {"long_name": "displacement of frame relative to ball"}
    >>> _line_name(xr.DataArray(0.0, name="contact_displacement_1", attrs=words))
    'frame relative to ball'
    """
    long_name = str(variable.attrs.get("long_name", ""))
    if "." not in str(variable.attrs.get("component_variable", "")):
        for words in filter(None, (_PLACE.fullmatch(long_name), _FORCE.fullmatch(long_name))):
            return "".join(words.groups())
    return title(variable)


def _columns(variables: list[xr.DataArray]) -> int:
    """Return the number of names that fit in a row above a panel."""
    longest = max(len(_line_name(variable)) for variable in variables)
    return max(1, _ROW_LETTERS // (longest + _LINE_LETTERS))

"""Figures of sampled variables over time, with the events or impacts of the run."""

from __future__ import annotations

from typing import Any

import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vibroimpact.analysis.figures.page import COLOURS, STOP, Floats, canvas, label, title, unit_symbol
from vibroimpact.analysis.schema import RULES

_STYLES = ("-", "--", ":", "-.")
_PANEL_MM = 34
_ROW_MM = 4
# What fits beside a panel, and in a row above it where each name comes after its line.
_LONGEST_LABEL = 24
_ROW_LETTERS = 52
_LINE_LETTERS = 7
# What happens at an instant, and the variable with its times.
_INSTANTS = (("event", "event_time"), ("impact", "impact_time"))


def sampled_names(dataset: xr.Dataset) -> list[str]:
    """Return the names of the sampled variables."""
    return [
        str(name)
        for name, variable in dataset.variables.items()
        if variable.dims in (("sample",), ("time",)) and name not in RULES and name != "sample_run"
    ]


def draw_series(dataset: xr.Dataset, selection: dict[str, Any]) -> Figure:
    """Draw all sampled variables of one run against time: a panel for each unit, lines at the events.

    Energies of modes have a panel of their own.

    Parameters
    ----------
    dataset : xarray.Dataset
        With samples, as `open_dataset` gives it.
    selection : dict
        What names the run, as for `dataset.vibroimpact.samples`.
    """
    samples = dataset.vibroimpact.samples(**selection)
    panels: dict[tuple[str, bool], list[xr.DataArray]] = {}
    for name in sampled_names(samples):
        place = (unit_symbol(samples[name]), name.startswith("modal_energy_"))
        panels.setdefault(place, []).append(samples[name])
    kind, instants = _instants(dataset, selection)
    rows = sum(-(-len(variables) // _columns(variables)) for variables in panels.values())
    figure = canvas(8 + _PANEL_MM * len(panels) + _ROW_MM * rows)
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for axis, variables in zip(axes, panels.values(), strict=True):
        lines = _draw_lines(axis, samples["time"].values, variables)
        marks = _draw_instants(axis, kind, instants)
        # What the marks are is said once, above the first panel.
        _name_lines(axis, variables, lines, marks if axis is axes[0] else [])
        axis.margins(x=0.0)
    axes[-1].set_xlabel(label(samples["time"]))
    return figure


def _instants(dataset: xr.Dataset, selection: dict[str, Any]) -> tuple[str, Floats]:
    """Return what happened at instants of the run, and when (s)."""
    for kind, clock in _INSTANTS:
        if kind in dataset.dims:
            rows = getattr(dataset.vibroimpact, f"{kind}s")(**selection)
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
            label=title(variable),
            rasterized=True,
        )
    return lines


def _draw_instants(axis: Axes, kind: str, instants: Floats) -> list[Artist]:
    """Draw thin lines where something happened, over the whole height of a panel."""
    if not instants.size:
        return []
    height = axis.get_xaxis_transform()
    marks = axis.vlines(
        instants,
        0.0,
        1.0,
        transform=height,
        color=STOP,
        linewidth=0.4,
        zorder=0,
        label=kind,
        rasterized=True,
    )
    return [marks]


def _name_lines(axis: Axes, variables: list[xr.DataArray], lines: list[Artist], marks: list[Artist]) -> None:
    """Name the lines above their panel; the label of the axis is enough for a single one of short name."""
    axis_label = label(variables[0])
    entries = marks
    if len(variables) > 1 or len(axis_label) > _LONGEST_LABEL:
        axis_label = f"({unit_symbol(variables[0])})"
        entries = [*lines, *marks]
    axis.set_ylabel(axis_label)
    if not entries:
        return
    axis.legend(
        handles=entries,
        frameon=False,
        ncols=_columns(variables),
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        borderaxespad=0.1,
        columnspacing=1.0,
        handlelength=1.5,
    )


def _columns(variables: list[xr.DataArray]) -> int:
    """Return how many names fit in a row above a panel."""
    longest = max(len(title(variable)) for variable in variables)
    return max(1, _ROW_LETTERS // (longest + _LINE_LETTERS))

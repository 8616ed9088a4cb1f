"""Figure of a diagram: sweep, branches, shares of basins and exponents over one axis; or loci on classes of runs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vibroimpact.analysis.dataset.composed import PARTS, part_of
from vibroimpact.analysis.figures.families import register_results
from vibroimpact.analysis.figures.orbits.basin_shares import draw_shares
from vibroimpact.analysis.figures.orbits.branches import draw_branches, draw_orbits, values_of_runs
from vibroimpact.analysis.figures.orbits.lyapunov import draw_exponents
from vibroimpact.analysis.figures.page import canvas, label, legend_above, legend_outside
from vibroimpact.analysis.figures.sweep.classes import KIND as CLASS_KIND
from vibroimpact.analysis.figures.sweep.classes import draw_classes
from vibroimpact.analysis.figures.sweep.diagrams import crowded, draw_map, draw_points, varied

_SWEEPS = {"up": ("#8CC4EE", 2.2), "down": ("#E9A13B", 1.2), "independent": ("#8CC4EE", 2.0)}
"""Colour and size of the points of each direction: the points of both are seen where they agree."""
_WORDS = {"independent": "runs"}
_RESPONSE = ("displacement_range", "impact_velocity")
_HEIGHTS = {"displacement_range": 45, "impact_velocity": 45, "shares": 32, "exponents": 32}
"""Heights of the panels, mm."""
_LONG = 20
"""Letters of a legend entry above which three entries do not fit side by side."""


def draw_diagram(dataset: xr.Dataset) -> Figure:
    """Draw the parts of a diagram that there are."""
    parts = {name: part_of(dataset, name) for name in str(dataset.attrs[PARTS]).split()}
    if len(str(dataset.attrs["parameters"]).split()) > 1:
        return _draw_map(parts)
    name, shown = _parameter(parts)
    panels = [*_response(parts), *(each for each in ("shares", "exponents") if each in parts)]
    heights = [_HEIGHTS[panel] for panel in panels]
    figure = canvas(25 + sum(heights))
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False, height_ratios=heights)[:, 0]
    for axis, panel in zip(axes, panels, strict=True):
        _draw_panel(axis, parts, panel, name)
        axis.margins(x=0.02)
    axes[-1].set_xlabel(shown)
    axes[-1].locator_params(axis="x", nbins=5)  # long numbers of a short range would overlap
    words = axes[0].get_legend_handles_labels()[1]
    if panels[0] != "shares":
        legend_outside(
            figure, axes[0], ncols=3 if max(map(len, words), default=0) < _LONG else 2, markerscale=1.3
        )
    figure.align_ylabels(axes)
    return figure


def _draw_map(parts: Mapping[str, xr.Dataset]) -> Figure:
    """Draw loci over two parameters, on the map of the runs if both are there."""
    sweep = parts.get("sweep")
    if "loci" in parts:
        return draw_branches(parts["loci"], sweep)
    assert sweep is not None
    return draw_classes(sweep) if CLASS_KIND in sweep else draw_map(sweep)


def _parameter(parts: Mapping[str, xr.Dataset]) -> tuple[str, str]:
    """Return the name of the parameter in runs and orbits, and its label."""
    for part in ("sweep", "branches"):
        if part in parts:
            (name,) = varied(parts[part])
            return name, label(parts[part][name])
    parameter = parts["shares"]["parameter"]
    name = str(parameter.attrs["long_name"]).split(".")[-1]
    return name, label(parameter.rename(name))


def _response(parts: Mapping[str, xr.Dataset]) -> list[str]:
    """Return the quantities of runs or orbits that there are."""
    runs = [parts[name] for name in ("sweep", "branches") if name in parts]
    found = {
        "displacement_range": any("displacement_max" in each for each in runs),
        "impact_velocity": any(each.sizes.get("impact", 0) > 0 for each in runs),
    }
    return [name for name in _RESPONSE if found[name]]


def _draw_panel(axis: Axes, parts: Mapping[str, xr.Dataset], panel: str, name: str) -> None:
    if panel == "shares":
        draw_shares(axis, parts["shares"])
        legend_above(axis, ncols=4, fontsize=6.5, handlelength=1.0)
    elif panel == "exponents":
        draw_exponents(axis, parts["exponents"], name, {way: colour for way, (colour, _) in _SWEEPS.items()})
        axis.set_ylabel("largest exponent\nper impact (-)")
    else:
        _draw_response(axis, parts, panel, name)


def _draw_response(axis: Axes, parts: Mapping[str, xr.Dataset], panel: str, name: str) -> None:
    for direction, (colour, size) in _SWEEPS.items() if "sweep" in parts else ():
        if direction not in np.unique(parts["sweep"]["direction"].values):
            continue
        x, y = values_of_runs(parts["sweep"], name, panel, direction)
        style = {"color": colour, "marker": "o", "markersize": size, "markeredgewidth": 0.0}
        draw_points(axis, x, y, crowded(x, y), label=_WORDS.get(direction, f"{direction} sweep"), **style)
    if "branches" in parts:
        draw_orbits(axis, parts["branches"], name, panel)
    shown = parts["sweep"] if "sweep" in parts else parts["branches"]
    axis.set_ylabel(label(shown[panel]) if panel in shown else panel.replace("_", " "))


register_results("diagram", "a diagram", draw_diagram)

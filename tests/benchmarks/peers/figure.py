"""Error against cost, a panel for each problem, in the style of `analysis/figures/study/accuracy.py`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.figure import Figure

from vibroimpact.analysis.figures.page import COLOURS, canvas, page_style

WIDTH, HEIGHT = 170.0, 150.0
"""Width of the figure and height of a panel, mm."""
MARKERS = "*osD^vP<>X"
LOWEST, TOP = 1e-15, 30.0
"""Error at the foot of a panel; height of failures. An error below the reference's own is drawn at that estimate."""


def draw(record: Mapping[str, Any]) -> Figure:
    """Draw the error of each way over its cost; a failure is a cross at the top, above the time it took."""
    rows: Sequence[Mapping[str, Any]] = record["rows"]
    names = list(dict.fromkeys(row["way"] for row in rows))
    with page_style():
        figure = canvas(HEIGHT, WIDTH / 25.4)
        axes = figure.subplots(2, 3, sharey=True).ravel()
        for axis, case in zip(axes, record["cases"], strict=False):
            for place, name in enumerate(names):
                own = [
                    r for r in rows if r["case"] == case["key"] and r["way"] == name and r["cost"] is not None
                ]
                style = {"color": COLOURS[place % len(COLOURS)], "marker": MARKERS[place % len(MARKERS)]}
                good = [r for r in own if not r["failure"] and r["error"] is not None]
                axis.plot(
                    [r["cost"] for r in good],
                    [max(r["error"], case["estimate"]) for r in good],
                    label=name,
                    markersize=8.0 if place == 0 else 3.5,
                    linestyle="-" if place < len(COLOURS) else "--",
                    **style,
                )
                bad = [r["cost"] for r in own if r["failure"]]
                axis.plot(bad, [TOP] * len(bad), "x", color=style["color"], markersize=4.0)
            axis.set(xscale="log", yscale="log", title=case["title"], ylim=(0.3 * LOWEST, 10.0 * TOP))
            axis.axhline(1e-6, color="0.75", linewidth=0.5, zorder=-1)
        for axis in axes[len(record["cases"]) :]:
            axis.set_axis_off()
        for axis in axes[3:]:
            axis.set_xlabel("processor time of a period (s)")
        figure.supylabel("largest relative error (-)", fontsize=8)
        handles, labels = figure.axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False, fontsize=6)
    return figure


def finite(value: float) -> float | None:
    """Return a number for JSON."""
    return None if math.isnan(value) else float(f"{value:.4g}")

"""The figure of a campaign of replays: the share of the measured variance that each point accounts for."""

from __future__ import annotations

from itertools import product

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vibroimpact.analysis.figures.page import COLOURS, canvas, label
from vibroimpact.analysis.figures.sweep.diagrams import varied
from vibroimpact.fmus.errors import DatasetError

#: Largest number of distinguishable lines in a panel.
MOST_LINES = 12
_STYLES = ("-", "--", ":", "-.")


def draw_scores(dataset: xr.Dataset) -> Figure:
    """Draw the variance accounted for against the swept parameter with the most values, a line for each other point."""
    scored = dataset["variance_accounted_for"].dims if "variance_accounted_for" in dataset else ()
    swept = [name for name in varied(dataset) if name in scored]
    if not swept:
        raise DatasetError(
            "figure: expected replays over a grid of values or of recordings, got none. Draw a replay's own dataset."
        )
    along = max(swept, key=lambda name: (name != "recording", dataset.sizes[name]))
    others = [name for name in swept if name != along]
    lines = int(np.prod([dataset.sizes[name] for name in others])) if others else 1
    if lines > MOST_LINES:
        raise DatasetError(
            f"figure: expected at most {MOST_LINES} lines beside {along}, got {lines} ({', '.join(others)}). "
            "Select some in Python before drawing."
        )
    pairs = dataset.compared.values.tolist()
    figure = canvas(15 + 50 * len(pairs) + (4 * lines if others else 0))
    axes = np.atleast_1d(figure.subplots(len(pairs), 1, sharex=True))
    for axis, pair in zip(axes, pairs, strict=True):
        _draw_pair(axis, dataset.variance_accounted_for.sel(compared=pair), along, others)
        axis.set_title(pair, fontsize=7.5)
    axes[-1].set_xlabel(label(dataset[along]))
    if others:
        entries = axes[0].get_legend_handles_labels()
        columns = 1 if len(others) > 1 else 2  # two long names do not fit side by side
        figure.legend(*entries, loc="outside lower center", ncols=columns, frameon=False)
    return figure


def _draw_pair(axis: Axes, scores: xr.DataArray, along: str, others: list[str]) -> None:
    """Draw the lines of one compared pair: colours for the last of the other parameters, dashes for the rest."""
    values = [scores[name].values.tolist() for name in others]
    for place, chosen in enumerate(product(*values)):
        point = dict(zip(others, chosen, strict=True))
        colour = place % len(values[-1]) if others else 0
        style = place // len(values[-1]) if others else 0
        axis.plot(
            scores[along].values,
            scores.sel(point).values,
            color=COLOURS[colour % len(COLOURS)],
            linestyle=_STYLES[style % len(_STYLES)],
            marker=".",
            markersize=3,
            label=", ".join(f"{name.replace('_', ' ')} {value:g}" for name, value in point.items()),
        )
    axis.set_ylabel("variance accounted for (%)")
    # a model without any skill may be far below zero: the relevant range is above
    axis.set_ylim(bottom=max(0.0, axis.get_ylim()[0]))

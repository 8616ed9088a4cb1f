"""What effects cost: the share of each in the time of a run, and what is otherwise without it."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from vibroimpact.analysis.figures.page import LINE, MARK, canvas, page_style
from vibroimpact.fmus.errors import DatasetError

_NEEDED = ("share", "seconds", "run_seconds", "name", "changes")
_BAR_MM = 9
_LONGEST = 28
"""Letters of what is written beside a bar."""


def draw_effects(dataset: xr.Dataset) -> Figure:
    """Draw a bar for the share of each effect, a point for each pair of runs, and what changes without it.

    Parameters
    ----------
    dataset : xarray.Dataset
        Of kind `effects`, as `vibroimpact effects` writes it.

    Returns
    -------
    matplotlib.figure.Figure
        One column (85 mm) wide.

    Raises
    ------
    DatasetError
        If a variable is missing, or there is no effect.
    """
    missing = [name for name in _NEEDED if name not in dataset]
    if missing or not dataset["share"].size:
        got = f"none of {', '.join(missing)}" if missing else "no effect"
        raise DatasetError(f"figure: expected what `vibroimpact effects` writes, got {got}.")
    names = [str(name) for name in dataset["name"].values]
    places = np.arange(len(names))[::-1]
    parts = 100.0 * dataset["seconds"].values / dataset["run_seconds"].values[:, None]
    with page_style():
        figure = canvas(25 + _BAR_MM * len(names))
        axis = figure.subplots()
        axis.barh(places, 100.0 * dataset["share"].values, height=0.6, color=LINE, alpha=0.5)
        axis.plot(parts, np.broadcast_to(places[:, None], parts.shape), ".", color=MARK, markersize=2.5)
        for place, words in zip(places, dataset["changes"].values, strict=True):
            shown = str(words)
            shown = shown if len(shown) <= _LONGEST else f"{shown[: _LONGEST - 3]}..."
            axis.text(
                0.98, place, shown, fontsize=5, ha="right", va="center", transform=axis.get_yaxis_transform()
            )
        axis.axvline(0.0, color="0.5", linewidth=0.6)
        axis.set_yticks(places, names, fontsize=6)
        axis.tick_params(axis="y", right=False)
        axis.set_xlim(min(-5.0, np.nanmin(parts) - 5.0), max(100.0, np.nanmax(parts)) * 1.6)
        axis.set_xlabel("share of the time of a run (%)")
        figure.suptitle(str(dataset.attrs.get("title", "")), fontsize=8, wrap=True)
    return figure

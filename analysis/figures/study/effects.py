"""The cost of effects: the share of each effect in the time of a run, and the change of the results without it."""

from __future__ import annotations

import json
from textwrap import wrap

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vibroimpact.analysis.figures.families import register_results
from vibroimpact.analysis.figures.page import LINE, MARK, canvas, page_style
from vibroimpact.analysis.figures.study.needed import missing_from, refuse_missing

_NEEDED = ("share", "seconds", "run_seconds", "name", "changes")
_BAR_MM = 9
_LETTERS, _LINE_MM = 6, 2.9
"""Size of the text next to a bar, points, and height of its lines, mm."""
_CONVERGENCE_MM = 45
_WORDS = 0.75
"""Width of the text next to the bars, over that of the bars."""
_LONGEST = 24
"""Letters in a line of the text next to a bar."""
_CLASSES = ("orbit", "orbit_without")


def draw_effects(dataset: xr.Dataset) -> Figure:
    """Draw a bar for the share of each effect, a point for each pair of runs, and the changes without the effect.

    The figure is one column (85 mm) wide. A missing variable, or no effect, raises DatasetError.
    """
    missing = missing_from(dataset, _NEEDED) or ([] if dataset["share"].size else ["effect"])
    refuse_missing(missing, "what `vibroimpact effects` writes")
    names = [str(name) for name in dataset["name"].values]
    parts = 100.0 * dataset["seconds"].values / dataset["run_seconds"].values[:, None]
    converges = "modes_tried" in dataset.attrs
    with page_style():
        texts = _bar_texts(dataset)
        rows = np.array([max(_BAR_MM, _LINE_MM * (1 + words.count("\n"))) for words in texts])
        bars = 25 + float(rows.sum())
        # bars are as far apart as the text next to them is high
        places = ((rows.sum() - np.cumsum(rows) + 0.5 * rows) / _BAR_MM) - 0.5
        figure = canvas(bars + (_CONVERGENCE_MM if converges else 0))
        if converges:
            axis, below = figure.subplots(2, 1, height_ratios=[bars, _CONVERGENCE_MM])
            _draw_convergence(below, dataset)
        else:
            axis = figure.subplots()
        axis.barh(places, 100.0 * dataset["share"].values, height=0.6, color=LINE, alpha=0.5)
        axis.plot(parts, np.broadcast_to(places[:, None], parts.shape), ".", color=MARK, markersize=2.5)
        for place, words in zip(places, texts, strict=True):
            axis.text(
                0.98,
                place,
                words,
                fontsize=_LETTERS,
                ha="right",
                va="center",
                transform=axis.get_yaxis_transform(),
            )
        axis.axvline(0.0, color="0.5", linewidth=0.6)
        axis.set_yticks(places, names, fontsize=6)
        axis.tick_params(axis="y", right=False)
        low, high = min(-5.0, np.nanmin(parts) - 5.0), max(100.0, np.nanmax(parts))
        axis.set_xlim(low, high + _WORDS * (high - low))
        axis.set_xticks([tick for tick in axis.get_xticks() if low <= tick <= high])  # none below the words
        axis.set_xlabel("share of the time of a run (%)")
        figure.suptitle(str(dataset.attrs.get("title", "")), fontsize=8, wrap=True)
    return figure


def _bar_texts(dataset: xr.Dataset) -> list[str]:
    """Return the text next to each bar: the changes without the effect, class and displacement range below."""
    found = []
    for row, words in enumerate(dataset["changes"].values):
        lines = [str(words)]
        if "orbit" in dataset and (classes := [str(dataset[name].values[row]) for name in _CLASSES])[0]:
            lines.append(" to ".join(dict.fromkeys(classes)))
        if (
            "displacement_range" in dataset
            and np.isfinite(ends := dataset["displacement_range"].values[row]).all()
        ):
            change = f"range {100.0 * (ends[1] / ends[0] - 1.0):+.3g} %" if ends[0] > 0.0 else ""
            lines.append(change.replace("-", "\N{MINUS SIGN}"))
        found.append("\n".join(part for line in lines for part in wrap(line, _LONGEST)))
    return found


def _draw_convergence(axis: Axes, dataset: xr.Dataset) -> None:
    """Draw the distance of each number of modes from the largest number, and the chosen number."""
    tried = json.loads(dataset.attrs["modes_tried"])
    distances = {int(n): off for n, off in tried.items() if isinstance(off, float | int) and off > 0.0}
    other = [int(n) for n, off in tried.items() if isinstance(off, str)]
    tolerance, taken = float(dataset.attrs["tolerance"]), int(dataset.attrs["modes_found"])
    axis.axhline(tolerance, color="0.5", linewidth=0.8, linestyle="--", label="tolerance")
    axis.loglog(list(distances), list(distances.values()), "o-", color=LINE, markersize=3, linewidth=0.8)
    if taken in distances:
        axis.plot(taken, distances[taken], "o", color=MARK, markersize=5, label=f"taken: {taken}")
    if other:
        top = 2.0 * max([tolerance, *distances.values()])
        axis.plot(other, [top] * len(other), "x", color=LINE, markersize=4, label="another motion")
    numbers = sorted(map(int, tried))
    axis.set_xticks(numbers, [str(n) for n in numbers], fontsize=6)
    axis.set_xticks([], minor=True)
    axis.set_xlabel("number of modes")
    axis.set_ylabel("relative error (-)")
    axis.legend(fontsize=6, frameon=False)


register_results("effects", "a study of effects", draw_effects)

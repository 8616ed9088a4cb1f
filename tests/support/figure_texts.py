"""Texts of a figure, and their smallest size."""

from __future__ import annotations

from matplotlib.figure import Figure


def texts(figure: Figure) -> list[str]:
    """Return the labels of the axes, in order."""
    axes = figure.axes
    return [text for axis in axes for text in (axis.get_xlabel(), axis.get_ylabel()) if text]


def smallest_font(figure: Figure) -> float:
    """Return the smallest size of ticks, labels and legends, pt."""
    labels = [tick for axis in figure.axes for tick in (*axis.get_xticklabels(), *axis.get_yticklabels())]
    names = [axis.xaxis.label for axis in figure.axes] + [axis.yaxis.label for axis in figure.axes]
    legends = [text for legend in figure.legends for text in legend.get_texts()]
    return min(float(text.get_fontsize()) for text in (*labels, *names, *legends))

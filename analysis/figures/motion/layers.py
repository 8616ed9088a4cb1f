"""Lines of motions in the phase plane that stay readable after many turns."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from vibroimpact.analysis.figures.page import Floats

FEW_TURNS = 20
"""Turns up to which a motion is one line; each turn of a longer motion is a faint layer, and layers add up."""
_THIN = 0.3
"""Width of a layer, points."""
_OPACITY, _FAINTEST = 2.0, 0.03
"""Opacity of a layer times the root of their number, and smallest opacity: .26 for 60 turns, .045 for 2,000."""


def draw_turns(axis: Axes, displacement: Floats, velocity: Floats, **style: Any) -> None:
    """Draw a motion in the phase plane, with gaps of the line at NaN; a long motion is drawn as layers.

    A single line does not darken where it crosses itself, so a chaotic motion would be one filled shape.
    """
    begins = turn_begins(velocity)
    if begins.size <= FEW_TURNS:
        axis.plot(displacement, velocity, **style)
        return
    points = np.column_stack([displacement, velocity])
    # a layer extends to the first point of the next layer
    layers = np.split(points, begins)
    joined = [np.vstack([one, other[:1]]) for one, other in pairwise(layers)]
    draw_layers(axis, [*joined, layers[-1]], **style)


def draw_layers(axis: Axes, layers: Any, **style: Any) -> None:
    """Draw lines, shape (point, 2) each, as faint layers; their entry in the legend is as dark as any other."""
    words, colour = style.pop("label", None), style.pop("color")
    opacity = max(_FAINTEST, _OPACITY / np.sqrt(max(len(layers), 1)))
    lines = LineCollection(layers, colors=colour, linewidths=_THIN, alpha=min(1.0, opacity), **style)
    axis.add_collection(lines)
    if words is not None:
        axis.plot([], [], color=colour, label=words)
    axis.autoscale_view()


def turn_begins(velocity: Floats) -> Any:
    """Return the samples at which a turn begins: the velocity becomes positive.

    >>> turn_begins(np.array([-1.0, 1.0, np.nan, -1.0, -1.0, 2.0])).tolist()
    [1, 5]
    """
    known = np.flatnonzero(np.isfinite(velocity))
    positive = velocity[known] > 0.0
    return known[1:][positive[1:] & ~positive[:-1]]

"""Figures of the modes of a structure: shapes over the places of its nodes, or over its points."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from vibroimpact.analysis.figures.families import register_results
from vibroimpact.analysis.figures.page import COLOURS, STOP, Floats, canvas, legend_outside, page_style
from vibroimpact.fmus.errors import DatasetError

_MOST_PANELS, _COLUMNS = 6, 2
_MOST_BARS = 24
"""Largest number of points of a figure without places."""
_ON_A_LINE = 0.02
"""Width of nodes over their length, below which they lie on a line."""
_LARGEST = 0.15
"""Largest displacement in a drawn shape, over the length of the structure."""
_LONGEST_EDGE = 4.0
"""Largest distance of joined nodes over that of the loneliest node from its nearest one."""
_DIRECTIONS = "xyz"
_VIEW = np.array([[0.819, -0.574, 0.0], [0.287, 0.410, 0.866]])
"""Directions to the right and upwards on the page, for a view from above along -x and -y."""


def draw_modes(dataset: xr.Dataset) -> Figure:
    """Draw the shapes of the first modes: of nodes in space, of nodes along a line, or at points without a place.

    DatasetError: the dataset has no shapes.
    """
    missing = [name for name in ("frequency", "shape", "point") if name not in dataset.variables]
    if missing:
        raise DatasetError(f"figure: expected modes with shapes at points, got none of {', '.join(missing)}.")
    is_residual = (
        dataset["is_residual"].values if "is_residual" in dataset else np.zeros(dataset.sizes["mode"])
    )
    drawn = np.flatnonzero(is_residual == 0)[:_MOST_PANELS]
    nodes, places, moves = _at_nodes(dataset)
    view = _view(places, moves)
    rows = -(-len(drawn) // _COLUMNS)
    with page_style():
        figure = canvas(4 + _panel_height(places, view) * rows)
        axes = np.atleast_1d(figure.subplots(rows, min(_COLUMNS, len(drawn)), squeeze=False)).ravel()
        for axis, mode in zip(axes, drawn, strict=False):
            hertz = float(dataset["frequency"].values[mode])
            words = f"{hertz:.5g} Hz" if hertz > 0.0 else "rigid body"
            axis.set_title(f"mode {mode + 1}, {words}", fontsize=7)
            if len(nodes) < 3:
                _draw_points(axis, dataset, int(mode))
            elif _is_line(places):
                _draw_line(axis, places, moves[:, :, mode])
            else:
                _draw_nodes(axis, places, moves[:, :, mode], view)
        for axis in axes[len(drawn) :]:
            axis.remove()
        if len(nodes) >= 3 and _is_line(places):
            legend_outside(figure, axes[0], ncols=3)
    return figure


def _panel_height(places: Floats, view: Floats) -> float:
    """Return the height of a panel, mm: nodes in space need that of their projection."""
    if len(places) < 3 or _is_line(places):
        return 36.0
    wide, high = np.ptp(places @ view.T, axis=0)
    room = 2.0 * _LARGEST * float(np.ptp(places, axis=0).max())
    return float(np.clip(8.0 + 38.0 * (high + room) / (wide + room), 16.0, 60.0))


def _at_nodes(dataset: xr.Dataset) -> tuple[list[str], Floats, Floats]:
    """Return nodes with a known place: names, places (node, 3), and displacements (node, 3, mode)."""
    if not {"x", "y", "z"} <= set(map(str, dataset.variables)):
        return [], np.zeros((0, 3)), np.zeros((0, 3, dataset.sizes["mode"]))
    places = np.column_stack([dataset[name].values for name in _DIRECTIONS])
    nodes: dict[str, tuple[Floats, Floats]] = {}
    shapes = dataset["shape"].transpose("point", "mode").values
    for name, place, shape in zip(dataset["point"].values, places, shapes, strict=True):
        node, _, direction = str(name).rpartition(".")
        if np.isnan(place).any() or not direction or direction not in _DIRECTIONS:
            continue
        moves = nodes.setdefault(node, (place, np.zeros((3, len(shape)))))[1]
        moves[_DIRECTIONS.index(direction)] = shape
    own = list(nodes.values())
    where = np.array([place for place, _ in own]).reshape(-1, 3)
    return list(nodes), where, np.array([moves for _, moves in own]).reshape(-1, 3, shapes.shape[1])


def _is_line(places: Floats) -> bool:
    """Return whether nodes lie on a line, to the width that a figure can show."""
    extents = np.linalg.svd(places - places.mean(axis=0), compute_uv=False)
    return bool(extents[1:].max(initial=0.0) <= _ON_A_LINE * extents[0])


def _draw_line(axis: Axes, places: Floats, moves: Floats) -> None:
    """Draw the displacement in each direction over the coordinate in which the line is longest."""
    longest = int(np.argmax(np.ptp(places, axis=0)))
    order = np.argsort(places[:, longest])
    for direction, name in enumerate(_DIRECTIONS):
        if np.abs(moves[:, direction]).max() > 0.0:
            axis.plot(
                places[order, longest],
                moves[order, direction],
                color=COLOURS[direction],
                label=f"along {name}",
            )
    axis.axhline(0.0, color=STOP, linewidth=0.4, zorder=0)
    axis.set(xlabel=f"{_DIRECTIONS[longest]} (m)", ylabel="shape (kg$^{-1/2}$)")


def _view(places: Floats, moves: Floats) -> Floats:
    """Return the directions of the page: those of a plane structure that stays in its plane, or a view from above."""
    for across in range(3):
        if len(places) and np.ptp(places[:, across]) == 0.0 and not moves[:, across].any():
            return np.delete(np.eye(3), across, axis=0)
    return _VIEW


def _draw_nodes(axis: Axes, places: Floats, moves: Floats, view: Floats) -> None:
    """Draw nodes at rest and displaced, joined with their neighbours, in parallel projection."""
    length = float(np.ptp(places, axis=0).max())
    largest = float(np.linalg.norm(moves, axis=1).max())
    moved = places + moves * (_LARGEST * length / largest if largest > 0.0 else 0.0)
    edges = _neighbours(places)
    for nodes, colour, width in ((places, STOP, 0.3), (moved, COLOURS[0], 0.7)):
        flat = nodes @ view.T
        axis.add_collection(LineCollection(list(flat[edges]), colors=colour, linewidths=width))
        axis.plot(*flat.T, ".", color=colour, markersize=1.5)
    axis.set_aspect("equal")
    axis.set_axis_off()


def _neighbours(places: Floats) -> np.ndarray[tuple[int, ...], np.dtype[np.intp]]:
    """Return pairs of nodes, shape (pair, 2): no third node lies in the ball whose diameter joins them (Gabriel).

    Pairs much further apart than any node and its nearest neighbour are left out: the feet of a frame.
    """
    squares = ((places[:, None] - places[None]) ** 2).sum(axis=2)
    alone = squares + np.diag(np.full(len(places), np.inf))
    longest = _LONGEST_EDGE**2 * alone.min(axis=1).max()
    found = []
    for first in range(len(places)):
        # a third node lies in the ball where the two squared distances to it add up to less than the pair's
        nearest = (squares[first][None, :] + squares).astype(np.float64)
        nearest[:, first] = np.inf
        np.fill_diagonal(nearest, np.inf)
        joined = (nearest.min(axis=1) > squares[first] * (1.0 + 1e-9)) & (squares[first] <= longest)
        found += [(first, second) for second in np.flatnonzero(joined).tolist() if second > first]
    return np.array(found, dtype=np.intp).reshape(-1, 2)


def _draw_points(axis: Axes, dataset: xr.Dataset, mode: int) -> None:
    """Draw the shape at each point as a bar."""
    names = [str(name) for name in dataset["point"].values[:_MOST_BARS]]
    shape = dataset["shape"].transpose("point", "mode").values[: len(names), mode]
    axis.bar(range(len(names)), shape, color=COLOURS[0])
    axis.axhline(0.0, color=STOP, linewidth=0.4)
    axis.set_xticks(range(len(names)), names, rotation=90 if len(names) > 4 else 0)
    axis.set_ylabel("shape (kg$^{-1/2}$)")


register_results("modes", "modes of a structure", draw_modes)

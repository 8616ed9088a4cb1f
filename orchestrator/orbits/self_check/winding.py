"""Fixed points of a continuous map of a rectangle, located by winding numbers: equations.md 4.14.

The winding number of x - P(x) along the edge of a cell is the sum of the indices of its fixed points.
Cells of another number than 0 are divided, down to a size that is a fixed point's.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.bodies.impacting_body import Floats

Complexes = NDArray[np.complex128]
Change = Callable[[Floats], Complexes]
"""Returns the change of states, shape (state, 2), as complex numbers; NaN where it is unknown."""

WIDEST = 1.0
"""Turn of the change between neighbouring states of an edge, rad, above which a state between them is added."""
HALVINGS = 44
"""Halvings of an edge after which its turn counts as unknown."""
DIVIDED = 0.4871
"""Share at which a cell is divided: no simple fraction, since fixed points of mirrored bodies lie at those."""
UNEVEN = 0.0371
"""Unevenness of the first cells, for the same reason."""
SMALLEST = 1e-8
"""Size of a cell, over the rectangle, that is a fixed point's."""
ROUNDED = 1e-4
"""Size of a cell, over the rectangle, below which the numbers of its quarters may miss its own by rounding."""


@dataclass(frozen=True, slots=True)
class Marks:
    """Known fixed points.

    Attributes
    ----------
    states : array, shape (point, 2)
    indices : array of int, shape (point,)
    """

    states: Floats
    indices: NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Cell:
    """A cell whose winding number is not the sum of the known indices in it.

    Attributes
    ----------
    low, high : array, shape (2,)
        Its corners.
    index : int
        Its winding number, which is the sum of all indices in it, without the known ones.
    """

    low: Floats
    high: Floats
    index: int

    @property
    def middle(self) -> Floats:
        """State in its middle, shape (2,)."""
        return 0.5 * (self.low + self.high)


@dataclass(frozen=True, slots=True)
class Search:
    """A search for all fixed points of a map in a rectangle.

    Attributes
    ----------
    change : callable
        P(x) - x.
    low, high : array, shape (2,)
        Corners of the rectangle.
    cells : int
        Cells along each axis, from which the division begins.
    parts : int
        Parts of each edge of a cell at least: more parts miss fewer turns of the change.
    """

    change: Change
    low: Floats
    high: Floats
    cells: int
    parts: int

    def missing(self, marks: Marks) -> list[Cell]:
        """Return the smallest cells around all fixed points that are not marked.

        A cell comes larger where an edge of its quarters has an unknown number. First cells with such an edge are left
        out.
        """
        shares = np.linspace(0.0, 1.0, self.cells + 1)[:, None]
        ticks = self.low + (self.high - self.low) * (shares + UNEVEN * shares * (1.0 - shares))
        x, y = np.meshgrid(ticks[:, 0], ticks[:, 1], indexing="ij")
        nodes = np.stack([x, y], axis=2)
        open_cells, _ = _missing(nodes, _numbers(self.change, nodes, self.parts), marks)
        done: list[Cell] = []
        while open_cells:
            following: list[Cell] = []
            for cell, (quarters, is_known) in zip(open_cells, self._divided(open_cells, marks), strict=True):
                is_small = self._is_below(ROUNDED, cell)
                adds_up = sum(each.index for each in quarters) == cell.index
                if not is_known or self._is_below(SMALLEST, cell) or (is_small and not adds_up):
                    done.append(cell)
                else:
                    following += quarters
            open_cells = following
        return done

    def _is_below(self, share: float, cell: Cell) -> bool:
        """Return whether a cell is smaller than a share of the rectangle."""
        return bool((cell.high - cell.low < share * (self.high - self.low)).all())

    def _divided(self, cells: list[Cell], marks: Marks) -> list[tuple[list[Cell], bool]]:
        """Return for each cell its quarters with missing points, and whether the numbers of all four are known."""
        low, high = np.array([each.low for each in cells]), np.array([each.high for each in cells])
        ticks = np.stack([low, low + DIVIDED * (high - low), high], axis=1)
        shape = len(cells), 3, 3
        x, y = np.broadcast_to(ticks[:, :, None, 0], shape), np.broadcast_to(ticks[:, None, :, 1], shape)
        nodes = np.stack([x, y], axis=3)
        numbers = _numbers(self.change, nodes, self.parts)
        return [_missing(*each, marks) for each in zip(nodes, numbers, strict=True)]


def _missing(nodes: Floats, numbers: Floats, marks: Marks) -> tuple[list[Cell], bool]:
    """Return the cells of a grid with missing points, and whether the numbers of all are known."""
    known = np.zeros(numbers.shape)
    for state, each in zip(marks.states, marks.indices, strict=True):
        i, j = np.searchsorted(nodes[:, 0, 0], state[0]) - 1, np.searchsorted(nodes[0, :, 1], state[1]) - 1
        if 0 <= i < numbers.shape[0] and 0 <= j < numbers.shape[1]:
            known[i, j] += each
    places = np.argwhere(np.isfinite(numbers) & (numbers != known)).tolist()
    missing = numbers - known
    cells = [Cell(nodes[i, j], nodes[i + 1, j + 1], int(missing[i, j])) for i, j in places]
    return cells, bool(np.isfinite(numbers).all())


def _numbers(change: Change, nodes: Floats, parts: int) -> Floats:
    """Return the winding numbers of all cells of grids of nodes, shape (..., x, y, 2); NaN where they are unknown."""
    along, up = _turns_of_grid(change, nodes, parts)
    return np.round(along[..., :, :-1] + up[..., 1:, :] - along[..., :, 1:] - up[..., :-1, :])


def _turns_of_grid(change: Change, nodes: Floats, parts: int) -> tuple[Floats, Floats]:
    """Return the turns of the change along all edges of grids of nodes, shape (..., x, y, 2), over 2 pi."""
    values = change(nodes.reshape(-1, 2)).reshape(nodes.shape[:-1])
    along = nodes[..., :-1, :, :], nodes[..., 1:, :, :], values[..., :-1, :], values[..., 1:, :]
    up = nodes[..., :-1, :], nodes[..., 1:, :], values[..., :-1], values[..., 1:]
    return _turns(change, *along, parts), _turns(change, *up, parts)


def _turns(
    change: Change, first: Floats, second: Floats, at_first: Complexes, at_second: Complexes, parts: int
) -> Floats:
    """Return the turns of the change along straight edges, over 2 pi; parts are halved where the change turns far."""
    shape, count = at_first.shape, at_first.size
    shares = np.linspace(0.0, 1.0, parts + 1)[:, None, None]
    between = first.reshape(-1, 2) * (1.0 - shares) + second.reshape(-1, 2) * shares
    inner = change(between[1:-1].reshape(-1, 2)).reshape(parts - 1, count)
    values = np.concatenate([at_first.reshape(1, -1), inner, at_second.reshape(1, -1)])
    total, owner = np.zeros(count), np.tile(np.arange(count), parts)
    a, b = between[:-1].reshape(-1, 2), between[1:].reshape(-1, 2)
    f, g = values[:-1].ravel(), values[1:].ravel()
    for _ in range(HALVINGS):
        turn = _turn(f, g)
        wide = np.abs(turn) > WIDEST
        np.add.at(total, owner[~wide], turn[~wide])
        wide &= np.isfinite(total[owner])
        if not wide.any():
            return total.reshape(shape) / (2.0 * np.pi)
        owner, a, b, f, g = owner[wide], a[wide], b[wide], f[wide], g[wide]
        middle = 0.5 * (a + b)
        at_middle = change(middle)
        owner = np.concatenate([owner, owner])
        a, b = np.concatenate([a, middle]), np.concatenate([middle, b])
        f, g = np.concatenate([f, at_middle]), np.concatenate([at_middle, g])
    total[owner] = np.nan
    return total.reshape(shape) / (2.0 * np.pi)


def _turn(first: Complexes, second: Complexes) -> Floats:
    """Return the angle from one change to the next, rad; NaN where one is unknown or 0."""
    with np.errstate(invalid="ignore", divide="ignore"):
        one, other = first / np.abs(first), second / np.abs(second)
    return np.asarray(np.angle(other * one.conj()))

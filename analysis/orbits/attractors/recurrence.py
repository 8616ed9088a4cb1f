"""Attractors told apart by recurrence: cells of the strobe section that motions visit again.

A motion on an attractor returns to cells that it has visited. Motions on one attractor visit the cells of each other.
Motions on separate attractors visit none of them, if the cells are small enough. The cells are the smallest
ones to which the motions themselves return (compare Datseris and Wagemakers, Chaos 32, 2022).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.orbits.attractors.chaotic_groups import components

Floats = NDArray[np.float64]

BINS = (16, 32, 64, 128, 256, 512, 1024)
"""Cells along each axis of the section, from the largest cells on."""
MOST_CELLS = 30_000
"""Largest number of visited cells; more would take too much memory."""
RETURNS, RECURRENT = 0.9, 0.5
"""Shares of the later half of a motion in cells of its earlier half.

Cells are the smallest to which nine of ten motions return so often; a motion below RECURRENT is a transient.
"""
LEAST = 0.1
"""Share of the motions that may return less often, such as transients."""
SHARED, APART = 0.5, 0.05
"""Shares of a motion in the cells of another: above SHARED they are on one attractor, below APART they are not."""
FEWEST_STATES, MOST_STATES = 100, 1500
"""States of a motion below which it has no dimension, and states of which its dimension is that."""
REPEATS = 1e-7
"""Distance of two states, over the size of the motion, below which they are equal."""
PAIRS = (0.002, 0.05)
"""Shares of the pairs of states between whose distances the dimension is the slope."""
ROUNDING = 1e-9
"""Distance, over the size of the motion, below which a pair of states is equal: the motion has a period."""


@dataclass(frozen=True, slots=True)
class Recurrence:
    """Motions told apart by the cells that they visit.

    Attributes
    ----------
    labels : array of int, shape (motion,)
        Attractor of each motion; the attractor of most motions is 0.
    returns : array, shape (motion,)
        Share of the later half of each motion in cells of its earlier half.
    bins : int
        Cells along each axis of the section.
    is_sure : bool
        False if motions on different attractors share some cells.
    """

    labels: NDArray[np.int64]
    returns: Floats
    bins: int
    is_sure: bool

    @property
    def recurs(self) -> NDArray[np.bool_]:
        """Whether each motion returns to its own cells: it is on an attractor, and no transient."""
        return self.returns >= RECURRENT


def recurrence(sections: Floats) -> Recurrence:
    """Return the motions told apart by the cells of the section that they visit again.

    Parameters
    ----------
    sections : array, shape (motion, period, 2)
        States at forcing phase 0, finite, at least 2 periods.

    Examples
    --------
    >>> angle = np.arange(2000.0)
    >>> circle = np.column_stack([np.cos(angle), np.sin(angle)])
    >>> recurrence(np.array([circle, circle[::-1], 2.0 * circle])).labels
    array([0, 0, 1])
    """
    low, high = sections.min(axis=(0, 1)), sections.max(axis=(0, 1))
    size = np.where(high > low, high - low, 1.0)
    half = sections.shape[1] // 2
    found: tuple[Floats, int] | None = None
    for bins in BINS:
        cells = np.minimum(np.floor((sections - low) / size * bins), bins - 1).astype(np.int64)
        visited = _visited(cells, bins)
        count = int(visited.max()) + 1
        if found is not None and count > MOST_CELLS:
            break
        early, late = (_shares(part, count) for part in (visited[:, :half], visited[:, half:]))
        shared = (
            late @ (early > 0.0).T
        )  # of each motion's later half, in the cells of each motion's earlier half
        if found is not None and float(np.quantile(np.diag(shared), LEAST)) < RETURNS:
            break
        found = shared, bins
    assert found is not None, "there are cells of one size at least"
    shared, bins = found
    returns = np.diag(shared).copy()
    both = np.maximum(shared, shared.T) / np.maximum(np.minimum.outer(returns, returns), 1e-9)
    labels = components(both >= SHARED)
    other = labels[:, None] != labels[None, :]
    return Recurrence(labels, returns, bins, not bool((both[other] > APART).any()))


def _visited(cells: NDArray[np.int64], bins: int) -> NDArray[np.int64]:
    """Return the number of the cell of each state, shape (motion, period), counted over the visited cells."""
    keys = cells[..., 0] * bins + cells[..., 1]
    is_visited = np.zeros(bins * bins, np.int64)
    is_visited[keys] = 1
    return np.asarray((np.cumsum(is_visited) - 1)[keys])


def _shares(visited: NDArray[np.int64], cells: int) -> Floats:
    """Return the share of each motion's states in each cell, shape (motion, cell)."""
    motions, periods = visited.shape
    places = np.arange(motions)[:, None] * cells + visited
    counts = np.bincount(places.ravel(), minlength=motions * cells)
    return np.asarray(counts.reshape(motions, cells) / periods)


def long_period(states: Floats) -> int:
    """Return the smallest number of periods after which the states of a motion repeat, up to half of them; else 0.

    >>> long_period(np.tile(np.arange(90.0), 4)[:, None])
    90
    """
    size = float(np.abs(states).max())
    for periods in range(1, len(states) // 2 + 1):
        if np.abs(states[-1] - states[-1 - periods]).max() > REPEATS * size:
            continue
        if np.abs(states[periods:] - states[:-periods])[-periods:].max() <= REPEATS * size:
            return periods
    return 0


def correlation_dimension(states: Floats) -> float:
    """Return the correlation dimension of the states of a motion at forcing phase 0 (Grassberger, Procaccia 1983).

    The number of pairs nearer than r grows as r to this power. The slope is that between the distances below which
    0.2 % and 5 % of the pairs lie. A motion with a period, or one of fewer than 100 states, has the dimension 0.

    >>> draw = np.random.default_rng(1)
    >>> line = np.repeat(draw.random(1500)[:, None], 2, axis=1)
    >>> round(correlation_dimension(line), 1), round(correlation_dimension(draw.random((1500, 2))), 1)
    (1.0, 1.9)
    """
    chosen = states[:MOST_STATES]
    if len(chosen) < FEWEST_STATES:
        return 0.0
    scale = chosen.max(axis=0) - chosen.min(axis=0)
    scaled = (chosen - chosen.min(axis=0)) / np.where(scale > 0.0, scale, 1.0)
    first, second = np.triu_indices(len(scaled), k=1)
    distances = np.abs(scaled[first] - scaled[second]).max(axis=1)
    near, far = np.quantile(distances, PAIRS)
    return float(np.log(PAIRS[1] / PAIRS[0]) / np.log(far / near)) if near > ROUNDING else 0.0

"""Shares of the points in the delay plot of a period-1 motion with missed and spurious spikes.

Each place of the lattice has 1 - p + s events on average, and as many delay points. Each kind of point needs
certain places with their spike (1 - p) or without it (p). It also needs certain intervals with a spurious spike (s)
or without one (1 - s).

Without spurious spikes the point (iI, jI) has the share p^(i+j-2) (1-p)^2. Without missed spikes the shares are
(1-s)^2/(1+s) for the main point and s/(1+s) for the line x + y = I. The lines x = I and y = I have s(1-s)/(1+s) each,
the inside of the square s^2/(1+s) (thesis 5.4.2). The thesis says that p missed spikes give (I, pI); one missed spike
makes an interval 2I, so it is (p+1)I.
"""

from __future__ import annotations

import numpy as np

from vibroimpact.analysis.intervals.lattice import Lattice
from vibroimpact.analysis.intervals.trains import Floats, IntervalTrain

CELLS = ("(I, I)", "(I, 2I) or (2I, I)", "x + y = I", "x = I or y = I", "inside the square")


def lattice_share(missed: float, spurious: float, i: int, j: int) -> float:
    """Return the share of the delay point (iI, jI), for probabilities of missed and spurious spikes.

    >>> [round(lattice_share(0.1, 0.0, 1, j), 6) for j in (1, 2, 3)]
    [0.81, 0.081, 0.0081]
    """
    # three spikes are there, i + j - 2 are missed between them, and i + j intervals have no spurious spike
    events = 1.0 - missed + spurious
    return (1.0 - missed) ** 3 * missed ** (i + j - 2) * (1.0 - spurious) ** (i + j) / events


def expected_shares(missed: float, spurious: float) -> Floats:
    """Return the shares of the delay points in the order of `CELLS`.

    The last three are shares of single true intervals; with both missed and spurious spikes some points lie elsewhere.

    >>> expected_shares(0.0, 0.04).round(6).tolist()
    [0.886154, 0.0, 0.038462, 0.073846, 0.001538]
    """
    events = 1.0 - missed + spurious
    diagonal = (1.0 - missed) ** 2 * spurious / events
    # a true interval without a spurious spike, then one with it, or the reverse
    edges = 2.0 * (1.0 - missed) ** 2 * spurious * (1.0 - spurious) / events
    inside = (1.0 - missed) * spurious**2 / events
    double = lattice_share(missed, spurious, 1, 2) + lattice_share(missed, spurious, 2, 1)
    return np.array([lattice_share(missed, spurious, 1, 1), double, diagonal, edges, inside])


def observed_shares(train: IntervalTrain, lattice: Lattice) -> Floats:
    """Return the observed shares of the delay points, in the order of `CELLS`; the train must have that lattice."""
    whole = train.kept[:-1] & train.kept[1:]
    on = lattice.on_lattice
    first, middle, last = on[:-2], on[1:-1], on[2:]
    length = train.separated / lattice.interval
    x, y = np.nan_to_num(length[:-1]), np.nan_to_num(length[1:])
    i, j = np.rint(x), np.rint(y)
    true = first & middle & last
    cells = (
        true & (i == 1.0) & (j == 1.0),
        true & (((i == 1.0) & (j == 2.0)) | ((i == 2.0) & (j == 1.0))),
        first & ~middle & last & (np.rint(x + y) == 1.0),
        middle & ((first & ~last & (i == 1.0) & (y < 1.0)) | (~first & last & (j == 1.0) & (x < 1.0))),
        ~first & middle & ~last & (x < 1.0) & (y < 1.0),
    )
    total = max(int(np.count_nonzero(whole)), 1)
    return np.array([np.count_nonzero(cell & whole) / total for cell in cells])

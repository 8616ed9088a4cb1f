"""The displacement of a free decay at any instants, from its nodes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.decay.half_swing import Coefficients, Nodes, half_swings

Floats = NDArray[np.float64]


def decaying_motion(start: Floats, amplitude: Floats, coefficients: Coefficients, time: Floats) -> Floats:
    """Return displacements from the equilibrium, after a turning point.

    Quintic Hermite interpolation between nodes that are at most a twentieth of a period apart: errors of
    1e-7 of the amplitude.

    Parameters
    ----------
    start, amplitude : ndarray of float, shape (column,)
        Instant (s) and displacement (positive) of the turning point.
    coefficients : Coefficients
        Columns as above.
    time : ndarray of float, shape (sample,)
        s, ascending; instants shortly before the start are extrapolated.

    Returns
    -------
    ndarray of float, shape (sample, column)
    """
    nodes = half_swings(start, amplitude, coefficients, float(time[-1]))
    return np.column_stack([_interpolated(nodes, column, time) for column in range(len(start))])


def _interpolated(nodes: Nodes, column: int, time: Floats) -> Floats:
    """Return one column at the instants: each interval has its own values at both ends (friction jumps)."""
    knots = nodes.time[:, :, column]
    per_swing = knots.shape[1] - 1
    starts = knots[:, :-1].ravel()
    if not np.all(np.isfinite(starts)):
        return np.full(len(time), np.nan)
    place = np.clip(np.searchsorted(starts, time, side="right") - 1, 0, len(starts) - 1)
    swing, node = np.divmod(place, per_swing)
    width = knots[swing, node + 1] - knots[swing, node]
    # A body at rest stays where it is, however long after its last node.
    part = np.minimum((time - knots[swing, node]) / width, 1.0)
    left, right = (swing, node, column), (swing, node + 1, column)
    return _quintic(
        part,
        (nodes.displacement[left], width * nodes.velocity[left], width**2 * nodes.acceleration[left]),
        (nodes.displacement[right], width * nodes.velocity[right], width**2 * nodes.acceleration[right]),
    )


def _quintic(part: Floats, left: tuple[Floats, ...], right: tuple[Floats, ...]) -> Floats:
    """Return the quintic through value, first and second derivative at part = 0 and 1."""
    rest = 1.0 - part

    def half(here: Floats, there: Floats, ends: tuple[Floats, ...], sign: float) -> Floats:
        value, slope, curvature = ends
        power = there**3
        return power * (
            value * (1.0 + 3.0 * here + 6.0 * here**2)
            + sign * slope * here * (1.0 + 3.0 * here)
            + 0.5 * curvature * here**2
        )

    return half(part, rest, left, 1.0) + half(rest, part, right, -1.0)

"""Free decays under viscous, Coulomb and quadratic damping, from turning point to turning point.

Between two turning points the damping force is smooth; only at the turning points does friction change its sign.
In the plane of `x = a cos(theta)`, `x' = -a omega sin(theta)` the turning points are at multiples of pi. One half
swing is therefore a smooth problem on a fixed interval of theta:

    d(ln a)/d(theta) = g sin(theta) / (1 + g cos(theta)),   dt/d(theta) = 1 / (omega (1 + g cos(theta))),

Here g is the force in addition to the linear spring, over `omega^2 a`. Repeated integration (Picard) on Chebyshev
points solves the problem to rounding: at once for viscous damping, otherwise in a few rounds. Coulomb friction may
end the motion away from the equilibrium. The last swing then has a closed form: a damped half cosine about the edge
of the dead zone, then rest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from vibroimpact.analysis.decay.samples import Floats

_ORDER = 16
_MOST_SWEEPS = 60
_CONVERGED = 1e-11
_LAST_SWING = 3.0
"""Start of a swing, in half widths of the dead zone, below which it ends inside the zone, and is the last swing."""
_MOST_SWINGS = 200_000


def _integration() -> tuple[Floats, Floats]:
    """Return angles from 0 to pi, and the matrix that integrates from 0 to each of them."""
    points = -np.cos(np.pi * np.arange(_ORDER + 1) / _ORDER)
    to_coefficients = np.linalg.inv(chebyshev.chebvander(points, _ORDER))
    integrals = [chebyshev.chebint(row, lbnd=-1) for row in np.eye(_ORDER + 1)]
    values = np.array([chebyshev.chebval(points, series) for series in integrals]).T
    return 0.5 * np.pi * (1.0 + points), 0.5 * np.pi * values @ to_coefficients


_ANGLE, _INTEGRAL = _integration()
_COS, _SIN = np.cos(_ANGLE)[:, None], np.sin(_ANGLE)[:, None]


@dataclass(frozen=True, slots=True)
class Coefficients:
    """Coefficients of the motion, shape (column,), one column for each variant computed together.

    The order is omega0 (rad/s), lambda (1/s), c (unit/s^2), q (1/unit), mu (1/unit^2). The equation of motion is
    `x'' + omega0^2 x (1 + mu x^2) = -2 lambda x' - c sign(x') - q x' |x'|`.
    """

    angular_frequency: Floats
    viscous: Floats
    coulomb: Floats
    quadratic: Floats
    cubic: Floats


@dataclass(frozen=True, slots=True)
class Nodes:
    """The motion at its nodes: ndarrays of shape (swing, node, column); s, unit, unit/s, unit/s^2."""

    time: Floats
    displacement: Floats
    velocity: Floats
    acceleration: Floats


class _Terms:
    """The force in addition to the linear spring on a half swing, by its coefficients at the nodes."""

    def __init__(self, known: Coefficients) -> None:
        self.omega = known.angular_frequency
        self.viscous = 2.0 * known.viscous / self.omega * _SIN
        self.quadratic = known.quadratic * _SIN**2
        self.cubic = known.cubic * _COS**3
        self.dead = known.coulomb / self.omega**2

    def relative_force(self, amplitude: Floats) -> Floats:
        """Return g = cubic a^2 - (viscous + quadratic a) - dead / a at the nodes, shape (node, column)."""
        force: Floats = (
            (self.cubic * amplitude - self.quadratic) * amplitude - self.viscous - self.dead / amplitude
        )
        return force


def half_swings(start: Floats, amplitude: Floats, coefficients: Coefficients, until: float) -> Nodes:
    """Follow the motion from a turning point at a positive displacement, half swing by half swing.

    `start` (s) and `amplitude`, of shape (column,), belong to this turning point. The motion is followed until all
    columns are past `until` (s) or at rest. A column is NaN after its motion has ceased to oscillate (damped beyond any
    swing).
    """
    terms = _Terms(coefficients)
    time, height = start.astype(float), amplitude.astype(float)
    at_rest = np.zeros(len(time), bool)
    shape = np.zeros((_ORDER + 1, len(time)))
    swings: list[tuple[Floats, ...]] = []
    with np.errstate(all="ignore"):
        while np.any(~at_rest & (time < until)) and len(swings) < _MOST_SWINGS:
            last = ~at_rest & (height <= _LAST_SWING * terms.dead)
            swing, shape = _free_swing(height, shape, terms)
            if last.any():
                swing = _replaced(swing, last, _last_swing(height, terms.dead, coefficients))
            if at_rest.any():
                swing = _replaced(swing, at_rest, _rest(height, coefficients))
            side = -1.0 if len(swings) % 2 else 1.0
            swings.append((time + swing[0], *(side * part for part in swing[1:])))
            time, height = time + swing[0][-1], -swing[1][-1]
            at_rest = at_rest | last | ~np.isfinite(height)
    return Nodes(*(np.array(part) for part in zip(*swings, strict=True)))


def _replaced(
    swing: tuple[Floats, ...], where: NDArray[np.bool_], other: tuple[Floats, ...]
) -> tuple[Floats, ...]:
    return tuple(np.where(where, b, a) for a, b in zip(swing, other, strict=True))


def _free_swing(height: Floats, shape: Floats, terms: _Terms) -> tuple[tuple[Floats, ...], Floats]:
    """Return time, displacement, velocity and acceleration of a swing towards the negative side.

    `shape` is ln(a(theta) / a(0)) of the swing before, the start of the iteration.
    """
    for _ in range(_MOST_SWEEPS):
        force = terms.relative_force(height * np.exp(shape))
        better = _INTEGRAL @ (force * _SIN / (1.0 + force * _COS))
        change = np.abs(better - shape).max(axis=0)
        shape = better
        if not (change > _CONVERGED).any():
            break
    amplitude = height * np.exp(shape)
    force = terms.relative_force(amplitude)
    rate = 1.0 + force * _COS
    # An angle that turns back is no swing: the column becomes NaN.
    amplitude = np.where((rate > 0.0).all(axis=0), amplitude, np.nan)
    displacement = amplitude * _COS
    pull = terms.omega**2 * amplitude
    parts = _INTEGRAL @ (1.0 / rate) / terms.omega, displacement, -terms.omega * amplitude * _SIN
    return (*parts, -pull * (_COS + force)), np.where(np.isfinite(amplitude), shape, 0.0)


def _last_swing(height: Floats, dead: Floats, known: Coefficients) -> tuple[Floats, ...]:
    """Return the swing that ends within the dead zone; viscous damping of equal loss replaces quadratic damping."""
    omega = known.angular_frequency
    rate = known.viscous + 4.0 / (3.0 * np.pi) * known.quadratic * omega * height
    damped = np.sqrt(omega**2 - rate**2)
    edge = np.minimum(dead, height)
    time = _ANGLE[:, None] / damped
    decay = (height - edge) * np.exp(-rate * time)
    displacement = edge + decay * (_COS + rate / damped * _SIN)
    velocity = -decay * omega**2 / damped * _SIN
    return time, displacement, velocity, -(omega**2) * (displacement - edge) - 2.0 * rate * velocity


def _rest(height: Floats, known: Coefficients) -> tuple[Floats, ...]:
    """Return a swing without motion: its end is `height` seen from the other side."""
    still = np.zeros((_ORDER + 1, len(height)))
    # The side changes with every swing; a body at rest stays in place because its height keeps its sign.
    return _ANGLE[:, None] / known.angular_frequency, still + height, still, still


def decaying_motion(start: Floats, amplitude: Floats, coefficients: Coefficients, time: Floats) -> Floats:
    """Return displacements from the equilibrium, after a turning point, shape (sample, column).

    Quintic Hermite interpolation between nodes at most a twentieth of a period apart: errors of 1e-7 of the
    amplitude. Start (s), amplitude (positive) and coefficients have shape (column,), the ascending time (s) has shape
    (sample,); instants shortly before the start are extrapolated.
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

"""Free decays under viscous, Coulomb and quadratic damping, from turning point to turning point.

Between two turning points the damping force is smooth: all that is not smooth happens at the turning points, where
the friction changes its sign. In the plane of `x = a cos(theta)`, `x' = -a omega sin(theta)` these lie at known
angles, whole multiples of pi, so that one half swing is a smooth problem on a fixed interval of theta:

    d(ln a)/d(theta) = g sin(theta) / (1 + g cos(theta)),   dt/d(theta) = 1 / (omega (1 + g cos(theta))),

with g the force beside the linear spring over `omega^2 a`. It is solved on Chebyshev points by repeated integration
(Picard), to rounding: at once where the damping is viscous, in a few rounds else. The last swings, where Coulomb
friction ends the motion away from the equilibrium, are written out: a damped half cosine about the edge of the dead
zone, then rest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

_ORDER = 16
_MOST_SWEEPS = 60
_CONVERGED = 1e-11
_LAST_SWING = 3.0
"""Half widths of the dead zone: a swing that starts within ends inside the zone, and is the last."""
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
    """Coefficients of the motion, one column for each variant that is computed along.

    Attributes
    ----------
    angular_frequency, viscous, coulomb, quadratic, cubic : ndarray of float, shape (column,)
        omega0 (rad/s), lambda (1/s), c (unit/s^2), q (1/unit), mu (1/unit^2) of
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


@dataclass(frozen=True, slots=True)
class _Terms:
    """What a half swing needs of the coefficients at its nodes: g = cubic a^2 - (viscous + quadratic a) - dead / a."""

    omega: Floats
    viscous: Floats
    quadratic: Floats
    cubic: Floats
    dead: Floats

    def relative_force(self, amplitude: Floats) -> Floats:
        """Return g at the nodes, shape (node, column)."""
        force: Floats = (
            (self.cubic * amplitude - self.quadratic) * amplitude - self.viscous - self.dead / amplitude
        )
        return force


def _terms(known: Coefficients) -> _Terms:
    omega = known.angular_frequency
    return _Terms(
        omega,
        2.0 * known.viscous / omega * _SIN,
        known.quadratic * _SIN**2,
        known.cubic * _COS**3,
        known.coulomb / omega**2,
    )


def half_swings(start: Floats, amplitude: Floats, coefficients: Coefficients, until: float) -> Nodes:
    """Follow the motion from a turning point at a positive displacement, half swing by half swing.

    Parameters
    ----------
    start, amplitude : ndarray of float, shape (column,)
        Instant (s) and displacement of the turning point.
    coefficients : Coefficients
    until : float
        s; the motion is followed until all columns are past it or at rest.

    Returns
    -------
    Nodes
        NaN from where a column's motion ceased to be an oscillation (damped beyond any swing).
    """
    terms = _terms(coefficients)
    time, height = start.astype(float), amplitude.astype(float)
    rests = np.zeros(len(time), bool)
    shape = np.zeros((_ORDER + 1, len(time)))
    swings: list[tuple[Floats, ...]] = []
    with np.errstate(all="ignore"):
        while np.any(~rests & (time < until)) and len(swings) < _MOST_SWINGS:
            last = ~rests & (height <= _LAST_SWING * terms.dead)
            swing, shape = _free_swing(height, shape, terms)
            if last.any():
                swing = _replaced(swing, last, _last_swing(height, terms.dead, coefficients))
            if rests.any():
                swing = _replaced(swing, rests, _rest(height, coefficients))
            side = -1.0 if len(swings) % 2 else 1.0
            swings.append((time + swing[0], *(side * part for part in swing[1:])))
            time, height = time + swing[0][-1], -swing[1][-1]
            rests = rests | last | ~np.isfinite(height)
    return Nodes(*(np.array(part) for part in zip(*swings, strict=True)))


def _replaced(swing: tuple[Floats, ...], where: Flags, other: tuple[Floats, ...]) -> tuple[Floats, ...]:
    return tuple(np.where(where, b, a) for a, b in zip(swing, other, strict=True))


def _free_swing(height: Floats, shape: Floats, terms: _Terms) -> tuple[tuple[Floats, ...], Floats]:
    """Return time, displacement, velocity, acceleration of a swing towards the negative side.

    `shape` is ln(a(theta) / a(0)) of the swing before: where the iteration starts.
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
    # An angle that turns back is no swing; such a column is given up, not followed.
    amplitude = np.where((rate > 0.0).all(axis=0), amplitude, np.nan)
    displacement = amplitude * _COS
    pull = terms.omega**2 * amplitude
    parts = _INTEGRAL @ (1.0 / rate) / terms.omega, displacement, -terms.omega * amplitude * _SIN
    return (*parts, -pull * (_COS + force)), np.where(np.isfinite(amplitude), shape, 0.0)


def _last_swing(height: Floats, dead: Floats, known: Coefficients) -> tuple[Floats, ...]:
    """Return the swing that ends within the dead zone; quadratic damping as the viscous one of equal loss."""
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
    """Return a swing that does not move: `height` seen from the other side at its end."""
    still = np.zeros((_ORDER + 1, len(height)))
    # The side changes with every swing; what rests stays where it is because the sign of its height is kept.
    return _ANGLE[:, None] / known.angular_frequency, still + height, still, still

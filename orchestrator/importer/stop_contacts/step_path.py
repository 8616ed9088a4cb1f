"""The path of a contact point over a step: a cubic through displacement and velocity at both ends; points on it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


def points_of_a_way() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return points of a path, as fractions of it, and their weights: Gauss's in s, at u = s^2 (3 - 2 s).

    Where a contact begins or ends at an end of the path, a force like penetration^1.5 is smooth in s, not in u.
    """
    points, weights = np.polynomial.legendre.leggauss(8)
    s = 0.5 * (points + 1.0)
    return s * s * (3.0 - 2.0 * s), 3.0 * s * (1.0 - s) * weights


POINTS, WEIGHTS = points_of_a_way()
#: The points and weights as pairs of numbers.
NODES = tuple(zip(POINTS.tolist(), WEIGHTS.tolist(), strict=True))
#: Halvings that locate a change on a path to the last bit of a fraction.
HALVINGS = 52


@dataclass(frozen=True, slots=True)
class StepPath:
    """Motion over a step: displacement (m) and velocity (m/s) at its start and at its end, and its size (s)."""

    start: float
    start_velocity: float
    end: float
    end_velocity: float
    size: float

    def at(self, u: float) -> tuple[float, float]:
        """Return displacement (m) and velocity (m/s) at the fraction `u` of the step."""
        moved, rest = self.end - self.start, 1.0 - u
        bend = self.size * u * rest * (self.start_velocity * rest - self.end_velocity * u)
        displacement = self.start + moved * u * u * (3.0 - 2.0 * u) + bend
        slope = self.start_velocity * rest * (1.0 - 3.0 * u) + self.end_velocity * u * (3.0 * u - 2.0)
        return displacement, 6.0 * moved / self.size * u * rest + slope

    @property
    def turn(self) -> float | None:
        """Fraction of the step at which a motion that goes up at first turns back; None if it does not turn."""
        if not self.start_velocity > 0.0 > self.end_velocity:
            return None
        return last_true(lambda u: self.at(u)[1] > 0.0)

    @property
    def turns(self) -> list[float]:
        """Fractions of the step, between its ends, at which the velocity is 0."""
        v, w, mean = self.start_velocity, self.end_velocity, (self.end - self.start) / self.size
        a, b, c = 3.0 * (v + w - 2.0 * mean), 2.0 * (3.0 * mean - 2.0 * v - w), v
        square = b * b - 4.0 * a * c
        if square < 0.0:
            return []
        q = -0.5 * (b + math.copysign(math.sqrt(square), b))
        roots = [q / a if a != 0.0 else math.nan, c / q if q != 0.0 else math.nan]
        return [u for u in roots if 0.0 < u < 1.0]

    @property
    def lowest(self) -> float:
        """Lowest displacement on the path, m."""
        return min(self.start, self.end, *(self.at(u)[0] for u in self.turns))


def last_true(holds: Callable[[float], bool], begin: float = 0.0, finish: float = 1.0) -> float:
    """Return the last fraction of a condition that is true at `begin` and false at `finish`.

    >>> round(last_true(lambda u: u < 0.3), 12)
    0.3
    """
    near, far = begin, finish
    for _ in range(HALVINGS):
        middle = 0.5 * (near + far)
        near, far = (middle, far) if holds(middle) else (near, middle)
        if math.isclose(near, far, rel_tol=1e-15, abs_tol=0.0):
            break
    return near

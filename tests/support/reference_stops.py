"""Stops of the reference of structures: their laws, joint impulses, and the records of contacts."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from support.reference_bodies import Floats


@dataclass(frozen=True)
class Stop:
    """A stop; `shape` (modes,) is the shape of its contact point, kg^(-1/2), `side` +1 upper, -1 lower."""

    shape: Floats
    position: float
    restitution: float = 1.0
    side: int = 1
    law: str = "restitution"
    stiffness: float = 0.0
    damping: float = 0.0
    exponent: float = 1.5

    @property
    def normal(self) -> Floats:
        return self.side * self.shape

    @property
    def compliant(self) -> bool:
        return self.law != "restitution"

    def raw_force(self, penetration: Floats | float, rate: Floats | float) -> Floats:
        """Return the force of the law before it is cut at zero (equations.md 6.9, 6.10), N."""
        if self.law == "kelvin_voigt":
            return np.asarray(self.stiffness * penetration + self.damping * rate)
        power = 1.5 if self.law == "hertz" else self.exponent
        loss = 0.0 if self.law == "hertz" else self.damping
        spring = self.stiffness * np.maximum(penetration, 0.0) ** power
        result: Floats = spring * (1.0 + loss * rate)
        return result

    def pressing(self, penetration: Floats | float, rate: Floats | float) -> Floats:
        """Return a quantity with the sign of the force: the force itself is flat at its zero for the power laws."""
        if self.law == "kelvin_voigt":
            return self.raw_force(penetration, rate)
        loss = 0.0 if self.law == "hertz" else self.damping
        return np.asarray(np.minimum(penetration, 1.0 + loss * rate))


@dataclass(frozen=True)
class Forcing:
    """force cos(angular_frequency t + phase) + held, modal, shape (modes,) each."""

    force: Floats
    angular_frequency: float = 1.0
    phase: float = 0.0
    held: Floats | float = 0.0


@dataclass(frozen=True)
class Impact:
    time: float
    velocity: float
    impulse: float
    contact: int


@dataclass
class Stick:
    start: float
    contact: int
    end: float = math.nan


@dataclass
class Press:
    """A compliant contact: times and velocities (into the stop, away from it) at its two ends."""

    start: float
    velocity_in: float
    contact: int
    end: float = math.nan
    velocity_out: float = math.nan


def complementary(matrix: Floats, offset: Floats, tolerance: float = 1e-13) -> Floats:
    """Return P >= 0 with w = offset + matrix P >= 0 and P . w = 0, by trying all sets of contacts.

    >>> complementary(np.array([[1.0, 0.5], [0.5, 1.0]]), np.array([-1.0, 2.0]))
    array([1., 0.])
    """
    count = len(offset)
    size = float(np.abs(offset).max(initial=0.0))
    for number in range(count + 1):
        for chosen in combinations(range(count), number):
            own = list(chosen)
            answer = np.zeros(count)
            answer[own] = np.linalg.lstsq(matrix[np.ix_(own, own)], -offset[own], rcond=None)[0]
            slack = offset + matrix @ answer
            if (answer >= 0.0).all() and (slack >= -tolerance * size).all():
                return answer
    raise AssertionError(f"no complementary solution for {matrix} and {offset}")


def first_rise(
    at: Callable[[float], float], u: Floats, values: Floats, start: float, end: float
) -> float | None:
    """Return the first rise through zero in [start, end]; peaks between samples are checked too."""
    for i in range(1, len(u)):
        if values[i - 1] < 0.0 <= values[i]:
            root = (
                float(brentq(at, u[i - 1], u[i], xtol=1e-15, rtol=8.9e-16))
                if values[i] > 0.0
                else float(u[i])
            )
            if start <= root <= end:
                return root
        elif i + 1 < len(u) and values[i] < 0.0 and values[i - 1] <= values[i] >= values[i + 1]:
            peak = minimize_scalar(
                lambda x: -at(x), bounds=(u[i - 1], u[i + 1]), method="bounded", options={"xatol": 1e-13}
            )
            if peak.fun < 0.0 and at(u[i - 1]) < 0.0:
                root = float(brentq(at, u[i - 1], peak.x, xtol=1e-15, rtol=8.9e-16))
                if start <= root <= end:
                    return root
    return None

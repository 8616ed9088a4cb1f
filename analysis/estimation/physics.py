"""Known and unknown numbers of an oscillator that hits a stop, and the coordinates in which its equation is linear.

The equation y'' + 2 zeta wn y' + wn^2 (y - y0) = wn^2 y_st cos(Omega t + psi) holds for y below the stop y_s. It is per
unit mass, in the unit of the displacement. At the stop the velocity V becomes -r V, with the restitution r. The damping
ratio is zeta, the natural angular frequency wn, the offset y0 (reading of the channel at rest). The static deflection
is y_st; Omega and psi are frequency and phase of the force.

Stiffness wn^2, drag 2 zeta wn, force wn^2 y_st (cos psi, sin psi) and rest force wn^2 y0 enter the equation linearly.
Motion that hardly determines the stiffness leaves a valley of good fits. The valley is straight in these coordinates
and bent in the physical parameters: searches and intervals follow it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.core import Oscillator

Floats = NDArray[np.float64]

_STEP = 1e-6
_WITHOUT_STIFFNESS = ("restitution", "stop_position", "angular_frequency")
_DRAWS = 12
"""Draws of an interval, as a power of 2."""


@dataclass(frozen=True, slots=True)
class Forcing:
    """The harmonic force, on the clock of the recording: wn^2 static_deflection cos(angular_frequency t + phase).

    Attributes
    ----------
    angular_frequency : float
        rad/s.
    static_deflection : float or None
        Force amplitude over stiffness, in the unit of the displacement; None: unknown, estimated.
    phase : float or None
        At time 0 of the recording, rad; None: unknown, estimated.
    clock_drifts : bool
        The clocks of the recording and of the generator disagree: the angular frequency is only a start value.
    """

    angular_frequency: float
    static_deflection: float | None = None
    phase: float | None = None
    clock_drifts: bool = False


@dataclass(frozen=True, slots=True)
class Known:
    """Known values, which are held instead of estimated; None: unknown.

    Attributes
    ----------
    damping_ratio : float or None
    natural_frequency : float or None
        Angular, rad/s.
    stop_position : float or None
        In the unit of the displacement.
    offset : float or None
        Reading of the channel at rest, in the unit of the displacement.
    side : str or None
        `upper` or `lower`; None: the signal decides.
    """

    damping_ratio: float | None = None
    natural_frequency: float | None = None
    stop_position: float | None = None
    offset: float | None = 0.0
    side: str | None = None


@dataclass(frozen=True, slots=True)
class Parameters:
    """All numbers of the model; the stop is an upper stop (a lower stop is mirrored before)."""

    restitution: float
    damping_ratio: float
    natural_frequency: float
    angular_frequency: float
    """rad/s, like the natural frequency."""
    static_deflection: float
    """Unit of the displacement, like stop position and offset."""
    phase: float
    """rad."""
    stop_position: float
    offset: float = 0.0

    def oscillator(self) -> Oscillator:
        """Return the oscillator of unit mass with these parameters, about the offset."""
        stiffness = self.natural_frequency**2
        damping = 2.0 * self.damping_ratio * self.natural_frequency
        force = stiffness * self.static_deflection
        return Oscillator(1.0, damping, stiffness, force, self.angular_frequency)

    def phase_at(self, time: float) -> float:
        """Return the phase of the force at a time, rad."""
        return self.angular_frequency * time + self.phase

    def short_of_periods(self, duration: float) -> float:
        """Return the time from the end of a P(1,q) flight, which meets its own start, to whole periods, s."""
        period = 2.0 * math.pi / self.angular_frequency
        return max(1, round(duration / period)) * period - duration

    def acceleration(self, y: Floats, v: Floats, angle: Floats) -> Floats:
        """Return the acceleration for displacements from the offset and velocities; angle: Omega t, rad."""
        square = self.natural_frequency**2
        load = square * self.static_deflection * np.cos(angle + self.phase)
        found: Floats = load - 2.0 * self.damping_ratio * self.natural_frequency * v - square * y
        return found

    def values_of(self, names: Sequence[str]) -> Floats:
        """Return the numbers with these names, shape (name,)."""
        return np.array([getattr(self, name) for name in names])

    def with_values(self, names: Sequence[str], values: Sequence[float] | Floats) -> Parameters:
        """Return a copy with new numbers for some names."""
        changes: dict[str, Any] = {name: float(value) for name, value in zip(names, values, strict=True)}
        return replace(self, **changes)


def central_differences(
    function: Callable[[Floats], Floats], at: Floats, relative: float, size_of_zero: float = 1.0
) -> Floats:
    """Return the derivatives of a function by its arguments, shape (value, argument).

    The step is the `relative` share of an argument; an argument of 0 counts as `size_of_zero`.
    """
    columns = []
    for k, value in enumerate(at):
        step = np.zeros(len(at))
        step[k] = relative * (abs(value) or size_of_zero)
        columns.append((function(at + step) - function(at - step)) / (2.0 * step[k]))
    return np.array(columns).T


@dataclass(frozen=True, slots=True)
class Coordinates:
    """The linear coordinates of some of the parameters; the others are held."""

    names: tuple[str, ...]
    """Names of the free parameters."""
    held: Parameters
    """Values of the other parameters."""

    @property
    def both(self) -> bool:
        """Whether amplitude and phase of the force are both free."""
        return "static_deflection" in self.names and "phase" in self.names

    def of(self, p: Parameters) -> Floats:
        """Return the coordinates of parameters, in the order of the names."""
        square = p.natural_frequency**2
        force = square * p.static_deflection
        values = {
            "natural_frequency": square,
            "damping_ratio": 2.0 * p.damping_ratio * p.natural_frequency,
            "static_deflection": force * math.cos(p.phase) if self.both else force,
            "phase": force * math.sin(p.phase) if self.both else p.phase,
            "offset": square * p.offset,
        }
        return np.array([values.get(name, getattr(p, name)) for name in self.names])

    def parameters(self, values: Sequence[float] | Floats) -> Parameters | None:
        """Return the parameters of coordinates; None where the stiffness is not positive."""
        there, numbers = self.numbers(np.array([values], dtype=np.float64))
        return self.held.with_values(self.names, numbers[0]) if there[0] else None

    def numbers(self, values: Floats) -> tuple[NDArray[np.bool_], Floats]:
        """Return a mask of the coordinates with a positive stiffness, shape (row,), and the numbers of the names.

        Values and numbers have shape (row, name); numbers outside the mask are meaningless.
        """
        given = dict(zip(self.names, values.T, strict=True))
        square = given.get("natural_frequency", np.full(len(values), self.held.natural_frequency**2))
        there = square > 0.0
        square = np.where(there, square, 1.0)
        natural = np.sqrt(square)
        divisors = {"damping_ratio": 2.0 * natural, "static_deflection": square, "offset": square}
        found = {name: value / divisors.get(name, 1.0) for name, value in given.items()}
        if "natural_frequency" in given:
            found["natural_frequency"] = natural
        if self.both:
            cosine, sine = given["static_deflection"], given["phase"]
            found |= {"static_deflection": np.hypot(cosine, sine) / square, "phase": np.arctan2(sine, cosine)}
        return there, np.array([found[name] for name in self.names]).reshape(values.T.shape).T

    def derivative(self, p: Parameters) -> Floats:
        """Return d coordinates / d parameters, shape (name, name)."""
        at = p.values_of(self.names)
        return central_differences(lambda values: self.of(p.with_values(self.names, values)), at, _STEP)

    def intervals(
        self, p: Parameters, covariance: Floats, confidence: float
    ) -> Mapping[str, tuple[float, float]]:
        """Return intervals of parameters with normal coordinates: quantiles of draws, the same draws every time.

        The covariance, shape (name, name), is to first order. Parameters that contain the stiffness have no interval
        where the data do not exclude a stiffness of 0.
        """
        slope = self.derivative(p)
        values, vectors = np.linalg.eigh(slope @ covariance @ slope.T)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        there, drawn = self.numbers(self.of(p) + _normal_draws(len(self.names)) @ root.T)
        tail = 50.0 * (1.0 - confidence)
        open_ended = np.count_nonzero(~there) > 0.01 * tail * len(drawn)
        found = {}
        for name, cloud in zip(self.names, drawn[there].T, strict=True):
            if open_ended and name not in _WITHOUT_STIFFNESS:
                continue
            if name == "phase":
                cloud = p.phase + np.angle(np.exp(1j * (cloud - p.phase)))
            low, high = np.percentile(cloud, [tail, 100.0 - tail])
            found[name] = (float(low), float(high))
        return found


@lru_cache(maxsize=8)
def _normal_draws(count: int) -> Floats:
    """Return evenly spread normal numbers, shape (draw, count), symmetric about 0."""
    from scipy.stats import norm, qmc

    even = qmc.Sobol(count, scramble=False).random_base2(_DRAWS)[1:]
    half = norm.ppf(np.clip(even, 1e-9, 1.0 - 1e-9))
    found: Floats = np.concatenate([half, -half])
    return found

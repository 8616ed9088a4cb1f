"""Coordinates in which the equation of motion is linear, and intervals from them.

Stiffness wn^2, drag 2 zeta wn, force wn^2 y_st (cos psi, sin psi) and rest force wn^2 y0 enter the equation linearly.
Motion that hardly determines the stiffness leaves a valley, straight in these coordinates and bent in those that a
person asks for: searches go along it, and intervals follow it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.stats import norm, qmc

from vibroimpact.analysis.estimation.noise import Floats
from vibroimpact.analysis.estimation.physics import Parameters

_STEP = 1e-6
_WITHOUT_STIFFNESS = ("restitution", "stop_position", "angular_frequency")
_DRAWS = 12
"""Power of 2."""


@dataclass(frozen=True, slots=True)
class Coordinates:
    """The linear coordinates of some of the parameters; the others are held.

    Attributes
    ----------
    names : tuple of str
        Of `Parameters`: what is free.
    held : Parameters
        Values of the others.
    """

    names: tuple[str, ...]
    held: Parameters

    @property
    def _both(self) -> bool:
        """Amplitude and phase of the force are both free."""
        return "static_deflection" in self.names and "phase" in self.names

    def of(self, p: Parameters) -> Floats:
        """Return the coordinates of parameters, in the order of the names."""
        square = p.natural_frequency**2
        force = square * p.static_deflection
        values = {
            "natural_frequency": square,
            "damping_ratio": 2.0 * p.damping_ratio * p.natural_frequency,
            "static_deflection": force * math.cos(p.phase) if self._both else force,
            "phase": force * math.sin(p.phase) if self._both else p.phase,
            "offset": square * p.offset,
        }
        return np.array([values.get(name, getattr(p, name)) for name in self.names])

    def parameters(self, values: Sequence[float] | Floats) -> Parameters | None:
        """Return the parameters of coordinates; None where the stiffness is not positive."""
        given: dict[str, Any] = {name: float(value) for name, value in zip(self.names, values, strict=True)}
        square = given.get("natural_frequency", self.held.natural_frequency**2)
        if not square > 0.0:
            return None
        natural = math.sqrt(square)
        changes = dict(given)
        if "natural_frequency" in given:
            changes["natural_frequency"] = natural
        if "damping_ratio" in given:
            changes["damping_ratio"] = given["damping_ratio"] / (2.0 * natural)
        if self._both:
            cosine, sine = given["static_deflection"], given["phase"]
            changes["static_deflection"] = math.hypot(cosine, sine) / square
            changes["phase"] = math.atan2(sine, cosine)
        elif "static_deflection" in given:
            changes["static_deflection"] = given["static_deflection"] / square
        if "offset" in given:
            changes["offset"] = given["offset"] / square
        return replace(self.held, **changes)

    def derivative(self, p: Parameters) -> Floats:
        """Return d coordinates / d parameters, shape (name, name)."""
        columns = []
        for name in self.names:
            step = _STEP * (abs(getattr(p, name)) or 1.0)
            high, low = (
                self.of(replace(p, **{name: getattr(p, name) + sign * step})) for sign in (1.0, -1.0)
            )
            columns.append((high - low) / (2.0 * step))
        return np.array(columns).T

    def intervals(
        self, p: Parameters, covariance: Floats, confidence: float
    ) -> Mapping[str, tuple[float, float]]:
        """Return intervals of parameters whose coordinates are normal: parts of draws, the same draws every time.

        Parameters
        ----------
        p : Parameters
            The estimate.
        covariance : ndarray, shape (name, name)
            Of the parameters, to first order.
        confidence : float

        Returns
        -------
        mapping of str to (float, float)
            Lower and upper end; none of what the stiffness is in, where the data do not exclude a stiffness of 0.
        """
        slope = self.derivative(p)
        values, vectors = np.linalg.eigh(slope @ covariance @ slope.T)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        drawn = [self.parameters(self.of(p) + root @ one) for one in _normal_draws(len(self.names))]
        tail = 50.0 * (1.0 - confidence)
        open_ended = sum(one is None for one in drawn) > 0.01 * tail * len(drawn)
        found = {}
        for name in self.names:
            if open_ended and name not in _WITHOUT_STIFFNESS:
                continue
            middle = getattr(p, name)
            cloud = np.array([getattr(one, name) for one in drawn if one is not None])
            if name == "phase":
                cloud = middle + np.angle(np.exp(1j * (cloud - middle)))
            low, high = np.percentile(cloud, [tail, 100.0 - tail])
            found[name] = (float(low), float(high))
        return found


@lru_cache(maxsize=8)
def _normal_draws(count: int) -> Floats:
    """Return evenly spread normal numbers, shape (draw, count), symmetric about 0."""
    even = qmc.Sobol(count, scramble=False).random_base2(_DRAWS)[1:]
    half = norm.ppf(np.clip(even, 1e-9, 1.0 - 1e-9))
    found: Floats = np.concatenate([half, -half])
    return found

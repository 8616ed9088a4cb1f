"""The flow of an impacting body by matrix exponentials, beside that of orbits and of runs."""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm

from vibroimpact.analysis.orbits import ImpactingBody, PeriodicOrbit


class Flow:
    """The flow of a body by matrix exponentials of (x, v, 1, cos and sin of each harmonic)."""

    def __init__(self, body: ImpactingBody) -> None:
        self.body, n = body, body.frequencies.size
        harmonics = list(body.harmonics.items())
        size = 2 * n + 1 + 2 * len(harmonics)
        matrix = self.matrix = np.zeros((size, size))
        drag = (
            np.diag(2.0 * body.damping_ratios * body.frequencies) if body.coupling is None else body.coupling
        )
        matrix[:n, n : 2 * n] = np.eye(n)
        matrix[n : 2 * n, :n], matrix[n : 2 * n, n : 2 * n] = -np.diag(body.frequencies**2), -drag
        matrix[n : 2 * n, 2 * n] = body.held
        for k, (order, force) in enumerate(harmonics):
            cosine = 2 * n + 1 + 2 * k
            w = order * body.angular_frequency
            matrix[n : 2 * n, cosine], matrix[n : 2 * n, cosine + 1] = force.real, -force.imag
            matrix[cosine, cosine + 1], matrix[cosine + 1, cosine] = -w, w

    def fly(self, state: np.ndarray, phase: float, u: float) -> np.ndarray:
        """Return the state after a flight of u seconds from a phase of the clock."""
        waves = [(np.cos(n * phase), np.sin(n * phase)) for n in self.body.harmonics]
        start = np.concatenate([state, [1.0], np.ravel(waves)])
        end: np.ndarray = expm(self.matrix * u) @ start
        return end[: state.size]

    def gap(self, contact: int, state: np.ndarray, phase: float, derivative: int) -> float:
        """Return the distance beyond a stop, or the speed towards it relative to it."""
        stop, n, w = self.body.contacts[contact], self.body.frequencies.size, self.body.angular_frequency
        moved = sum(
            (a * (1j * order * w) ** derivative * np.exp(1j * order * phase)).real
            for order, a in stop.motion.items()
        )
        at = stop.shape @ state[derivative * n : (derivative + 1) * n]
        return float(stop.direction * (at - moved - (stop.position if derivative == 0 else 0.0)))

    def struck(self, contact: int, state: np.ndarray, phase: float) -> np.ndarray:
        """Return the state after an impact."""
        stop, n, after = self.body.contacts[contact], self.body.frequencies.size, state.copy()
        speed = self.gap(contact, state, phase, 1)
        after[n:] -= (1.0 + stop.restitution_at(abs(speed))) * speed * stop.direction * stop.mass * stop.shape
        return after


def state_at_phase_0(orbit: PeriodicOrbit) -> np.ndarray:
    """Return modal displacements and velocities where the phase of the clock is 0, after the last impact."""
    last = float(orbit.phases[-1])
    length = (2.0 * np.pi * orbit.periods - last) / orbit.body.angular_frequency
    return Flow(orbit.body).fly(orbit.states[-1], last, length)

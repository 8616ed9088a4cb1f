"""The motion of a body without impacts, and the states from which no stop can be met any more."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.bodies.impacting_body import Floats, ImpactingBody
from vibroimpact.orchestrator.orbits.bodies import modal_displacements
from vibroimpact.orchestrator.orbits.further_sines import FurtherSines
from vibroimpact.orchestrator.scene import Scene

MOST_CONDITION = 1e8
"""Condition of the free motions above which they bound nothing: modes at critical damping."""


@dataclass(frozen=True, eq=False)
class FreeMotion:
    """The steady motion without impacts, and bounds of the free motions beside it.

    A free motion is a sum of c e^(rate t). It stays within the sum of |c| times its shape at a contact. No stop is met
    any more once this sum is smaller than the distance of the steady motion from the stop, at every stop.
    """

    state: Floats
    """Steady state at phase 0 of the clock, in the coordinates of the scene's start, shape (variable,)."""
    clearances: Floats
    """Smallest distance of the steady motion from each stop, shape (contact,), m; positive."""
    turning: NDArray[np.complex128]
    """Complex amplitudes of the steady state under each further sine, shape (sine, variable)."""
    to_motions: NDArray[np.complex128]
    """Coefficients c of the free motions for a unit of each variable of the start, shape (motion, variable)."""
    reach: Floats
    """Displacement of each contact for a unit of each coefficient, shape (contact, motion)."""

    @classmethod
    def of(cls, scene: Scene, body: ImpactingBody, sines: FurtherSines) -> Self | None:
        """Return the free motion of a scene's body; None where it hits a stop, or does not die away."""
        clearances = _clearances(body, sines) if not body.loose and body.slowest_decay > 0.0 else np.zeros(1)
        if not (np.isfinite(clearances) & (clearances > 0.0)).all():
            return None
        rates, vectors = _motions(body)
        if not np.isfinite(rates).all() or np.linalg.cond(vectors) > MOST_CONDITION:
            return None
        modes = body.frequencies.size
        to_modal = modal_displacements(scene, np.eye(modes)).T  # of unit displacements, in columns
        scaled = np.block(
            [
                [np.diag(body.frequencies) @ to_modal, np.zeros_like(to_modal)],
                [np.zeros_like(to_modal), to_modal],
            ]
        )
        shapes = np.array([contact.shape for contact in body.contacts]) / body.frequencies
        steady = {n: body.steady(n * body.angular_frequency, f) for n, f in body.harmonics.items()}
        displacement = body.levels + sum(each.real for each in steady.values())
        velocity = sum((1j * n * body.angular_frequency * each).real for n, each in steady.items())
        state = np.concatenate([np.linalg.solve(to_modal, displacement), np.linalg.solve(to_modal, velocity)])
        moved = _steady(body, sines)
        moving = np.concatenate([moved, 1j * sines.rates[:, None] * moved], axis=1)
        turning = np.linalg.solve(np.kron(np.eye(2), to_modal), moving.T).T
        return cls(
            state,
            clearances,
            turning,
            np.linalg.solve(vectors, scaled).astype(np.complex128),
            np.abs(shapes @ vectors[:modes]),
        )

    def stays_free(self, states: Floats) -> NDArray[np.bool_]:
        """Return a mask of the states at phase 0, shape (state, variable), from which no stop can be met."""
        count = self.state.size
        turned = (np.exp(1j * states[:, count:]) @ self.turning).real
        sizes = np.abs((states[:, :count] - self.state - turned) @ self.to_motions.T)
        return np.asarray((sizes @ self.reach.T < self.clearances).all(axis=1))


def _steady(body: ImpactingBody, sines: FurtherSines) -> NDArray[np.complex128]:
    """Return the steady displacements of the modes under each further sine, shape (sine, mode), kg^(1/2) m."""
    each = [body.steady(float(rate), load) for rate, load in zip(sines.rates, sines.loads, strict=True)]
    return np.array(each, dtype=np.complex128).reshape(-1, body.frequencies.size)


def _clearances(body: ImpactingBody, sines: FurtherSines) -> Floats:
    """Return the distance between each stop and the farthest displacement of the steady motion, shape (contact,), m."""
    found = []
    for contact in body.contacts:
        room = contact.direction * (contact.position - float(contact.shape @ body.levels))
        for order, force in body.harmonics.items():
            moved = contact.shape @ body.steady(order * body.angular_frequency, force)
            room -= abs(complex(moved) - contact.motion.get(order, 0.0))
        room -= float(np.abs(_steady(body, sines) @ contact.shape).sum())
        found.append(room)
    return np.array(found)


def _motions(body: ImpactingBody) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return rates, 1/s, and vectors (w q, q') in columns, of the free motions."""
    if body.coupling is not None:
        return body.complex_modes
    spring = np.diag(body.frequencies)
    damping = np.diag(2.0 * body.damping_ratios * body.frequencies)
    motion = np.block([[np.zeros_like(spring), spring], [-spring, -damping]])
    rates, vectors = np.linalg.eig(motion)
    return rates.astype(np.complex128), vectors.astype(np.complex128)

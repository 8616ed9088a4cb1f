"""Feedback through the forcing amplitude that keeps an orbit with one impact: equations.md 4.1, 4.12."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from vibroimpact.analysis.orbits.periodic import OrbitError, PeriodicOrbit
from vibroimpact.fmus.bodies.impacting_body import Floats

Law = Literal["ogy", "deadbeat", "newton"]
LAWS: tuple[Law, ...] = ("ogy", "deadbeat", "newton")


@dataclass(frozen=True, eq=False)
class ImpactMap:
    """The map of impacts, linear about an orbit P(1,q): (t, V) at an impact leads to (t, V) at the next."""

    jacobian: Floats
    """Derivative by (t, V): s, m/s; shape (2, 2)."""
    response: Floats
    """Derivative by the forcing amplitude: s/N, (m/s)/N; shape (2,)."""

    @property
    def multipliers(self) -> np.ndarray[tuple[int], np.dtype[np.complex128]]:
        """Multipliers of the orbit, the largest first."""
        found = np.linalg.eigvals(self.jacobian).astype(np.complex128)
        return found[np.argsort(-np.abs(found), kind="stable")]


def impact_map(orbit: PeriodicOrbit, amplitude: float) -> ImpactMap:
    """Return the impact map of a one-mode body about an orbit P(1,q).

    Parameters
    ----------
    orbit : PeriodicOrbit
    amplitude : float
        Forcing amplitude of the body's force, N.

    Raises
    ------
    OrbitError
        The orbit has several impacts, or the body several modes or sines, or a moving stop.
    """
    from scipy.linalg import expm

    body = orbit.body
    if orbit.phases.size != 1 or body.frequencies.size != 1:
        raise OrbitError(
            f"control: expected an orbit of one impact and one mode, got {orbit.name} of {body.frequencies.size}."
        )
    if not body.has_one_sine:
        raise OrbitError(
            "control: expected one sine and stops that do not move, got several sines or a moving stop."
        )
    contact = body.contacts[int(orbit.contacts[0])]
    natural, decay = float(body.frequencies[0]), float(body.damping_ratios[0] * body.frequencies[0])
    # in the direction of the stop, as a displacement of the contact
    toward = contact.direction * float(contact.shape[0])
    force, held = toward * float(body.force[0]), toward * float(body.held[0])
    stop, phase, w = contact.direction * contact.position, float(orbit.phases[0]), body.angular_frequency
    speed, length = float(orbit.velocities[0]), orbit.periods * body.period
    phi = expm(length * np.array([[0.0, 1.0], [-(natural**2), -2.0 * decay]]))

    def acceleration(velocity: float) -> float:
        return force * math.cos(phase) + held - natural**2 * stop - 2.0 * decay * velocity

    back, slope = float(contact.restitution_at(speed)), float(contact.restitution_slope(speed))
    after, before = acceleration(-back * speed), acceleration(speed)
    first = (phi[0, 1] * after + back * speed * (-phi[0, 0])) / speed
    second = slope * phi[0, 1] / speed
    jacobian = np.array(
        [
            [first, second],
            [
                back * speed * phi[1, 0] - phi[1, 1] * after + before * first,
                -slope * phi[1, 1] + before * second,
            ],
        ]
    )
    pushed = _forced(natural, decay, force / amplitude, w, phase, length)
    response = np.array([-pushed[0] / speed, pushed[1] - before * pushed[0] / speed])
    return ImpactMap(jacobian, response)


def _forced(natural: float, decay: float, force: float, w: float, phase: float, length: float) -> Floats:
    """Return displacement and velocity after `length` s from rest, under force cos(w t + phase)."""
    from scipy.linalg import expm

    oscillator = np.array(
        [
            [0.0, 1.0, 0.0, 0.0],
            [-(natural**2), -2.0 * decay, force, 0.0],
            [0.0, 0.0, 0.0, -w],
            [0.0, 0.0, w, 0.0],
        ]
    )
    found: Floats = (expm(length * oscillator) @ np.array([0.0, 0.0, np.cos(phase), np.sin(phase)]))[:2]
    return found


def gains(law: Law, about: ImpactMap) -> Floats:
    """Return the gains of a law: correction = -gains . (t - t*, V - V*).

    Parameters
    ----------
    law : {"ogy", "deadbeat", "newton"}
        `ogy`, `newton`: the next impact lies on the direction of faster return; no correction for a stable complex
        pair. `deadbeat`: two impacts later the orbit is reached.
    about : ImpactMap

    Returns
    -------
    array, shape (2,)
        N/s, N/(m/s).

    Raises
    ------
    OrbitError
        The amplitude has no effect on the component that it must change.
    """
    largest = about.multipliers[0]
    if law == "deadbeat" or (largest.imag != 0.0 and abs(largest) >= 1.0):
        return _deadbeat(about)
    if largest.imag != 0.0:
        return np.zeros(2)
    found, left = np.linalg.eig(about.jacobian.T)
    row = np.real(left[:, int(np.argmax(np.abs(found)))])
    acts = float(row @ about.response)
    if acts == 0.0:
        raise _no_effect()
    gain: Floats = float(largest.real) * row / acts
    return gain


def _deadbeat(about: ImpactMap) -> Floats:
    """Return Ackermann's gains for two multipliers of 0."""
    reach = np.column_stack([about.response, about.jacobian @ about.response])
    if np.linalg.cond(reach) > 1.0 / np.finfo(float).eps:
        raise _no_effect()
    gain: Floats = np.linalg.solve(reach.T, np.array([0.0, 1.0])) @ about.jacobian @ about.jacobian
    return gain


def _no_effect() -> OrbitError:
    return OrbitError("control: expected an orbit that the amplitude acts on, got one that it does not.")

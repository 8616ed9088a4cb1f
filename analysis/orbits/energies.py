"""Energies of the modes on an orbit: gains and losses by force, damping and impacts: thesis 6.3, equations.md 5.3-5.6.

An impact changes the velocity of every mode, so energy passes between modes, and some is lost. The residual energy of
a mode is the work of the force on it minus its damping loss, over the orbit. The sum over the modes is the loss at the
impacts (thesis 6.32).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vibroimpact.analysis.orbits.flight_work import FlightWork, coupled_flight_work, flight_work
from vibroimpact.analysis.orbits.periodic import TURN, PeriodicOrbit
from vibroimpact.fmus.bodies.impacting_body import Contact, Floats
from vibroimpact.fmus.errors import UsageError


def velocity_transfer(contact: Contact) -> Floats:
    """Return the matrix by which an impact multiplies the modal velocities: [R^] of thesis (6.25), (6.40).

    Parameters
    ----------
    contact : Contact

    Returns
    -------
    array, shape (modes, modes)
        I - (1 + r) phi phi' / (phi . phi), with determinant -r, for mass-normalised modes. Where r falls with speed, r
        is that of slow impacts.

    Examples
    --------
    The thesis's chain of two masses:

    >>> angle = np.arctan((1.0 + np.sqrt(5.0)) / 2.0)
    >>> tip = Contact(np.array([np.sin(angle), -np.cos(angle)]), 1.0, 0.1, 0.7)
    >>> print(velocity_transfer(tip).round(6))
    [[-0.230132  0.760263]
     [ 0.760263  0.530132]]
    """
    return _removed(contact, 1.0 + contact.restitution)


def energy_transfer(contact: Contact) -> Floats:
    """Return the matrix R* of the kinetic energy after an impact, half of q'. R* q' before it: thesis (6.27), (6.39).

    Parameters
    ----------
    contact : Contact

    Returns
    -------
    array, shape (modes, modes)
        I - (1 - r^2) phi phi' / (phi . phi): symmetric, with eigenvalues 1 and, once, r^2. It describes the energy of
        all modes together: an entry on its diagonal is not the share that a mode keeps.

    Examples
    --------
    In the printed matrix (6.39) the first entry has the wrong sign, and the last is psi_22^2 (1 + r^2):

    >>> angle = np.arctan((1.0 + np.sqrt(5.0)) / 2.0)
    >>> tip = Contact(np.array([np.sin(angle), np.cos(angle)]), 1.0, 0.1, 0.7)
    >>> print(energy_transfer(tip).round(6))
    [[ 0.630961 -0.228079]
     [-0.228079  0.859039]]
    """
    return _removed(contact, 1.0 - contact.restitution**2)


def _removed(contact: Contact, factor: float) -> Floats:
    shape = contact.shape
    return np.eye(shape.size) - factor * contact.mass * np.outer(shape, shape)


@dataclass(frozen=True, slots=True)
class ResidualRestitution:
    """Coefficient of restitution from energies: thesis (6.38), (6.41).

    Attributes
    ----------
    value : float
        sqrt(1 - residual / kinetic); NaN where the energies contradict each other.
    slope : float
        Derivative of the value by the residual energy, 1/J: -1 / (2 r kinetic), unbounded as r goes to 0.
    problem : str
        Reason why there is no value: 0 <= residual <= kinetic does not hold. Empty if it does.
    """

    value: float
    slope: float
    problem: str = ""


def residual_restitution(residual: float, kinetic: float) -> ResidualRestitution:
    """Return the restitution at which impacts lose the residual energy of all modes: equations.md 5.6.

    Parameters
    ----------
    residual : float
        Work of the force minus loss to damping, over the orbit, all modes together, J.
    kinetic : float
        Half of contact mass times squared velocity before the impact, summed over the impacts of the orbit, J. With
        several impacts the restitution is a mean, weighted with this energy.

    Raises
    ------
    UsageError
        An energy is no number, or there is no kinetic energy.

    Examples
    --------
    >>> residual_restitution(5.1, 10.0).value.__round__(12)
    0.7
    >>> print(residual_restitution(11.0, 10.0).problem)
    residual energy 11 J is more than the impacts have, 10 J: data or contact mass are wrong
    """
    if not (np.isfinite(residual) and np.isfinite(kinetic) and kinetic > 0.0):
        raise UsageError(
            f"restitution: expected a residual energy and a kinetic energy > 0, J, got {residual:g} and {kinetic:g}."
        )
    # rounding of the sums for an elastic impact, or for one that keeps nothing
    slack = 1e-12 * kinetic
    if residual > kinetic + slack:
        return ResidualRestitution(
            np.nan,
            np.nan,
            f"residual energy {residual:.6g} J is more than the impacts have, {kinetic:.6g} J: "
            "data or contact mass are wrong",
        )
    if residual < -slack:
        return ResidualRestitution(
            np.nan,
            np.nan,
            f"residual energy {residual:.6g} J is negative: impacts would give energy; data are wrong",
        )
    value = float(np.sqrt(max(1.0 - max(residual, 0.0) / kinetic, 0.0)))
    return ResidualRestitution(value, -0.5 / (value * kinetic) if value > 0.0 else -np.inf)


@dataclass(frozen=True, eq=False)
class OrbitEnergies:
    """Energies of the modes over one orbit, all in J; each impact precedes the flight with its number.

    Attributes
    ----------
    orbit : PeriodicOrbit
    """

    orbit: PeriodicOrbit

    @cached_property
    def _after(self) -> tuple[Floats, Floats]:
        """Displacements and velocities of the modes just after each impact."""
        modes = self.orbit.body.frequencies.size
        return self.orbit.states[:, :modes], self.orbit.states[:, modes:]

    @cached_property
    def _speed_before(self) -> Floats:
        """Velocities of the modes just before each impact: equations.md 5.3."""
        orbit = self.orbit
        jump = np.empty_like(self._after[1])
        for place, (number, speed) in enumerate(zip(orbit.contacts, orbit.velocities, strict=True)):
            contact = orbit.body.contacts[number]
            jump[place] = (
                -(1.0 + contact.restitution_at(speed))
                * speed
                * contact.direction
                * contact.mass
                * contact.shape
            )
        return np.asarray(self._after[1] - jump)

    @cached_property
    def _potential(self) -> Floats:
        return np.asarray(0.5 * (self.orbit.body.frequencies * self._after[0]) ** 2)

    @cached_property
    def before(self) -> Floats:
        """Energy of each mode just before each impact, shape (p, modes)."""
        return np.asarray(self._potential + 0.5 * self._speed_before**2)

    @cached_property
    def after(self) -> Floats:
        """Energy of each mode just after each impact, shape (p, modes)."""
        return np.asarray(self._potential + 0.5 * self._after[1] ** 2)

    @cached_property
    def change(self) -> Floats:
        """Change of the energy of each mode at each impact, dE_j, shape (p, modes): equations.md 5.4."""
        return np.asarray(0.5 * (self._after[1] - self._speed_before) * (self._after[1] + self._speed_before))

    @cached_property
    def _work(self) -> FlightWork:
        orbit, body = self.orbit, self.orbit.body
        ends = np.append(orbit.phases[1:], orbit.phases[0] + TURN * orbit.periods)
        start = np.empty((*self._after[0].shape, 4))
        # a constant force shifts the rest position; its work over the orbit is zero
        tied = np.where(body.frequencies > 0.0, body.frequencies, np.inf)
        start[..., 0] = body.frequencies * self._after[0] - body.held / tied
        start[..., 1] = self._after[1]
        start[..., 2] = np.cos(orbit.phases)[:, None] * body.force
        start[..., 3] = np.sin(orbit.phases)[:, None] * body.force
        lengths = (ends - orbit.phases) / body.angular_frequency
        if body.coupling is not None:
            return coupled_flight_work(
                body.frequencies, body.coupling, body.angular_frequency, lengths, start
            )
        return flight_work(body.frequencies, body.damping_ratios, body.angular_frequency, lengths, start)

    @property
    def forcing(self) -> Floats:
        """Work of the harmonic force on each mode in each flight, FE_j, shape (p, modes)."""
        return self._work.forcing

    @property
    def damping(self) -> Floats:
        """Loss of each mode to damping in each flight, DE_j, shape (p, modes).

        Where the damping couples the modes, it also passes energy between them: the loss of a mode may be negative.
        """
        return self._work.damping

    @property
    def mean_kinetic(self) -> Floats:
        """Mean kinetic energy of each mode over the orbit, shape (modes,)."""
        orbit = self.orbit
        return np.asarray(0.5 * self._work.squared.sum(axis=0) / (orbit.periods * orbit.body.period))

    @cached_property
    def residual(self) -> Floats:
        """Residual energy of each mode over the orbit, FE_j - DE_j, shape (modes,)."""
        return np.asarray((self.forcing - self.damping).sum(axis=0))

    @cached_property
    def kinetic(self) -> Floats:
        """Energy before each impact, half of contact mass times squared velocity, shape (p,)."""
        hit = [self.orbit.body.contacts[number] for number in self.orbit.contacts]
        return np.asarray(0.5 * np.array([each.mass for each in hit]) * self.orbit.velocities**2)

    @cached_property
    def lost(self) -> Floats:
        """Loss at each impact, (1 - r^2) of the energy before it, shape (p,)."""
        orbit = self.orbit
        hit = [orbit.body.contacts[number] for number in orbit.contacts]
        kept = [each.restitution_at(speed) for each, speed in zip(hit, orbit.velocities, strict=True)]
        return np.asarray((1.0 - np.array(kept) ** 2) * self.kinetic)

    @property
    def restitution(self) -> ResidualRestitution:
        """The restitution according to the residual energy."""
        return residual_restitution(float(self.residual.sum()), float(self.kinetic.sum()))

    @property
    def identity_error(self) -> float:
        """Residual energy of all modes minus the loss at the impacts (thesis 6.32), over the energy before impacts."""
        return float(abs(self.residual.sum() - self.lost.sum()) / self.kinetic.sum())


def orbit_energies(orbit: PeriodicOrbit) -> OrbitEnergies:
    """Return the energies of the modes over an orbit.

    Parameters
    ----------
    orbit : PeriodicOrbit
        Stable or not, physical or not.

    Raises
    ------
    UsageError
        An impact of the orbit has no speed: at a graze no energy is exchanged. Or a constant force acts on a mode
        without a spring, several sines act, or a stop moves.

    Examples
    --------
    >>> from vibroimpact.analysis.orbits import ImpactingBody, closed_form
    >>> one = np.array([1.0])
    >>> stop = Contact(one, 1.0, 0.8, 0.75)
    >>> body = ImpactingBody(one, 0.04 * one, 0.45 * one, 0.0 * one, 1.1, 0.0, (stop,), one)
    >>> found = orbit_energies(closed_form(body)[0])
    >>> found.identity_error < 1e-12, round(found.restitution.value, 12)
    (True, 0.75)
    """
    if not (orbit.velocities > 0.0).all():
        raise UsageError("energies: expected impacts with a speed, got a graze.")
    if not orbit.body.has_one_sine:
        raise UsageError(
            "energies: expected one sine and stops that do not move, got several sines or a moving stop."
        )
    if orbit.body.held[: orbit.body.loose].any():
        raise UsageError("energies: expected no constant force on bodies without a spring, got one.")
    return OrbitEnergies(orbit)

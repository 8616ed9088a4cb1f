"""A body of modes with restitution stops, forced periodically: the input of the search for orbits."""

from __future__ import annotations

import cmath
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.core.contact_laws import numbered_contact_law
from vibroimpact.fmus.core.orbits import OrbitBody

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Integers = Mapping[str, int]
Numbers = Mapping[str, float]
DIRECTIONS = {1: 1.0, 2: -1.0}
"""Direction of a stop by the number of its side in FMUs: 1 is above, 2 below."""
FALLING = 0.75
"""Derivative of r(V) V over r(V) above the yield velocity, where r falls as V^(-1/4)."""

MOST_STEPS_OF_SPEED = 50
"""Largest number of Newton steps from the speed of equal impulse to the speed of an impact."""


LINEAR = "kelvin_voigt"
"""Name of the law of a spring and a dashpot."""


@dataclass(frozen=True, slots=True)
class Press:
    """The force of a stop that yields; it never pulls: equations.md 6.9, 6.10.

    Attributes
    ----------
    law : str
        `kelvin_voigt`: stiffness d + damping d'. `hertz`, `hunt_crossley`: stiffness d^exponent (1 + damping d').
    stiffness, damping : float
        N/m^exponent; N s/m, or s/m of a power law.
    exponent : float
    """

    law: str
    stiffness: float
    damping: float = 0.0
    exponent: float = 1.0

    @property
    def is_linear(self) -> bool:
        """Whether the force is a spring's and a dashpot's."""
        return self.law == LINEAR


@dataclass(frozen=True, eq=False)
class Contact:
    """A point of a body with a stop.

    Attributes
    ----------
    shape : array, shape (modes,)
        Displacement of the point for unit modal displacements, kg^(-1/2).
    direction : float
        +1: the stop is above, -1: below.
    position : float
        Mean position of the stop, m.
    restitution : float
        Coefficient of restitution, 0 to 1, of a rigid stop.
    motion : mapping of int to complex
        Complex amplitudes of the stop's motion, m, by their harmonic n: position + Re(amplitude e^(i n phase)).
    yield_velocity : float
        Speed above which the restitution falls as (V / yield_velocity)^(-1/4), m/s; 0: it is constant.
    name : str
        Name of a contact of two points, such as `contact 1`; empty for a stop.
    press : Press or None
        Force of a stop that yields; None: the stop is rigid.
    """

    shape: Floats
    direction: float
    position: float
    restitution: float
    motion: Mapping[int, complex] = field(default_factory=dict)
    yield_velocity: float = 0.0
    name: str = ""
    press: Press | None = None

    @cached_property
    def mass(self) -> float:
        """Effective mass at the contact, kg: 1 / (shape . shape), equations.md 5.3."""
        return 1.0 / float(self.shape @ self.shape)

    def restitution_at(self, speed: Floats | float) -> Floats:
        """Return the coefficient of restitution for speeds towards the stop, m/s: equations.md 1.6."""
        speeds = np.asarray(speed, dtype=np.float64)
        if not self.yield_velocity > 0.0:
            return np.full_like(speeds, self.restitution)
        with np.errstate(over="ignore"):  # a yield velocity next to 0 leaves no restitution
            return self.restitution / np.maximum(speeds / self.yield_velocity, 1.0) ** 0.25

    def restitution_slope(self, speed: Floats | float) -> Floats:
        """Return the derivative r + r' V of the speed after an impact over the speed V before it: equations.md 4.2."""
        falls = (self.yield_velocity > 0.0) & (np.asarray(speed) > self.yield_velocity)
        return np.where(falls, FALLING, 1.0) * self.restitution_at(speed)

    def speed_before(self, speed: Floats) -> Floats:
        """Return the speeds before impacts that leave with given speeds r V, m/s."""
        slow = speed / self.restitution
        return (
            slow * np.maximum(slow / self.yield_velocity, 1.0) ** (1.0 / 3.0)
            if self.yield_velocity > 0.0
            else slow
        )

    def speed_of(self, equal: float) -> float:
        """Return the speed whose impulse is that of another speed at the restitution of slow impacts, m/s: 4.7."""
        whole = 1.0 + self.restitution
        if not 0.0 < self.yield_velocity < equal:
            return equal
        speed = equal
        for _ in range(MOST_STEPS_OF_SPEED):  # Newton's method on a concave function converges from below
            over = (1.0 + float(self.restitution_at(speed))) * speed - whole * equal
            slope = 1.0 + float(self.restitution_slope(speed))
            speed -= over / slope
            if abs(over) <= 1e-15 * whole * equal:
                break
        return speed

    def stop_at(self, phase: float) -> float:
        """Return the position of the stop at a phase of the clock, m."""
        moved = sum((each * cmath.exp(1j * order * phase)).real for order, each in self.motion.items())
        return self.position + moved


@dataclass(frozen=True, eq=False)
class ImpactingBody:
    """A body of mass-normalised modes: q'' + 2 z w q' + w^2 q = force cos(phase) + held + further sines.

    Damping that couples the modes takes the place of 2 z w: a matrix. Modes without a spring (w = 0) come first. Orbits
    need them without damping: equations.md 4.7.

    Attributes
    ----------
    frequencies, damping_ratios : array, shape (modes,)
        Natural angular frequencies, rad/s, negative where the stiffness is; damping ratios, of the diagonal where the
        damping couples the modes.
    force, held : array, shape (modes,)
        Modal amplitude of the harmonic force, and modal constant force, N kg^(-1/2).
    angular_frequency, phase : float
        Angular frequency of the clock, rad/s; its phase at time 0, rad.
    contacts : tuple of Contact
    observed : array, shape (modes,)
        Shape of the point that figures show, kg^(-1/2).
    coupling : array, shape (modes, modes), or None
        Damping that couples the modes, 1/s, symmetric; None where each mode has its own.
    further : mapping of int to array, shape (modes,)
        Complex modal amplitudes of further sines, N kg^(-1/2), by their harmonic n: Re(amplitude e^(i n phase)).
    has_own_period : bool
        Whether neither force nor stop sets the period: the clock is that of an orbit (equations.md 4.16).
    drift : float or None
        Mean velocity of the observed point with the whole body, m/s, where nothing ties it to the ground; else None.
    unseen : mapping of int to complex
        Complex amplitudes of the observed point by the motion of such a whole under the force, m, by their harmonic.
    """

    frequencies: Floats
    damping_ratios: Floats
    force: Floats
    held: Floats
    angular_frequency: float
    phase: float
    contacts: tuple[Contact, ...]
    observed: Floats
    coupling: Floats | None = None
    further: Mapping[int, Complexes] = field(default_factory=dict)
    has_own_period: bool = False
    drift: float | None = None
    unseen: Mapping[int, complex] = field(default_factory=dict)

    @cached_property
    def harmonics(self) -> Mapping[int, Complexes]:
        """Complex modal amplitudes of all sines, N kg^(-1/2), by harmonic, ascending; 0 where only stops move."""
        orders = {1, *self.further, *(order for each in self.contacts for order in each.motion)}
        none = np.zeros(self.force.size, dtype=np.complex128)
        found = {order: np.asarray(self.further.get(order, none)) for order in sorted(orders)}
        found[1] = found[1] + self.force
        return found

    @property
    def has_one_sine(self) -> bool:
        """Whether the clock's force is the only motion with its period: no further sines, no moving stops."""
        return not self.further and not any(each.motion for each in self.contacts)

    @cached_property
    def yields(self) -> bool:
        """Whether one of its stops yields."""
        return any(each.press is not None for each in self.contacts)

    @cached_property
    def loose(self) -> int:
        """Number of modes without a spring."""
        return int(np.count_nonzero(self.frequencies == 0.0))

    @property
    def is_dragged(self) -> bool:
        """Whether a mode without a spring has damping, which orbits cannot take."""
        drag = self.damping_ratios[: self.loose] if self.coupling is None else self.coupling[: self.loose]
        return bool((drag != 0.0).any())

    @cached_property
    def levels(self) -> Floats:
        """Displacements of the modes under the constant force, kg^(1/2) m; 0 without a spring."""
        found = np.zeros(self.frequencies.size)
        found[self.loose :] = self.held[self.loose :] / self.stiffnesses[self.loose :]
        return found

    @cached_property
    def stiffnesses(self) -> Floats:
        """Stiffnesses of the modes, 1/s^2: their frequencies squared, with the signs of these."""
        return self.frequencies * np.abs(self.frequencies)

    @property
    def decay(self) -> float:
        """Sum of the decays of all modes, 1/s: free motion shrinks volumes of states at twice this rate."""
        return float((self.damping_ratios * np.abs(self.frequencies)).sum())

    @cached_property
    def slowest(self) -> float:
        """Smallest natural angular frequency of the modes with a spring, rad/s."""
        return float(np.abs(self.frequencies[self.loose :]).min())

    def with_period(self, period: float) -> Self:
        """Return the body with the period of an orbit, s, as its clock; no force and no stop has a period."""
        found = replace(self, angular_frequency=2.0 * np.pi / period)
        found.__dict__["kernel"] = self.kernel.with_frequency(found.angular_frequency)
        return found

    @property
    def period(self) -> float:
        """Period of the clock, s."""
        return 2.0 * np.pi / self.angular_frequency

    @cached_property
    def kernel(self) -> OrbitBody:
        """The body in the form that the C functions take."""
        shapes = np.array([contact.shape for contact in self.contacts])
        forces = np.array(list(self.harmonics.values()))
        stops = np.array([[each.motion.get(order, 0j) for each in self.contacts] for order in self.harmonics])
        return OrbitBody(
            self.angular_frequency,
            natural=self.frequencies,
            damping_ratio=self.damping_ratios,
            order=np.array(list(self.harmonics)),
            cosine=forces.real,
            sine=0.0 - forces.imag,
            held=self.held,
            shape=shapes,
            impulse=shapes * np.array([[contact.mass] for contact in self.contacts]),
            direction=np.array([contact.direction for contact in self.contacts]),
            position=np.array([contact.position for contact in self.contacts]),
            stop_cosine=stops.real,
            stop_sine=0.0 - stops.imag,
            restitution=np.array([contact.restitution for contact in self.contacts]),
            yield_velocity=np.array([contact.yield_velocity for contact in self.contacts]),
            coupling=self.coupling,
        )

    @cached_property
    def rates(self) -> Complexes:
        """Rates of the free motions e^(rate t) of the modes with springs, 1/s: equations.md 1.2, 4.7."""
        if self.coupling is None:
            natural, ratios = np.abs(self.frequencies[self.loose :]), self.damping_ratios[self.loose :]
            decay = natural * ratios
            swing = natural * np.sqrt(
                ratios.astype(np.complex128) ** 2 - np.sign(self.frequencies[self.loose :])
            )
            # the slow rate of an overdamped mode from the fast one: their difference would cancel
            fast = np.where(decay < 0.0, -decay + swing, -decay - swing)
            return np.concatenate([fast, self.stiffnesses[self.loose :] / fast])
        return self.complex_modes[0]

    @cached_property
    def complex_modes(self) -> tuple[Complexes, Complexes]:
        """Rates, 1/s, and vectors (w q, q') in columns, of modes with springs that the damping couples."""
        spring = np.diag(np.abs(self.frequencies[self.loose :]))
        damping = np.asarray(self.coupling)[self.loose :, self.loose :]
        back = np.diag(self.frequencies[self.loose :])
        motion = np.block([[np.zeros_like(spring), spring], [-back, -damping]])
        rates, vectors = np.linalg.eig(motion)
        return rates.astype(np.complex128), vectors.astype(np.complex128)

    @cached_property
    def slowest_decay(self) -> float:
        """Rate at which the free motion that lasts longest decays, 1/s; 0 or less where one does not decay.

        Modes without a spring do not count: no impact depends on their state (equations.md 4.7).
        """
        return -float(self.rates.real.max(initial=-np.inf))

    def steady(self, angular_frequency: float | Floats, force: Complexes | None = None) -> Complexes:
        """Return the steady displacements Re(q e^(i phase)) of the modes, kg^(1/2) m: equations.md 1.3, 4.7.

        Parameters
        ----------
        angular_frequency : float or array
            Angular frequency of the force, rad/s.
        force : array, shape (modes,), optional
            Complex modal amplitudes, N kg^(-1/2); by default those of the clock's force.

        Returns
        -------
        array, shape (..., modes)
            Infinite or NaN where an undamped mode is in resonance.
        """
        w = np.asarray(angular_frequency, dtype=np.float64)[..., None]
        force = np.asarray(self.force if force is None else force)
        with np.errstate(divide="ignore", invalid="ignore"):
            if self.coupling is None:
                drag = 2j * self.damping_ratios * np.abs(self.frequencies) * w
                return np.asarray(force / (self.stiffnesses - w**2 + drag))
        stiffness = (self.stiffnesses - w**2)[..., None] * np.eye(self.frequencies.size)
        try:
            answer = np.linalg.solve(stiffness + 1j * w[..., None] * self.coupling, force[:, None])
        except np.linalg.LinAlgError:
            return np.full((*w.shape[:-1], force.size), np.nan + 0j)
        return np.asarray(answer[..., 0])

    def shrinking(self, contacts: NDArray[np.integer], speeds: Floats) -> Floats:
        """Return r (r + r' V) of impacts, by which each shrinks volumes of states: equations.md 4.2.

        Parameters
        ----------
        contacts : array of int, shape (impact,)
            From 0.
        speeds : array, shape (impact,)
            V, m/s.
        """
        found = np.empty(speeds.size)
        for place, each in enumerate(self.contacts):
            own = contacts == place
            found[own] = each.restitution_at(speeds[own]) * each.restitution_slope(speeds[own])
        return found

    @cached_property
    def scale(self) -> float:
        """Size of the displacements at the contacts, m; rounding errors are relative to it."""
        w = self.angular_frequency
        size = sum(np.abs(self.steady(n * w, force)) for n, force in self.harmonics.items() if force.any())
        # a constant force moves a mode without a spring by about this much within a period
        size = size + np.where(self.frequencies == 0.0, np.abs(self.held), 0.0) / w**2
        if self.has_own_period:  # a constant force alone may set the size of a motion
            size = size + np.abs(self.levels)
        of_contacts = [
            abs(each.position) + sum(map(abs, each.motion.values())) + float(np.abs(each.shape * size).sum())
            for each in self.contacts
        ]
        return max(of_contacts)


def contacts_of(shapes: Iterable[Floats], numbers: Numbers, integers: Integers) -> tuple[Contact, ...]:
    """Return the contacts of given mass-normalised shapes, from the parameters of a body's FMU."""
    found = []
    for k, shape in enumerate(shapes, start=1):
        port = f"contact[{k}]"
        position, restitution = numbers[f"{port}.position"], numbers.get(f"{port}.restitution", 0.0)
        falls_above = numbers.get(f"{port}.yield_velocity", 0.0)
        side, press = DIRECTIONS[integers[f"{port}.side"]], _press_of(port, numbers, integers)
        found.append(Contact(shape, side, position, restitution, yield_velocity=falls_above, press=press))
    return tuple(found)


def _press_of(port: str, numbers: Numbers, integers: Integers) -> Press | None:
    """Return the force of the stop at a port; None where it is rigid."""
    law = numbered_contact_law(integers[f"{port}.law"])
    if law.stop != "yielding":
        return None
    exponent = numbers.get(f"{port}.exponent", 1.0 if law.name == LINEAR else 1.5)
    return Press(law.name, numbers[f"{port}.stiffness"], numbers.get(f"{port}.damping", 0.0), exponent)

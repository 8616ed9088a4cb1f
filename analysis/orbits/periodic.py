"""Periodic orbits of p impacts in q forcing periods, stable and unstable: equations.md 4.2, 4.3, 4.7."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.orbits.errors import OrbitError as OrbitError
from vibroimpact.analysis.orbits.observed_motion import observed_motion
from vibroimpact.analysis.orbits.own_period import equations, free_multipliers, is_unbounded, unknowns_of
from vibroimpact.analysis.orbits.yielding_stops.motion import Train, yielding_motion
from vibroimpact.fmus.bodies.impacting_body import Floats, ImpactingBody
from vibroimpact.fmus.core.orbits import Evaluation, OrbitEnd

TURN = 2.0 * np.pi
CLOSE = 32.0 * np.finfo(float).eps
"""Distance from the stops at the impacts, over the size of the motion, below which an orbit is found."""
SAME = 1e-7
"""Difference of phases, rad, below which they are equal."""
_MOST_SHOWN = 4
"""Largest number of impacts listed in one line."""
SLOW = 1e-8
"""Speed of an impact, over that of the force's motion, below which it grazes."""
NEXT_TO_BOUND = 0.9
"""Speed of an impact without a force, over the largest of the search, from which on it is next to that bound."""
TOUCHES = 1e-12
"""Distance beyond a stop, over the size of the motion, above which an orbit passes through it."""


@dataclass(frozen=True, eq=False, repr=False)
class PeriodicOrbit:
    """An orbit of a body, P(p,q): p impacts in q periods of the force.

    Without a force q is 1, and the clock of the body has the period of the orbit.

    Attributes
    ----------
    body : ImpactingBody
    periods : int
        q.
    phases : array, shape (p,)
        Forcing phases of the impacts, rad, ascending, the first in [0, 2 pi); without a force the first is 0.
    contacts : array of int, shape (p,)
        Contact of each impact, from 0.
    velocities : array, shape (p,)
        Speeds towards the stops, relative to them, before the impacts, m/s.
    start : array, shape (2 modes,), or None
        Where stops yield, the state before the first impact, or one near to it: a search begins there.
    """

    body: ImpactingBody
    periods: int
    phases: Floats
    contacts: NDArray[np.int32]
    velocities: Floats
    start: Floats | None = None

    @property
    def name(self) -> str:
        """P(p,q)."""
        return f"P({self.phases.size},{self.periods})"

    def __repr__(self) -> str:
        phases, speeds = (
            ", ".join(f"{each:.6g}" for each in column[:_MOST_SHOWN]) + ", ..." * (column.size > _MOST_SHOWN)
            for column in (self.phases, self.velocities)
        )
        period = f"period {self.period:.6g}; " if self.body.has_own_period else ""
        return f"<{self.full_name}, {self.stability}: {period}phases {phases}; velocities {speeds}>"

    @property
    def period(self) -> float:
        """Time after which the orbit repeats, s."""
        return self.periods * self.body.period

    @property
    def shift(self) -> float:
        """Shift of the observed point over the orbit, m, where nothing ties the body to the ground; else 0."""
        return self.period * (self.body.drift or 0.0)

    @property
    def stability(self) -> str:
        """`stable` or `unstable`."""
        return "stable" if self.is_stable else "unstable"

    @property
    def full_name(self) -> str:
        """P(p,q), with the stops and contacts of its impacts if there are several: `P(1,1) at stop 2`."""
        if len(self.body.contacts) < 2:
            return self.name
        places, counts = np.unique(self.contacts, return_counts=True)
        names = [self.body.contacts[place].name or f"stop {place + 1}" for place in places]
        if len(names) == 1:
            return f"{self.name} at {names[0]}"
        parts = (f"{count} at {name}" for name, count in zip(names, counts, strict=True))
        return f"{self.name}, {', '.join(parts)}"

    @cached_property
    def _motion(self) -> tuple[Floats, Floats]:
        if self.body.yields:
            return np.array([each.after for each in self.train.passages]), self.train.monodromy
        return self.body.kernel.motion(self.contacts, self.phases, self.periods, self.velocities)

    @cached_property
    def train(self) -> Train:
        """The contacts of an orbit on stops that yield: equations.md 4.18."""
        motion = yielding_motion(self.body)
        return motion.periodic(self.contacts, self.phases, self.periods, self.start)

    @property
    def states(self) -> Floats:
        """Modal displacements and velocities just after each impact, shape (p, 2 modes)."""
        return self._motion[0]

    @property
    def monodromy(self) -> Floats:
        """Derivative of the state after the first impact by the state q periods before: equations.md 4.2."""
        return self._motion[1]

    @cached_property
    def multipliers(self) -> NDArray[np.complex128]:
        """Floquet multipliers, the largest first, shape (2 modes,); NaN for a graze.

        Without a force the shape is (2 modes - 1,): the multiplier 1 of the motion along itself is left out.
        """
        own = self.body.has_own_period
        if not np.isfinite(self.monodromy).all():
            return np.full(self.monodromy.shape[0] - own, np.nan + 0j)
        found = self._split[0] if own else np.linalg.eigvals(self.monodromy).astype(np.complex128)
        return found[np.argsort(-np.abs(found), kind="stable")]

    @cached_property
    def _split(self) -> tuple[NDArray[np.complex128], float]:
        """Multipliers across the motion, and the multiplier along it."""
        body = self.body
        x, v = np.split(self.states[0], 2)
        damping = 2.0 * body.damping_ratios * np.abs(body.frequencies)
        drag = damping * v if body.coupling is None else np.asarray(body.coupling) @ v
        flow = np.concatenate([v, body.held - body.stiffnesses * x - drag])
        return free_multipliers(self.monodromy, flow, body.slowest)

    @property
    def multiplier_of_motion(self) -> float:
        """Multiplier of the motion along itself: 1 without a force, NaN with a force or for a graze."""
        is_known = self.body.has_own_period and np.isfinite(self.monodromy).all()
        return self._split[1] if is_known else float("nan")

    @property
    def determinant(self) -> float:
        """Determinant of the monodromy matrix; NaN for a graze."""
        if not np.isfinite(self.monodromy).all():
            return float("nan")
        return float(np.linalg.det(self.monodromy))

    @property
    def exact_determinant(self) -> float:
        """Product of r (r + r' V) of the impacts and of the decay of all modes over the orbit: equations.md 4.2."""
        body = self.body
        squared = np.prod(
            self.train.values("shrinking") if body.yields else body.shrinking(self.contacts, self.velocities)
        )
        return float(squared * np.exp(-2.0 * self.period * body.decay))

    def state_at(self, phase: float) -> Floats:
        """Return modal displacements and velocities at a phase of an orbit on stops that yield, shape (2 modes,)."""
        first = float(self.phases[0])
        later = first + np.mod(phase - first, TURN * self.periods)
        return yielding_motion(self.body).states(self.train, np.array([later]), first)[:, 0]

    @property
    def durations(self) -> Floats:
        """Durations of the contacts, s; 0 on rigid stops, shape (p,)."""
        return self.train.values("duration") if self.body.yields else np.zeros(self.phases.size)

    @property
    def restitutions(self) -> Floats:
        """Speeds after the contacts over speeds before them, shape (p,)."""
        if self.body.yields:
            return self.train.values("rebound") / self.velocities
        hit = zip(self.contacts, self.velocities, strict=True)
        return np.array([float(self.body.contacts[k].restitution_at(speed)) for k, speed in hit])

    @property
    def impulses(self) -> Floats:
        """Impulses of the contacts, N s, shape (p,)."""
        if self.body.yields:
            return self.train.values("impulse")
        masses = np.array([each.mass for each in self.body.contacts])[self.contacts]
        return np.asarray((1.0 + self.restitutions) * masses * self.velocities)

    @property
    def is_rigid(self) -> NDArray[np.bool_]:
        """Whether the stop of each impact is rigid, shape (p,)."""
        return np.array([each.press is None for each in self.body.contacts])[self.contacts]

    @property
    def falling(self) -> NDArray[np.bool_]:
        """Whether each impact is above its yield velocity, where its restitution falls with speed, shape (p,)."""
        above = np.array([each.yield_velocity or np.inf for each in self.body.contacts])
        return np.asarray(self.velocities > above[self.contacts])

    @property
    def is_stable(self) -> bool:
        """Whether all multipliers are within the unit circle."""
        return bool(np.abs(self.multipliers[0]) < 1.0)

    @cached_property
    def highest(self) -> tuple[float, float, int]:
        """The highest maximum between impacts: m beyond its stop (negative: clearance), its phase, its contact or -1.

        All maxima at all contacts are found: a bound of the third derivative certifies the search.
        """
        if self.body.yields:
            return yielding_motion(self.body).highest(self.phases, self.train)
        return self.body.kernel.maximum(self.contacts, self.phases, self.periods, self.states)

    @property
    def is_beyond_bounds(self) -> bool:
        """Whether an impact without a force is next to the largest speed of the search."""
        return self.body.has_own_period and is_unbounded(self.body, self.velocities / NEXT_TO_BOUND)

    @property
    def is_physical(self) -> bool:
        """Whether it hits its stops from inside, and never lies beyond one."""
        return (
            bool((self.velocities > least_speed(self.body)).all())
            and self.highest[0] <= TOUCHES * self.body.scale
        )

    @cached_property
    def turns(self) -> int:
        """Number of times that the orbit repeats a shorter orbit; 1 if it does not."""
        p, q, own = self.phases.size, self.periods, self.body.has_own_period
        for turns in range(p if own else min(p, q), 1, -1):
            if p % turns or (q % turns and not own):
                continue
            shifted = np.roll(self.phases, -(p // turns)) + TURN * q * (np.arange(p) >= p - p // turns)
            same = np.abs(shifted - self.phases - TURN * q / turns).max() < SAME
            if same and (np.roll(self.contacts, -(p // turns)) == self.contacts).all():
                return turns
        return 1

    @property
    def once(self) -> PeriodicOrbit:
        """The shortest orbit of the same motion."""
        p, q, body, phases = (
            self.phases.size // self.turns,
            self.periods // self.turns,
            self.body,
            self.phases,
        )
        if body.has_own_period:
            q, body, phases = 1, body.with_period(self.period / self.turns), phases * self.turns
        return PeriodicOrbit(body, q, phases[:p], self.contacts[:p], self.velocities[:p], self.start)

    def repeated(self, turns: int) -> PeriodicOrbit:
        """Return the orbit counted several times, as one orbit."""
        later = [self.phases + TURN * self.periods * turn for turn in range(turns)]
        phases, body, periods = np.concatenate(later), self.body, turns * self.periods
        if body.has_own_period:
            phases, body, periods = phases / turns, body.with_period(turns * self.period), 1
        return PeriodicOrbit(
            *(body, periods, phases, np.tile(self.contacts, turns), np.tile(self.velocities, turns)),
            self.start,
        )

    def counted_from(self, impact: int) -> PeriodicOrbit:
        """Return the same orbit counted from another of its impacts, from 0; without a force this impact is at 0."""
        phases = np.append(self.phases[impact:], self.phases[:impact] + TURN * self.periods)
        if self.body.has_own_period:
            phases = phases - phases[0]
        contacts, velocities = np.roll(self.contacts, -impact), np.roll(self.velocities, -impact)
        start = self.start
        if self.body.yields and impact and start is not None:
            start = self.train.entries[impact]
        return PeriodicOrbit(self.body, self.periods, phases, contacts, velocities, start)

    @cached_property
    def unknowns(self) -> Floats:
        """Unknowns of its equations: the phases; without a force those of `own_period`."""
        if self.body.has_own_period:
            return unknowns_of(self.body, self.phases, self.velocities)
        return self.phases

    def at(self, phases: Floats) -> tuple[Floats, Floats]:
        """Return displacement and velocity of the observed point at phases from the first impact on.

        Parameters
        ----------
        phases : array
            rad, ascending, from the phase of the first impact to 2 pi q later.

        Returns
        -------
        tuple of array
            m, m/s; at an impact the values after it.
        """
        if self.body.yields:
            return yielding_motion(self.body).observed(self.train, phases, float(self.phases[0]))
        return observed_motion(self.body, self.phases, self.states, phases)


def grazes(orbit: PeriodicOrbit, slow: float = SLOW) -> NDArray[np.bool_]:
    """Return whether each impact of an orbit has no speed, shape (p,): less than `slow` of that of the motion."""
    return np.asarray(orbit.velocities < slow * orbit.body.scale * orbit.body.angular_frequency)


def least_speed(body: ImpactingBody) -> float:
    """Return the speed, m/s, up to which an impact has none.

    Impulses on a body without a spring balance each other. A single impact then has the speed of rounding.
    """
    fastest = max(body.harmonics) * body.angular_frequency
    return TOUCHES * body.scale * fastest if body.loose else 0.0


class Trial(NamedTuple):
    """An orbit for unknowns that need not solve its equations.

    Attributes
    ----------
    errors : array, shape (n,)
        Distances from the stops, m; without a force speeds that do not fit follow them.
    slopes : array, shape (n, n)
        Derivatives of the errors over the unknowns.
    orbit : PeriodicOrbit
    """

    errors: Floats
    slopes: Floats
    orbit: PeriodicOrbit


def tried(body: ImpactingBody, like: PeriodicOrbit, unknowns: Floats) -> Trial:
    """Return an orbit of a body with the impacts of another one, for other unknowns; OrbitError where it has none."""
    if body.has_own_period:
        own = equations(body, like.contacts, unknowns)
        if is_unbounded(body, own.velocities):
            raise OrbitError("orbit: expected impacts of bounded speed, got ones that grow without bound.")
        refuse_end(own.end, own.phases)
        if not (np.isfinite(own.errors).all() and np.isfinite(own.slopes).all()):
            raise OrbitError(
                f"orbit: expected a motion of bounded size, got a period of {own.body.period:.3g}."
            )
        return Trial(
            own.errors, own.slopes, PeriodicOrbit(own.body, 1, own.phases, like.contacts, own.velocities)
        )
    found = evaluated(body, like.contacts, unknowns, like.periods, like.start)
    made = PeriodicOrbit(body, like.periods, unknowns, like.contacts, found.velocities, found.start)
    return Trial(found.distances, found.distance_slopes, made)


def evaluated(
    body: ImpactingBody,
    contacts: NDArray[np.int32],
    phases: Floats,
    periods: int,
    start: Floats | None = None,
) -> Evaluation:
    """Return velocities, distances and slopes for phases of impacts; OrbitError where no motion has them.

    Where stops yield, the search begins at a state before the first impact if one is given.
    """
    if body.yields:
        return yielding_motion(body).evaluate(contacts, phases, periods, start)
    found = body.kernel.evaluate(contacts, phases, periods)
    refuse_end(found.end, phases)
    return found


def refuse_end(end: OrbitEnd, phases: Floats) -> None:
    """Raise OrbitError where no motion has impacts at these phases."""
    if end is OrbitEnd.resonant:
        raise OrbitError(
            "orbit: expected modes that answer force and impacts within bounds, got an undamped one in resonance."
        )
    if end is OrbitEnd.singular:
        raise OrbitError("orbit: expected an orbit that is isolated, got a family: the body loses no energy.")
    if end is OrbitEnd.critical:
        raise OrbitError(
            "orbit: expected coupled modes away from critical damping, or slower than 1e5 times the force, got others. "
            "Change a dashpot by a thousandth."
        )
    if end is OrbitEnd.adrift:
        raise OrbitError(
            "orbit: expected impacts that place each body without a spring, got a body that could be anywhere. "
            "Tie it to the ground, or let it hit a body or a stop that is tied."
        )
    if end is OrbitEnd.unsolved:
        raise OrbitError(
            f"orbit: expected impacts that lose energy at phases {np.round(phases, 6).tolist()}, got slow ones with a "
            "restitution of 1, whose speeds have no bound. Add damping."
        )
    if end is not OrbitEnd.done:
        raise OrbitError(
            f"orbit: expected impacts that a motion has, got phases {np.round(phases, 6).tolist()}."
        )


def ordered(orbit: PeriodicOrbit) -> PeriodicOrbit:
    """Return an orbit counted from its first impact in the first period; without a force as it is."""
    if orbit.body.has_own_period:
        return orbit
    whole = TURN * orbit.periods
    phases = np.mod(orbit.phases, whole)
    order = np.argsort(phases, kind="stable")
    first = int(np.floor(phases[order[0]] / TURN))
    phases = phases[order] - TURN * first
    start = orbit.start
    if orbit.body.yields and order[0] != 0 and start is not None:
        start = orbit.train.entries[order[0]]
    return PeriodicOrbit(
        orbit.body, orbit.periods, phases, orbit.contacts[order], orbit.velocities[order], start
    )

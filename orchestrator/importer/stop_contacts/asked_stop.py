"""A stop that gives its force at trial motions, from a saved state, which is restored afterwards."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from ctypes import c_void_p
from itertools import pairwise

from vibroimpact.fmus.core.contact_laws import rigid_law_numbers
from vibroimpact.orchestrator.importer.component import Component
from vibroimpact.orchestrator.importer.specification import StopContactSpec
from vibroimpact.orchestrator.importer.stop_contacts.step_path import NODES, StepPath, last_true

LOWER_SIDE = 2
#: Search for the depth that stops a body: most evaluations, and the misfit of the energy (logarithm) that ends it.
PROBES = 40
PROBE_MISFIT = 0.2
#: Exponent of the depth in the stored energy: 2 for a spring, 2.5 for an elastic contact of two bodies; between them.
ENERGY_EXPONENT = 2.25
#: Last part of a step: a force that falls to 0 within it falls at the end of the step.
AT_END = 1e-6
#: Search for a surface: its first distance, over (1 + |displacement|), m, and most doublings of the distance.
FIRST_WAY = 1e-9
WAYS = 60
#: Factor of the depth where the stop does not answer yet.
DEEPER = 16.0


def depth_that_stops(force_at: Callable[[float], float], energy: float, guess: float) -> float | None:
    """Return a depth at which force times depth is about an energy, m; None if the stop gives no such depth.

    The stop's force is in N at a depth in m. The energy, mass * speed^2 (J), and the guess of a depth (m) are > 0.

    >>> depth = depth_that_stops(lambda depth: 1e4 * depth, 1.0, 1e-3)
    >>> 0.8 < 1e4 * depth**2 < 1.25
    True
    """
    depth = guess
    for _ in range(PROBES):
        force = force_at(depth)
        if not force > 0.0:
            depth *= DEEPER
            continue
        misfit = math.log(energy / (force * depth))
        depth *= math.exp(misfit / ENERGY_EXPONENT)
        if abs(misfit) <= PROBE_MISFIT:
            return depth
    return None


class ContactWork:
    """The energy that contacts take up, from the work of each step; it counts `steps` and `contacts`."""

    def __init__(self) -> None:
        self.steps = self.contacts = 0
        self._energy = self._largest = self._sum = 0.0

    @property
    def energy(self) -> float:
        """Sum of the largest energy that each contact has held, J."""
        return self._energy + self._largest

    def count(self, work: float) -> None:
        """Take the work of the stop in a step, J; 0 between contacts."""
        if work == 0.0:
            self._energy += self._largest
            self._largest = self._sum = 0.0
            return
        self.contacts += self._sum == 0.0 and self._largest == 0.0
        self.steps += 1
        self._sum += work
        self._largest = max(self._largest, abs(self._sum))  # a contact pressed in at first gives energy

    def share(self, residual: float) -> str:
        """Return the share of a residual, J, in this energy, in words."""
        word, size = "added" if residual > 0.0 else "taken", abs(residual)
        part = size / max(self.energy, size)
        return f"{word} {size:.3g} J, {part:.2g} of the energy of its contacts"


class AskedStop:
    """The stop of a contact, in the direction into it: displacements grow on the way in.

    The sign is 1 for a stop above the body, -1 for a stop below: displacement into it = sign * displacement. `surface`
    is the displacement, m, at which its force begins; None while unknown.
    """

    def __init__(self, component: Component, spec: StopContactSpec) -> None:
        self.component = component
        self._spec = spec
        names = [name for name in (spec.stop_displacement, spec.stop_velocity) if name is not None]
        self._inputs = component.group("Float64", names)
        self._answer = component.group("Float64", [spec.stop_force])
        own = spec.side is None
        self._side = component.group("Int64", ["side"]) if own else None
        self._position = (
            component.group("Float64", ["position"]) if own and "position" in component.variables else None
        )
        # an ImpactStop has no memory and answers at once
        self._is_ours = "law" in component.variables and "applied_restitution" in component.variables
        self._law = component.group("Int64", ["law"]) if self._is_ours else None
        self._coefficient = component.group("Float64", ["applied_restitution"]) if self._is_ours else None
        self._start, self._now = c_void_p(), c_void_p()

    @property
    def is_rigid(self) -> bool:
        """Does the stop answer with a coefficient of restitution, and no force?"""
        return self.law in rigid_law_numbers()

    @property
    def law(self) -> int:
        """Number of the law of an ImpactStop; -1 of another stop."""
        return -1 if self._law is None else int(self._law.get()[0])

    def restitution(self, speed: float) -> float:
        """Return the coefficient of restitution of a rigid stop for an impact at this speed, m/s."""
        assert self._coefficient is not None
        self.show(self.position, speed)
        return float(self._coefficient.get()[0])

    @property
    def position(self) -> float:
        """Position of a stop of ours, in the direction into it, m."""
        assert self.surface is not None
        return self.surface

    def begin(self) -> None:
        """Start a run: the parameters are set."""
        lower = self._spec.side == "lower" if self._side is None else int(self._side.get()[0]) == LOWER_SIDE
        self.sign = -1.0 if lower else 1.0
        self.surface = None if self._position is None else self.sign * float(self._position.get()[0])

    def mark(self, time: float) -> None:
        """Save the stop's state as that at the start of a step, at `time`, s."""
        if not self._is_ours:
            self.component.instance.save(self._start)
        self._time = time
        self._last: tuple[StepPath, float] | None = None

    @contextmanager
    def asking(self) -> Iterator[None]:
        """Restore the stop's state on exit: trials inside leave no trace."""
        instance = self.component.instance
        instance.save(self._now)
        kept = (instance.time, instance.needs_event_mode, instance.returned_early, instance.wants_to_end)
        flagged = instance.is_flagged
        try:
            yield
        finally:
            if not instance.is_fatal:
                instance.restore(self._now)
            instance.time, instance.needs_event_mode, instance.returned_early, instance.wants_to_end = kept
            instance.is_flagged = flagged

    def force(self, displacement: float, velocity: float, size: float) -> float:
        """Return its force `size` s after the start of the step, for this motion into it, N."""
        if self._is_ours:
            self.show(displacement, velocity)
            return float(self._answer.get()[0])
        instance = self.component.instance
        instance.restore(self._start)
        self.show(displacement, velocity)
        instance.step_undiscarded(self._time, size)
        return float(self._answer.get()[0])

    def show(self, displacement: float, velocity: float) -> None:
        """Set this motion into the stop as its inputs."""
        values = self._inputs.values
        values[0] = self.sign * displacement
        if len(values) > 1:
            values[1] = self.sign * velocity
        self._inputs.set()

    def search_surface(self, displacement: float, velocity: float, size: float) -> None:
        """Search the start of the stop's force from this displacement; `surface` stays None if the force never begins.

        The search goes ever further: inward from a free point, outward from a pressed point.
        """
        pressed = self.force(displacement, velocity, size) > 0.0
        way = FIRST_WAY * (1.0 + abs(displacement)) * (-1.0 if pressed else 1.0)
        for _ in range(WAYS):
            other = displacement + way
            if (self.force(other, velocity, size) > 0.0) != pressed:
                self.surface = self._surface_between(
                    min(displacement, other), max(displacement, other), velocity, size
                )
                return
            way *= 2.0

    def _surface_between(self, free: float, inside: float, velocity: float, size: float) -> float:
        while True:
            middle = 0.5 * (free + inside)
            if not free < middle < inside:
                return inside
            if self.force(middle, velocity, size) > 0.0:
                inside = middle
            else:
                free = middle

    def work(self, path: StepPath) -> float:
        """Return the work that the stop's law takes from the body on a path, J."""
        if self._last is None or self._last[0] != path:
            powers = self._powers(path, 0.0, 1.0)
            smooth = all(powers) and self.force(*path.at(1.0 - AT_END), path.size) > 0.0
            parts = [powers] if smooth else [self._powers(path, *m) for m in pairwise(self._marks(path))]
            self._last = path, sum(map(sum, parts))
        return self._last[1]

    def _powers(self, path: StepPath, begin: float, finish: float) -> list[float]:
        """Return the parts of the work between two fractions of the step, J; each part is 0 only without force."""
        found, share = [], finish - begin
        for u, weight in NODES:
            at = begin + u * share
            displacement, velocity = path.at(at)
            force = self.force(displacement, velocity, at * path.size)
            found.append(weight * share * path.size * force * velocity)
        return found

    def _marks(self, path: StepPath) -> list[float]:
        """Return the fractions of a step between which the force is smooth: its start and its end."""

        def is_pressed(u: float) -> bool:
            return self.force(*path.at(u), path.size) > 0.0

        def is_free(u: float) -> bool:
            return not is_pressed(u)

        first, last = is_pressed(AT_END), is_pressed(1.0 - AT_END)
        if first and not last:
            return [0.0, last_true(is_pressed, AT_END)]
        if last and not first:
            return [last_true(is_free), 1.0]
        turn = path.turn
        if turn is None or first or not is_pressed(turn):
            return [0.0, 1.0]
        return [last_true(is_free, 0.0, turn), turn, last_true(is_pressed, turn)]

    def leaves(self, path: StepPath) -> float | None:
        """Return the fraction of a step at which the force has fallen to 0; None if it has not, or only at the end."""

        def is_pressed(u: float) -> bool:
            return self.force(*path.at(u), path.size) > 0.0

        if is_pressed(1.0) or is_pressed(1.0 - AT_END) or not is_pressed(AT_END):
            return None
        return last_true(is_pressed, AT_END)

    def free(self) -> None:
        """Free its saved states, before the component is freed."""
        for slot in (self._start, self._now):
            if slot and not self.component.instance.is_fatal:
                self.component.instance.free_state(slot)

"""The impulse of a body that takes only forces: a force held over one step so short that the body hardly moves in it.

A pulse of J N s is the force J / size. Its size is a few times the precision of an impact's instant. It moves the body
by J size / (2 mass), which is below the touching distance. Its effect is tried before, from a saved state. Twice the
size with half the force must change the velocity alike; linear extrapolation to size 0 gives the mass of the point.
The force is corrected until the velocity changes by J / mass.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.importer.component import Component
from vibroimpact.orchestrator.importer.specification import BodyPoint
from vibroimpact.orchestrator.importer.stop_contacts.force_input import ForceInput, TrialSteps, agrees
from vibroimpact.orchestrator.importer.stop_contacts.state_jump import StateImpulse, StateVelocity

#: Shortest pulse, s, and in units in the last place of the time; powers of 2, so that its end is a binary number.
SHORTEST, SHORTEST_ULPS = 2.0**-39, 64.0
#: Lengths of pulses to try, over the shortest, until the body answers.
LONGER = (1.0, 16.0, 256.0)
#: Relative difference of the masses that two pulses find, above which the body takes no impulses.
BEND = 1e-3
#: Most corrections of a force, and the misfit of the velocity, relative to it, that ends them.
CORRECTIONS, MISFIT = 8, 1e-14
#: Largest misfit of the velocity, relative to its change, over MISFIT, that is accepted if no correction reduces it.
#: It is the rounding of a body whose other points move much faster than the point that is hit.
ROUNDED = 1e5
#: Part of a pulse's step; a step that ends earlier leaves a part of the impulse over.
WHOLE = 1.0 - 1e-6
#: Mass of a body's first trial pulse, kg, if no mass is given.
UNKNOWN_MASS = 1.0
#: The key of a pulse among the parts of the force input.
PART = "impulse"


class Pulse:
    """The impulses of one point of a body; a `ready` pulse takes part in the run.

    The point has got the impulse `owed` (N s), and its body not yet. Its effective mass (kg) is `given`, if known, and
    `mass` is the last measurement.
    """

    def __init__(self, body: Component, point: BodyPoint, force: ForceInput) -> None:
        self._trials = TrialSteps(body, point.velocity, force)
        self._input = force
        self.given: float | None = point.mass
        self._name = f"{point.component}.{point.force}"
        self.owed, self.mass, self.ready = 0.0, point.mass or UNKNOWN_MASS, False

    knows_mass, wants_to_end = True, False

    def strike(self, impulse: float) -> None:
        """Owe the point an impulse along its displacement, N s: the body receives it in the next step."""
        self.owed += impulse

    def begin(self, time: float) -> None:
        """Start a run: find the shortest pulse that the body answers.

        ComponentError: the body answers no pulse, or has another mass than the given one.
        """
        self._size, answers = 0.0, []
        self.mass = self.given or UNKNOWN_MASS
        for longer in LONGER:
            self._longer = longer
            answers.append(self._answers(time))
            if _is_impulse(*answers[-1]):
                break
        else:
            raise self._no_impulse(time, *answers[-1])
        self.measure(time)
        self.measure(time)  # again, with the right size of the change
        if self.given is not None and not agrees(self.given, self.mass):
            raise self._trials.mass_error(self.given, [self.mass], time)
        self.ready = True

    def measure(self, time: float) -> None:
        """Measure the mass at an impact; ComponentError if pulses of two sizes find different masses."""
        one, two = self._answers(time)
        if not _is_impulse(one, two):
            raise self._no_impulse(time, one, two)
        self.mass = 2.0 * one - two

    def size(self, time: float) -> float:
        """Return the duration of a pulse at `time`, s."""
        return self._longer * max(SHORTEST, SHORTEST_ULPS * math.ulp(time))

    def _answers(self, time: float) -> tuple[float, float]:
        """Return the masses that a pulse and one of twice its size find, kg; infinite if nothing moves."""
        size, impulse = self.size(time), self.mass * (abs(self._trials.now()) or 1.0)
        with self._trials.untraced(time):
            one, two = (self._changed(s, impulse / s) for s in (size, 2.0 * size))
        return impulse / one if one else math.inf, impulse / two if two else math.inf

    def _changed(self, size: float, force: float) -> float:
        return self._trials.velocity(size, force) - self._trials.velocity(size)

    def _no_impulse(self, time: float, one: float, two: float) -> ComponentError:
        got = f"one as of {one:.6g} kg, and of {two:.6g} kg over twice as long"
        hint = "A body with steps or limits of its own takes no rigid impact: use kelvin_voigt, hertz or hunt_crossley."
        if one == two == math.inf:
            got = "one that does not change"
        elif one < 0.0 and two < 0.0:
            hint = "Look at the variables and signs of [[contact]]."
        return ComponentError(
            f"{self._name}: expected a velocity that answers an impulse, a force held over a step of "
            f"{self.size(time):.3g} s, as its mass does, got {got}, at time {time:.12g}. {hint}",
            instance=self._trials.body.name,
            time=time,
        )

    # ---- a step ----

    def start(self, time: float, size: float) -> None:
        """Hold the force that gives the body the owed impulse over the next step, `size` s, or raise ComponentError."""
        self._size = size
        self._input.parts[PART] = 0.0
        self._input.parts[PART] = self._force(time, size)
        self._input.write()

    def _force(self, time: float, size: float) -> float:
        """Return the force, N, that changes the velocity by the impulse over the mass."""
        force, needed = self.owed / size, self.owed / self.mass
        with self._trials.untraced(time):
            free, least, best = self._trials.velocity(size), math.inf, force
            for _ in range(CORRECTIONS):
                missed = needed - (self._trials.velocity(size, force) - free)
                if abs(missed) <= MISFIT * (abs(free) + abs(needed)):
                    return force
                if abs(missed) < least:
                    least, best = abs(missed), force
                force += missed * self.mass / size
        if least <= ROUNDED * MISFIT * abs(needed):
            return best
        raise ComponentError(
            f"{self._name}: expected a change of the velocity by {needed:.6g} m/s, which is an impulse of "
            f"{self.owed:.6g} N s, got one by {needed - missed:.6g} m/s after {CORRECTIONS} tries at time {time:.12g}. "
            "Use a law that yields: kelvin_voigt, hertz or hunt_crossley.",
            instance=self._trials.body.name,
            time=time,
        )

    def finish(self, size: float) -> None:
        """Accept the step under way, of `size` s; a step shorter than planned leaves a part of the impulse."""
        self.owed = self.owed * (1.0 - size / self._size) if size < WHOLE * self._size else 0.0
        del self._input.parts[PART]
        self._input.write()

    def free(self) -> None:
        """Free its saved state."""
        self._trials.free()


Impulse = Pulse | StateImpulse | StateVelocity


def _impulse_of(body: Component, point: BodyPoint, force: ForceInput) -> Impulse:
    """Return the impulses of a point: jumps of the states in model exchange, else pulses."""
    if body.kind != "model_exchange":
        return Pulse(body, point, force)
    return StateVelocity(body, point) if point.force is None else StateImpulse(body, point, force)


class Pulses:
    """The impulses of all points of bodies that take only forces.

    Attributes
    ----------
    under_way : bool
        The step under way only gives bodies their impulses: it is too short for anything else.
    """

    def __init__(self, components: Mapping[str, Component]) -> None:
        self._components = components
        self._pulses: dict[tuple[str, str], Impulse] = {}
        self._held: list[Pulse] = []
        self.under_way = False

    def of(self, point: BodyPoint, force: ForceInput) -> Impulse:
        """Return the impulses of a point; pairs that hit the same point share them."""
        pulse = _impulse_of(self._components[point.component], point, force)
        return self._pulses.setdefault((point.component, point.force or point.velocity), pulse)

    @property
    def wants_to_end(self) -> bool:
        """Does a component that got an impulse ask for the end of the run?"""
        return any(pulse.wants_to_end for pulse in self._pulses.values())

    def begin(self) -> None:
        """Start a run; each point begins its own."""
        self.under_way, self._held = False, []
        for pulse in self._pulses.values():
            pulse.ready = False
            if isinstance(pulse, Pulse):
                pulse.owed = 0.0

    def measure(self, time: float) -> None:
        """Measure the masses of the run, before an impact."""
        for pulse in self._pulses.values():
            if pulse.ready:
                pulse.measure(time)

    def begin_step(self, time: float, target: float) -> float:
        """Hold the forces of the owed impulses; returns where the step should end, s."""
        self._held = [pulse for pulse in self._pulses.values() if isinstance(pulse, Pulse) and pulse.owed]
        self.under_way = bool(self._held)
        if not self.under_way:
            return target
        size = max(pulse.size(time) for pulse in self._held)
        for pulse in self._held:
            pulse.start(time, size)
        return time + size

    def end_step(self, size: float) -> None:
        """Accept the step under way, of `size` s."""
        for pulse in self._held:
            pulse.finish(size)
        self._held, self.under_way = [], False

    def free(self) -> None:
        """Free their saved states, before the bodies are freed."""
        for pulse in self._pulses.values():
            if isinstance(pulse, Pulse):
                pulse.free()


def _is_impulse(one: float, two: float) -> bool:
    """Do the two masses agree?"""
    return math.isfinite(one) and one > 0.0 and abs(two - one) <= BEND * one

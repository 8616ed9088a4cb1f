"""A contact of any body with a yielding stop: the force held over each step closes the energy balance.

A body of another tool takes a force and holds it over a step. The held force does the work of the stop's law over the
step: `force = integral of law * velocity / displacement`. If the motion turns within the step, the force is the sum of
two means: the elastic part over the displacement (Gonzalez, J. Nonlinear Sci. 6, 1996: a discrete gradient) and the
rest over time. The force depends on the end of the step, and so on itself:

- a motion with constant accelerations is predicted, from the effective mass and the step before;
- if the body can go back, the step is repeated with the force for its true end, until both agree.

Steps begin where the body reaches the surface and end where the force falls to 0. Step revision finds the surface; for
a body that cannot go back it is predicted.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.fmi.exchange import ExchangeInstance
from vibroimpact.orchestrator.fmi.watched_points import ContactWatch
from vibroimpact.orchestrator.importer.component import Component
from vibroimpact.orchestrator.importer.contact_impacts import ContactImpacts
from vibroimpact.orchestrator.importer.revision import PRECISION, Bracket, refine
from vibroimpact.orchestrator.importer.specification import StopContactSpec
from vibroimpact.orchestrator.importer.stop_contacts.asked_stop import (
    AskedStop,
    ContactWork,
    depth_that_stops,
)
from vibroimpact.orchestrator.importer.stop_contacts.force_input import (
    OWN_STEPS,
    TRIAL_STEP,
    ForceInputs,
    TrialSteps,
    force_input_of,
)
from vibroimpact.orchestrator.importer.stop_contacts.pulse import PART
from vibroimpact.orchestrator.importer.stop_contacts.step_path import NODES, StepPath, last_true

#: Distance to the surface below which a body is on it, relative to its displacement plus the surface's position.
SURFACE_ROUNDING = 4.0 * np.finfo(float).eps
#: Difference of the held force from the force that the step requires, relative to the contact's largest; below it they
#: agree.
FORCE_TOLERANCE = 1e-12
#: Most iterations of a predicted step, and most rounds in which it is shortened.
FORESIGHTS, SHORTENINGS = 12, 12
MOST_SHORTENED = 3.0
#: Misfit of a predicted force, relative to the largest, above which its step is far too long.
LARGE_MISFIT = 0.1
#: Length of a step over its limit as known at its end, above which the step is shortened.
SLACK = 1.5
#: Exit path, as a fraction of the step limit, below which the body counts as separated.
EXIT_PART = 1e-9
#: Part of a step at each of its ends; a turn of the motion there does not divide the step.
NOT_AT_ONCE = 1e-3
#: Residual relative to the energy of the contacts, above which a remark reports it.
REPORTED_RESIDUAL = 1e-3
#: Ratio of the smaller end velocity to the larger, below which a motion that turns counts as ending at its turn.
TURNING_RATIO = 0.2
#: Shortest step, over (1 + |time|), s.
ROOM = 1e-13
#: Change of the velocity by a changing acceleration on the way to an arrival, relative to it. Below STEADY_CHANGE
#: the predicted arrival is certain; above it a step covers the part APPROACH_PART of the time to it.
STEADY_CHANGE, APPROACH_PART = 1e-9, 0.75
#: Length of a step over the step before, below which it gives too little information on accelerations.
INFORMATIVE_PART = 0.05


class HeldForceBond:
    """One contact of a body that holds its force over a step, named `stop.output -> body.input`.

    `active`: the step under way may have to be repeated, or the contact is `closed` in it. `arrived`: the step just
    made has ended at the surface. `begins_pressed`: the step under way is the first, and the contact begins with it.
    The effective mass of the contact point (kg) is None until a trial step finds it.
    """

    def __init__(
        self,
        components: Mapping[str, Component],
        spec: StopContactSpec,
        inputs: ForceInputs,
    ) -> None:
        self.name = spec.name
        self.body = components[spec.body]
        self.contact = spec
        self.stop = AskedStop(components[spec.stop], spec)
        self._outputs = self.body.group("Float64", [spec.displacement, spec.velocity])
        self.input = force_input_of(self.body, spec.force, inputs)
        self._trials = TrialSteps(self.body, spec.velocity, self.input)
        self.watch = _watch_of(self.body, spec)
        """Model exchange: the watch that ends steps where the body meets a rigid stop."""
        self.revisable = self.body.has_states
        """Its steps can be repeated."""
        self.given_mass = spec.mass
        """Given effective mass, kg."""
        self.impacts = ContactImpacts()
        self.active = self.closed = self.arrived = self.begins_pressed = False
        self.residual = 0.0
        """Energy that the body received beyond the law of the stop, J."""

    def begin(self) -> None:
        """Start a run: the parameters are set."""
        self.stop.begin()
        self.impacts.forget()
        self.input.parts[self.contact.stop] = 0.0
        self.mass = self.given_mass
        self.active = self.closed = self.arrived = self.begins_pressed = False
        self.residual = 0.0
        self._is_new = True
        self._work = ContactWork()
        self._other, self._other_slope = 0.0, 0.0
        self._last_sample: tuple[float, float, float] | None = None
        self._searched = False
        self._checks_mass = self.revisable
        self._agreed = -math.inf
        self._depth: float | None = None
        self._limit = math.inf
        self._largest = 0.0

    def refuse_model_exchange(self) -> None:
        """Raise ComponentError for a body in model exchange that cannot hold a force over a step and repeat it."""
        lacks = "a force input" if self.contact.force is None else "canGetAndSetFMUState"
        if self.watch is None or (self.contact.force is not None and self.revisable):
            return
        raise ComponentError(
            f"{self.contact.stop}: expected a rigid stop (the law restitution) for {self.body.name}, which runs as "
            f"model exchange without {lacks}, got a stop that yields.",
            instance=self.contact.stop,
        )

    # ---- a step ----

    def begin_step(self, time: float, target: float, steps: float) -> float:
        """Prepare the contact for a step; returns where the step should end, s."""
        self._steps, self._time, self._room = steps, time, ROOM * (1.0 + abs(time))
        self._start = self.motion()
        self.stop.mark(time)
        self._force = 0.0
        self._last_try: tuple[float, float] | None = None
        self._misfit = math.inf
        was_closed, self.arrived = self.closed, False
        size = target - time
        if not self.revisable and self._last_sample is None:
            size *= TRIAL_STEP  # the body's acceleration is not known yet
        with self.stop.asking():
            if self.stop.surface is None and not self._searched:
                self.stop.search_surface(*self._start, size)
                self._searched = True
            self.closed = self._touches(*self._start, size)
            if self.closed:
                if not was_closed:
                    self.impacts.touch(time, self._start[1])
                    self._begin_contact(size)
                size = self._foresee(min(size, max(self._limit, self._room)))
            elif not self.revisable:
                size = self._foreseen_arrival(size)
            self.begins_pressed = self._is_new and self.closed and self._presses(size)
        if was_closed and not self.closed:
            self.impacts.part(time, -self._start[1])
        self._is_new = False
        self.active = self.closed or self.revisable
        self._planned = target if size == target - time else time + size
        return self._planned

    def apply(self) -> None:
        """Write the force to the body."""
        self.input.parts[self.contact.stop] = -self.stop.sign * self._force
        self.input.write()

    def revised_end(self, time: float, end: float) -> float | None:
        """Return the end of the step if the last one must be repeated, s; None if it is accepted."""
        if not (self.revisable and end > time):
            return None
        path = self._path(end - time)
        with self.stop.asking():
            if not self.closed:
                return self._arrival(time, end, path)
            if end == self._planned and self._is_foreseen(path):
                return None
            scale = self._time_scale(path)
            if path.size > SLACK * scale:
                self._last_try = None
                return time + self._foresee(max(scale, path.size / MOST_SHORTENED))
            required = self._mean_force(path)
        return end if self._corrects(required) else None

    def agree(self, time: float, end: float) -> None:
        """Adjust the force of a body that cannot repeat its step to the end of the step, s."""
        if not self.revisable and self.closed and end != self._planned:
            with self.stop.asking():
                self._force = self._foreseen_force(end - time)
            self.apply()

    def end_step(self, size: float) -> None:
        """Accept the step of `size` s: add its residual, and update the accelerations."""
        if not size > 0.0:
            return
        path = self._path(size)
        with self.stop.asking():
            touched = self.closed or self._inside(path) is not None
            work = self.stop.work(path) if touched else 0.0
        if self.closed:
            self.impacts.press(self._force * size, self._force)
        self._work.count(work)
        self.residual += work - self._force * (path.end - path.start)
        self.arrived = touched and not self.closed
        self._learn(path)
        self.stop.show(path.end, path.end_velocity)

    def remark(self) -> str:
        """Return a remark on the residual; empty where it is small."""
        if not abs(self.residual) > REPORTED_RESIDUAL * self._work.energy:
            return ""
        why = "" if self.revisable else f" of {self.contact.body}, which cannot restore its state,"
        return f"{self.name}: the held force{why} has {self._work.share(self.residual)}. Use a shorter macro_step"

    def motion(self) -> tuple[float, float]:
        """Return displacement (m) and velocity (m/s) of the contact point, in the direction into the stop."""
        displacement, velocity = (float(v) for v in self._outputs.get())
        return self.stop.sign * displacement, self.stop.sign * velocity

    def _path(self, size: float) -> StepPath:
        return StepPath(*self._start, *self.motion(), size)

    def _learn(self, path: StepPath) -> None:
        """Estimate the body's acceleration by all but this contact, now and until the next step; not by impulses."""
        if PART in self.input.parts:
            return
        if self.mass is None:
            if self.closed:
                return
            contact = 0.0
        else:
            contact = self._force / self.mass
        middle = self._time + 0.5 * path.size
        other = (path.end_velocity - path.start_velocity) / path.size + contact
        if self._last_sample is not None:
            if path.size < INFORMATIVE_PART * self._last_sample[2]:
                return
            self._other_slope = (other - self._last_sample[1]) / (middle - self._last_sample[0])
        self._last_sample, self._other = (middle, other, path.size), other

    # ---- touching, arriving ----

    def _presses(self, size: float) -> bool:
        """Does the stop press the body at the start of the step, or is the body on its way in?"""
        displacement, velocity = self._start
        return velocity > 0.0 or self.stop.force(displacement, velocity, size) > 0.0

    def _touches(self, displacement: float, velocity: float, size: float) -> bool:
        """Does the stop press the body, or is the body on the surface and on its way in?"""
        surface = self.stop.surface
        if surface is not None:
            rounding = SURFACE_ROUNDING * (abs(displacement) + abs(surface))
            if displacement < surface - rounding:
                return False
            if displacement <= surface + rounding and velocity >= 0.0:
                return True
        return self.stop.force(displacement, velocity, size) > 0.0

    def _arrival(self, time: float, end: float, path: StepPath) -> float | None:
        """Return the instant at which a free body reaches the surface within the step just made, s."""
        if abs(end - self._agreed) <= PRECISION * (1.0 + abs(time)):
            return None
        inside = self._inside(path)
        if inside is None:
            return None
        precision = PRECISION * (1.0 + abs(time))
        size = self._time_of_arrival(time, path, inside, precision)
        if size is None or size + precision >= path.size:
            self._agreed = end
            return None
        self._agreed = time + size + precision
        return self._agreed

    def _inside(self, path: StepPath) -> float | None:
        """Return the seconds into a free step at which the body is in the stop; None if it never is."""
        if self._touches(path.end, path.end_velocity, path.size):
            if self.stop.surface is None:
                self.stop.search_surface(path.end, path.end_velocity, path.size)
            return path.size
        turn, surface = path.turn, self.stop.surface
        return turn * path.size if turn and surface is not None and path.at(turn)[0] > surface else None

    def _time_of_arrival(self, time: float, path: StepPath, inside: float, precision: float) -> float | None:
        """Return the arrival on the body's own path, s; None if the body is not inside the stop there after all."""
        surface = self.stop.surface
        if surface is None:  # its force does not end on the way out
            return None

        def gap(size: float) -> float:
            self.body.step_from_start(time, size)
            return surface - self.motion()[0]

        with self.body.taken_back():
            if path.start < surface:
                if inside < path.size and gap(inside) > 0.0:
                    return None
                return refine(Bracket(0.0, surface - path.start, inside), gap, precision)

            def is_free(u: float) -> bool:
                self.body.step_from_start(time, u * inside)
                return not self.stop.force(*self.motion(), u * inside) > 0.0

            return last_true(is_free) * inside  # it had let go within the stop, and is in contact again

    def _foreseen_arrival(self, size: float) -> float:
        """Return the seconds to the surface at the accelerations of the step before; `size` if it is farther."""
        surface, (displacement, velocity) = self.stop.surface, self._start
        if surface is None or displacement >= surface:
            return size
        gap, other = surface - displacement, self._other_after(size)
        square = velocity * velocity + 2.0 * other * gap
        if square < 0.0 or not velocity + math.sqrt(square) > 0.0:
            return size
        arrival = 2.0 * gap / (velocity + math.sqrt(square))
        if arrival >= size:
            return size
        blurred = abs(self._other_slope) * arrival**2 > STEADY_CHANGE * abs(velocity)
        return max(self._room, APPROACH_PART * arrival if blurred else arrival)

    # ---- the beginning of a contact ----

    def _begin_contact(self, size: float) -> None:
        """Set the step limit of this contact: a part of the contact's duration."""
        displacement, velocity = self._start
        if self.mass is None:
            self.mass = self._found_mass(size)
        self._largest, self._limit = 0.0, math.inf
        surface = self.stop.surface
        if surface is None:
            surface = self.stop.surface = displacement  # the contact began in the stop
        if velocity > 0.0:
            energy = self.mass * velocity * velocity
            guess = velocity * size if self._depth is None else self._depth
            origin = surface
            depth = depth_that_stops(
                lambda depth: self.stop.force(origin + depth, velocity, size), energy, guess
            )
            if depth is not None:
                self._depth, self._limit = depth, math.pi * depth / velocity / self._steps

    def check_mass(self, time: float, size: float) -> None:
        """Compare a given mass with trial steps of up to `size` s, at the first step of a run that allows it."""
        if self._checks_mass and self.given_mass is not None:
            self._trials.check_mass(self.given_mass, time, size)
            self._checks_mass = False

    def _found_mass(self, size: float) -> float:
        """Return the effective mass of the contact point, kg, by steps with and without a small force."""
        mass = self._trials.measured_mass(self._time, size)
        if not (mass > 0.0 and math.isfinite(mass)):
            got = "one that does not change" if math.isnan(mass) else f"an effective mass of {mass:.3g} kg"
            signs = "Look at the variables and signs of [[contact]], or give its mass."
            # most often a velocity stays because the body has not made its own step yet
            hint = f"{signs} {OWN_STEPS}" if mass < 0.0 else f"{OWN_STEPS} {signs}"
            raise ComponentError(
                f"{self.contact.body}.{self.contact.velocity}: expected a velocity that grows with the force "
                f"{self.contact.force}, got {got} in a trial step at time {self._time:.12g}. " + hint,
                instance=self.contact.body,
                time=self._time,
            )
        return mass

    # ---- the force ----

    def _other_after(self, size: float) -> float:
        """Return the body's mean acceleration into the stop in the next `size` s by all but this contact, m/s^2."""
        if self._last_sample is None:
            return 0.0
        return self._other + self._other_slope * (self._time + 0.5 * size - self._last_sample[0])

    def _foreseen_path(self, size: float, force: float) -> StepPath:
        assert self.mass is not None
        displacement, velocity = self._start
        acceleration = self._other_after(size) - force / self.mass
        end = displacement + size * (velocity + 0.5 * acceleration * size)
        return StepPath(displacement, velocity, end, velocity + acceleration * size, size)

    def _foreseen_force(self, size: float) -> float:
        """Return the force that agrees with the predicted path that it causes, N."""
        force = previous = self._force_half_way(size)
        answer = earlier = math.nan
        for turn in range(FORESIGHTS):
            answer = self._mean_force(self._foreseen_path(size, force))
            self._largest = max(self._largest, answer)
            self._misfit = abs(answer - force)
            if self._misfit <= FORCE_TOLERANCE * self._largest:
                break
            following = _secant(force, answer, (previous, earlier) if turn else None)
            previous, earlier, force = force, answer, following
        return force

    def _is_foreseen(self, path: StepPath) -> bool:
        """Does the body's path agree with the predicted path? Then its force is right."""
        foreseen = self._foreseen_path(path.size, self._force)
        sped = abs(path.start_velocity) + abs(path.end_velocity)
        return (
            self._misfit <= FORCE_TOLERANCE * self._largest
            and abs(path.end - foreseen.end) <= FORCE_TOLERANCE * path.size * sped
            and abs(path.end_velocity - foreseen.end_velocity) <= FORCE_TOLERANCE * sped
        )

    def _force_half_way(self, size: float) -> float:
        """Return a first guess of the force, N: in the middle of a path that begins with the force at its start."""
        first = self.stop.force(*self._start, size)
        displacement, velocity = self._foreseen_path(size, first).at(0.5)
        return max(0.0, self.stop.force(displacement, velocity, size))

    def _foresee(self, size: float) -> float:
        """Choose the step and its force; returns the size of the step, s."""
        whole = size
        for _ in range(SHORTENINGS):
            self._force = self._foreseen_force(size)
            path = self._foreseen_path(size, self._force)
            scale = self._time_scale(path)
            if size > SLACK * scale or self._misfit > LARGE_MISFIT * self._largest:
                size = max(
                    min(scale, size / SLACK), size / MOST_SHORTENED
                )  # a step that is far too long gives little information on the right size
                continue
            turn, leaves = path.turn, self.stop.leaves(path)
            if turn is not None and NOT_AT_ONCE < turn < 1.0 - NOT_AT_ONCE:
                size *= turn
                continue
            if leaves is None:
                break
            if leaves * size <= EXIT_PART * min(whole, self._limit) + self._room:
                self.closed, self._force = False, 0.0
                return whole
            size *= leaves
        else:
            self._force = self._foreseen_force(size)
        return size

    def _time_scale(self, path: StepPath) -> float:
        """Return half a period of the mass on the stiffness met in a step, divided by the number of steps, s."""
        assert self.mass is not None
        moved = path.end - path.start
        if moved == 0.0:
            return math.inf
        risen = self.stop.force(path.end, 0.0, path.size) - self.stop.force(path.start, 0.0, path.size)
        stiffness = risen / moved
        return math.pi * math.sqrt(self.mass / stiffness) / self._steps if stiffness > 0.0 else math.inf

    def _mean_force(self, path: StepPath) -> float:
        """Return the force that does the work of the stop's law over a step, N."""
        moved = path.end - path.start
        slow, fast = sorted((path.start_velocity, path.end_velocity), key=abs)
        if moved != 0.0 and (slow * fast >= 0.0 or abs(slow) <= TURNING_RATIO * abs(fast)):
            return max(0.0, self.stop.work(path) / moved)
        mean = 0.0
        for u, weight in NODES:
            displacement, velocity = path.at(u)
            elastic = self.stop.force(path.start + u * moved, 0.0, path.size)
            whole = self.stop.force(displacement, velocity, u * path.size)
            mean += weight * (elastic + whole - self.stop.force(displacement, 0.0, u * path.size))
        return max(0.0, mean)

    def _corrects(self, required: float) -> bool:
        """Take the force that the end of a step requires, N; returns whether it is a new force."""
        force = self._force
        self._largest = max(self._largest, required)
        if abs(required - force) <= FORCE_TOLERANCE * self._largest:
            return False
        self._force = _secant(force, required, self._last_try)
        self._last_try = force, required
        return self._force != force

    def free(self) -> None:
        """Free its saved states, before its components are freed."""
        self.stop.free()
        self._trials.free()


def _watch_of(body: Component, spec: StopContactSpec) -> ContactWatch | None:
    """Return a watch of the contact point of a body in model exchange; None for another body."""
    if not isinstance(body.instance, ExchangeInstance):
        return None
    body.instance.points.has_contacts = True
    names = spec.displacement, spec.velocity
    return body.instance.points.contact(*(body.variables[name].valueReference for name in names))


def _secant(force: float, answer: float, before: tuple[float, float] | None) -> float:
    """Return the fixed point of the straight line through two answers; with one answer, that answer."""
    if before is None or force == before[0]:
        return answer
    slope = (answer - before[1]) / (force - before[0])
    if not abs(slope) < 0.9:  # no contraction: rounding, or a kink
        return max(0.0, answer)
    return max(0.0, force + (answer - force) / (1.0 - slope))

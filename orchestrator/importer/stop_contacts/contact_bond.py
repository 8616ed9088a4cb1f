"""Contacts with yielding stops whose force the body follows: body and stop agree over a step.

A body whose contact law is `external_force` presses a stop in through many steps. Over each step it follows the stop's
force as `applied_force + applied_stiffness * (penetration - at the start) + applied_damping * (rate - at the start)`,
on its exact flow. This is a linearly implicit exchange, exact for a linear stop. This module decides

- the length of a step in a contact: a fraction of the contact's duration, which follows from the stop's law and the
  speed of arrival;
- the slopes for a stop that answers with a force alone. They belong to a straight line (in penetration and rate)
  through the stop's answers at both ends of the step. The step is repeated until they settle (Broyden's method). With
  a stop that cannot go back to a saved state the slopes of the step before are used.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from ctypes import c_void_p
from dataclasses import dataclass

from vibroimpact.fmus.core.contact_laws import contact_law
from vibroimpact.orchestrator.importer.component import Component
from vibroimpact.orchestrator.importer.specification import ConnectionSpec
from vibroimpact.orchestrator.importer.stop_contacts.asked_stop import DEEPER, LOWER_SIDE, depth_that_stops
from vibroimpact.orchestrator.importer.wiring import Transfer

#: Outputs that a body's contact port must have, besides the inputs.
PORT_OUTPUTS = ("displacement", "velocity")
FORCE, STIFFNESS, DAMPING = "applied_force", "applied_stiffness", "applied_damping"
#: Distance to the surface, below which a body is on it, relative to a sum. The sum is the largest displacement so
#: far, with twice the stop's position, and the present rate times the time of the run.
SURFACE_ROUNDING = 1e-15
#: Length of a step over its limit as known at its end, above which the step is repeated.
SLACK = 1.5
#: Misfit of the straight line at the stop's answer, relative to the largest force; below it line and answer agree.
FORCE_TOLERANCE = 1e-11
MOST_REPETITIONS = 20
#: Shortest first step from rest on the surface, over (1 + |time|), s.
SHORTEST = 1e-9
#: Ratio of the smaller penetration of a path's ends to the larger, below which the force is taken as a power.
NEAR_SURFACE = 0.5
#: Relative difference of a force from a straight line through the surface, below which the force is linear.
STRAIGHT = 1e-9


@dataclass(slots=True)
class _Answer:
    """A contact at one instant: penetration (m), its rate (m/s), the force (N) and its slopes (N/m, N s/m)."""

    penetration: float
    rate: float
    force: float
    stiffness: float = 0.0
    damping: float = 0.0

    def force_at(self, penetration: float, rate: float) -> float:
        """Return the body's force at another motion, before it clips negative forces, N."""
        return (
            self.force + self.stiffness * (penetration - self.penetration) + self.damping * (rate - self.rate)
        )


class ContactBond:
    """One contact port of a body, and the component that answers its motion with a force.

    Its name is `body.contact[k]`. `start` is the contact at the start of the step under way.
    """

    def __init__(
        self, components: dict[str, Component], transfers: Sequence[Transfer], force: ConnectionSpec
    ) -> None:
        self.port = force.target[1].rpartition(".")[0]
        self.name = f"{force.target[0]}.{self.port}"
        self.body, self.stop = components[force.target[0]], components[force.source[0]]
        self._transfers = [t for t in transfers if t.source is self.stop and t.target is self.body]
        self._inward = [t for t in transfers if t.source is self.body and t.target is self.stop]
        self._answers = {
            last: self._connection(self._transfers, f"{self.port}.{last}")
            for last in (FORCE, STIFFNESS, DAMPING)
        }
        self.gives_slopes = any(self._answers[last] is not None for last in (STIFFNESS, DAMPING))
        """The stop answers with slopes."""
        found = [connection for connection in self._answers.values() if connection is not None]
        self._stop_outputs = self.stop.group("Float64", [c.source[1] for c in found])
        self._connections = list(self._answers.values())
        self._outputs = self.body.group("Float64", [f"{self.port}.{last}" for last in PORT_OUTPUTS])
        self._line = self.body.group("Float64", [f"{self.port}.{x}" for x in (FORCE, STIFFNESS, DAMPING)])
        self._law = self.body.group("Int64", [f"{self.port}.law", f"{self.port}.side"])
        self._constants = self.body.group("Float64", [f"{self.port}.position", f"{self.port}.mass"])
        self._feeding = [
            (last, connection)
            for transfer in self._inward
            for connection in transfer.connections
            for last in PORT_OUTPUTS
            if connection.source[1] == f"{self.port}.{last}"
        ]
        self._inputs = self.stop.group("Float64", [c.target[1] for _, c in self._feeding])
        self._probe_state = c_void_p()
        self.follows = False
        self.active = False
        """The contact is closed in the step under way, or may close in it."""

    @staticmethod
    def _connection(transfers: Sequence[Transfer], target: str) -> ConnectionSpec | None:
        found = (c for t in transfers for c in t.connections if c.target[1] == target)
        return next(found, None)

    @property
    def revisable(self) -> bool:
        """Can a step of body and stop be repeated?"""
        return self.body.has_states and self.stop.has_states

    # ---- a run ----

    def begin(self) -> None:
        """Start a run: the parameters are set."""
        law, side = (int(v) for v in self._law.get())
        self.follows = law == contact_law("external_force").number
        self.active = False
        for transfer in self._transfers:
            transfer.keep_at_start(
                [f"{self.port}.{x}" for x in (FORCE, STIFFNESS, DAMPING)], kept=self.follows
            )
        if not self.follows:
            return
        self.sign = -1.0 if side == LOWER_SIDE else 1.0
        self._position, self._mass = (float(v) for v in self._constants.get())
        self._gains = [self._gain(self._transfers, c) for c in self._connections]
        self._input_gains = [self._gain(self._inward, c) for _, c in self._feeding]
        self._stiffness = self._damping = 0.0
        self._depth: float | None = None
        self._limit = self._longest = math.inf
        self._largest_force = 0.0
        self._largest_displacement = 0.0
        self._pace = 1.0

    @staticmethod
    def _gain(transfers: Sequence[Transfer], connection: ConnectionSpec | None) -> float:
        if connection is None:
            return 0.0
        return next(t for t in transfers if t.carries(connection)).gain_of(connection)

    # ---- a step ----

    def look(self) -> _Answer:
        """Return the contact now: the body's motion, and the stop's last answer."""
        displacement, velocity = (float(v) for v in self._outputs.get())
        values = iter(self._stop_outputs.get())
        force, stiffness, damping = (
            0.0 if connection is None else gain * float(next(values))
            for gain, connection in zip(self._gains, self._connections, strict=True)
        )
        return _Answer(self.penetration_at(displacement), self.sign * velocity, force, stiffness, damping)

    def begin_step(self, time: float, target: float, steps: float) -> float:
        """Prepare the contact for a step from `time` to `target` (s); returns where the step should end, s.

        `steps` is the number of steps of a contact.
        """
        if not self.follows:
            return target
        start = self.look()
        was_active, self.active = self.active, self._is_closed(start, time)
        if not self.active:
            self._longest = math.inf
            return target
        if not self.gives_slopes:
            start.stiffness, start.damping = self._stiffness, self._damping
        self.start = start
        self._corrected = False
        self._steps = steps
        if not was_active:
            self._largest_force = 0.0
            contact_time = self._contact_time(start, time, target)
            self._limit = contact_time / steps
            self._pace = math.pi / contact_time if math.isfinite(contact_time) else 1.0 / (target - time)
        self._largest_force = max(self._largest_force, start.force)
        longest = min(self._limit, self._time_scale(start.stiffness))
        self._is_blind = not was_active and math.isinf(longest)
        if math.isfinite(longest):
            self._longest = longest
        return min(target, time + self._longest)

    def _is_closed(self, now: _Answer, time: float) -> bool:
        """Is the contact pressed in, or on the surface and perhaps about to be?"""
        size = abs(now.penetration) + 2.0 * abs(self._position)
        self._largest_displacement = max(self._largest_displacement, size)
        # the position of a stop at 0 has no rounding, but the flight before the contact has
        on_surface = abs(now.penetration) <= SURFACE_ROUNDING * (
            self._largest_displacement + abs(time * now.rate)
        )
        return now.force > 0.0 or (now.rate >= 0.0 if on_surface else now.penetration > 0.0)

    def _time_scale(self, stiffness: float) -> float:
        """Return half a period of the contact mass on this stiffness, divided by the number of steps, s."""
        return math.pi * math.sqrt(self._mass / stiffness) / self._steps if stiffness > 0.0 else math.inf

    def apply(self) -> None:
        """Write the straight line that the body follows, unless it is the stop's own answer."""
        if self.active and (self._corrected or not self.gives_slopes):
            self._line.values[:] = self.start.force, self.start.stiffness, self.start.damping
            self._line.set()

    def revised_end(self, time: float, end: float) -> float | None:
        """Return the end of the step if the last one must be repeated, s; None if it is accepted."""
        if not (self.active and self.revisable):
            return None
        now = self.look()
        self._largest_force = max(self._largest_force, now.force)
        if self._is_blind and not now.penetration > 0.0 and end - time > SHORTEST * (1.0 + abs(time)):
            return time + (end - time) / DEEPER  # it went in by an unknown depth, and came back
        scale = self._time_scale(self._slope_at(now))
        if end - time > SLACK * scale:
            return time + scale
        changed = self._correct(now) if self.gives_slopes else self._learn(now)
        return end if changed else None

    def end_step(self, size: float) -> None:
        """Accept the step of `size` s; its slopes serve the next step."""
        if self.active and not self.gives_slopes:
            if not self.revisable:
                self._pace = 1.0 / size if size > 0.0 else 1.0
                self._learn(self.look())
            self._stiffness, self._damping = self.start.stiffness, self.start.damping

    def _slope_at(self, now: _Answer) -> float:
        """Return the stiffness at the end of a step, N/m; a stop without slopes counts as a spring."""
        if not now.force > 0.0:
            return 0.0
        if self.gives_slopes:
            return now.stiffness
        return now.force / now.penetration if now.penetration > 0.0 else 0.0

    def _correct(self, now: _Answer) -> bool:
        """Give the line the mean of the stop's force over the step, once; returns whether it has changed.

        With slopes at both ends the mean force over the way is known to the fourth order. Near the surface the force
        is taken as a power of the penetration. The force of a linear stop is on its line already.
        """
        start = self.start
        lets_go = start.force > 0.0 >= now.force
        missed = now.force - max(0.0, start.force_at(now.penetration, now.rate))
        if self._corrected or (abs(missed) <= FORCE_TOLERANCE * self._largest_force and not lets_go):
            return False
        # at touch-down the point may be a rounding inside: a line bent there may separate at once
        if start.force > FORCE_TOLERANCE * self._largest_force and now.force > 0.0:
            self._bend(now)
        elif now.force > 0.0:
            exponent = now.stiffness * now.penetration / now.force
            start.stiffness, start.damping = 2.0 * now.force / ((exponent + 1.0) * now.penetration), 0.0
        elif not self._lets_go_at_surface(now):
            return False
        self._corrected = True
        return True

    def _bend(self, now: _Answer) -> None:
        """Set the line with the mean of the stop's force, parallel to the chord unless that separates too early."""
        start = self.start
        first, last, mean = start.force, now.force, self._mean(now)
        moved, sped = now.penetration - start.penetration, now.rate - start.rate
        lift = mean - 0.5 * (first + last)
        if lift < -0.5 * min(first, last):
            first, last = (first, 2.0 * mean - first) if first < last else (2.0 * mean - last, last)
        else:
            first, last = first + lift, last + lift
        start.stiffness = 0.5 * (start.stiffness + now.stiffness)
        start.damping = 0.5 * (start.damping + now.damping)
        self._turn(moved, sped, last - first - start.stiffness * moved - start.damping * sped)
        start.force = first

    def _mean(self, now: _Answer) -> float:
        """Return the mean of the stop's force over the way, N, from a cubic; near the surface from a power."""
        start = self.start
        moved, sped = now.penetration - start.penetration, now.rate - start.rate
        near, far = sorted((start.penetration, now.penetration))
        if 0.0 < near < NEAR_SURFACE * far:
            exponent = math.log(now.force / start.force) / math.log(now.penetration / start.penetration)
            work = now.force * now.penetration - start.force * start.penetration
            return work / ((exponent + 1.0) * moved)
        bend = (start.stiffness - now.stiffness) * moved + (start.damping - now.damping) * sped
        return 0.5 * (start.force + now.force) + bend / 12.0

    def _lets_go_at_surface(self, now: _Answer) -> bool:
        """On the way out, end the line at the surface with the work of a power of the penetration.

        A spring and a dashpot separate before the surface, as their straight line gives.
        """
        start = self.start
        elastic = start.force - start.damping * start.rate
        straight = abs(start.stiffness * start.penetration - elastic) <= STRAIGHT * abs(elastic)
        if straight or not start.penetration > 0.0 >= now.penetration:
            return False
        exponent = start.stiffness * start.penetration / start.force
        start.force *= 2.0 / (exponent + 1.0)
        start.stiffness, start.damping = start.force / start.penetration, 0.0
        return True

    def _learn(self, now: _Answer) -> bool:
        """Fit the slopes to the stop's answer at the end of the step; returns whether they have changed."""
        start = self.start
        penetration = max(now.penetration, 0.0)  # outside the stop its force is 0, as at the surface
        defect = now.force - start.force_at(penetration, now.rate)
        if now.force <= 0.0 and defect >= 0.0:
            return False  # both have let go
        if abs(defect) <= FORCE_TOLERANCE * self._largest_force:
            return False
        return self._turn(penetration - start.penetration, now.rate - start.rate, defect)

    def _turn(self, moved: float, sped: float, defect: float) -> bool:
        """Turn the line so that it rises by `defect` more on this way.

        Broyden's update is the smallest such change of the slopes; the contact's own time scales penetration to rate.
        """
        size = (self._pace * moved) ** 2 + sped * sped
        if size == 0.0:
            return False
        self.start.stiffness += defect * self._pace**2 * moved / size
        self.start.damping += defect * sped / size
        return True

    # ---- duration of a contact ----

    def _contact_time(self, start: _Answer, time: float, target: float) -> float:
        """Return the duration of a contact that begins like this, s; infinite if the stop's slope sets the step.

        The stop is evaluated for the depth at which force times depth is the energy `mass * rate^2`. A spring of that
        depth takes exactly pi * depth / rate; other laws take about that.
        """
        if start.stiffness > 0.0 and self.gives_slopes:
            return math.inf
        if not (start.rate > 0.0 and self.stop.has_states and self._feeding):
            return math.inf if self._depth is None else math.pi * self._depth / max(start.rate, 1e-300)
        self._depth = self._depth_that_stops(start, time, target - time)
        return math.inf if self._depth is None else math.pi * self._depth / start.rate

    def _depth_that_stops(self, start: _Answer, time: float, size: float) -> float | None:
        energy = self._mass * start.rate**2
        depth = start.rate * size if self._depth is None else self._depth
        instance = self.stop.instance
        instance.save(self._probe_state)
        found = depth_that_stops(lambda at: self._force_at(at, start.rate, time, size), energy, depth)
        instance.restore(self._probe_state)
        self._write_inputs(start.penetration, start.rate)
        instance.time = time
        instance.returned_early = instance.needs_event_mode = instance.wants_to_end = False
        instance.is_flagged = False
        return found

    def _force_at(self, penetration: float, rate: float, time: float, size: float) -> float:
        """Return the stop's force at this motion, N; the stop's state is left changed."""
        instance = self.stop.instance
        instance.restore(self._probe_state)
        self._write_inputs(penetration, rate)
        instance.step_undiscarded(time, size)
        return self._gains[0] * float(self._stop_outputs.get()[0])

    def _write_inputs(self, penetration: float, rate: float) -> None:
        """Write this motion of the contact point to the stop."""
        values = {
            "displacement": self._position + self.sign * penetration,
            "velocity": self.sign * rate,
        }
        for i, (last, _) in enumerate(self._feeding):
            self._inputs.values[i] = self._input_gains[i] * values[last]
        self._inputs.set()

    # ---- for the energy residual ----

    def force_of_stop(self) -> float:
        """Return the present force of the stop, N."""
        return self._gains[0] * float(self._stop_outputs.get()[0])

    def penetration_at(self, displacement: float) -> float:
        """Return the penetration of the contact point at this displacement, m."""
        return self.sign * (displacement - self._position)

    def show_stop(self, displacement: float, velocity: float) -> None:
        """Write this motion of the contact point to the stop."""
        self._write_inputs(self.penetration_at(displacement), self.sign * velocity)

    def free(self) -> None:
        """Free its saved state, before the stop is freed."""
        if self._probe_state and not self.stop.instance.is_fatal:
            self.stop.instance.free_state(self._probe_state)

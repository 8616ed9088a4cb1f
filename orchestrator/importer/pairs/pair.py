"""Bodies that hit each other: the instant at which two contact points meet, and their mutual impulse or force.

The gap of a pair is `clearance + displacement of the upper body - displacement of the lower one`. No body knows its
gap, so the step is searched from outside. A cubic through gap and closing speed at both ends is compared with the gap
in the middle. The step is halved until both agree and the cubic keeps clear of 0. The first crossing is refined on the
bodies' own motion, and all components are stepped to it.

At that instant the pairs that touch and close give each other impulses until none closes. They do so one pair after
the other, the fastest first: docs/equations.md 3.5.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.importer.component import Component
from vibroimpact.orchestrator.importer.contact_impacts import ContactImpacts
from vibroimpact.orchestrator.importer.pairs.ends import (
    BodyRate,
    Motion,
    PairEnd,
    PortEnd,
    Scale,
    precision_at,
)
from vibroimpact.orchestrator.importer.pairs.force import PairForce
from vibroimpact.orchestrator.importer.pairs.meeting import MeetingSearch
from vibroimpact.orchestrator.importer.specification import PairSpec
from vibroimpact.orchestrator.importer.stop_contacts.pulse import Pulses

#: Closing speed of bodies at rest on each other, relative to the largest speed, above which they hit: their force
#: corrects smaller speeds.
HIT_AT_REST = 1e-4
#: Overlap in touching distances, above which bodies with impacts are pressed together.
PRESSED_OVERLAP = 100.0
#: Overlap at the end of a step, relative to the largest displacement, above which bodies are pressed together.
PRESSED_END_OVERLAP = 1e-3
#: Longest step, as a part of the shortest period of a body that states its periods.
PART_OF_PERIOD = 0.125
#: A step of two bodies that rest on each other is shorter by this factor.
RESTING_STEPS = 16.0
#: Time of all bounces still to come, relative to the longest bounce, below which they are summed to their end.
ACCUMULATED = 1e-3
#: Closing speed times duration of a bounce, in touching distances, below which there is no bounce.
LEAST_BOUNCE = 64.0
#: Duration over the longest step, and closing speed over the largest speed: a bounce is small with both below this
#: part. After `MOST_SMALL_BOUNCES` of them in a row elastic bodies are pressed together.
SMALL_BOUNCE = 1e-3
MOST_SMALL_BOUNCES = 1000
#: Distance of bodies at rest on each other, relative to the largest displacement, above which a remark reports it.
REPORTED_DISTANCE = 1e-9
#: Length of a step over its limit as known at its end, above which the step is shortened.
SLACK = 1.5


class Pair:
    """Two bodies that hit each other, named `lower.contact[k] - upper.contact[k]`; their steps may always be repeated.

    The gap between them closes as the displacement of the lower body grows. `begins_pressed`: the step under way is
    the first, and a yielding contact begins with it.
    """

    active = True

    def __init__(
        self,
        spec: PairSpec,
        lower: PairEnd,
        upper: PairEnd,
        scale: Scale,
        pulses: Pulses,
    ) -> None:
        self.name = spec.name
        self.lower, self.upper = lower, upper
        self._pulses = pulses
        self._refuse_stateless()
        self.bodies = tuple({end.body.name: end.body for end in (self.lower, self.upper)}.values())
        self._scale = scale
        self.impacts = ContactImpacts()
        # the meaning of the variables of other tools' bodies is unknown
        self._rates = [BodyRate(end.body) for end in (self.lower, self.upper) if isinstance(end, PortEnd)]
        self.take(spec)

    @property
    def ends(self) -> tuple[PairEnd, PairEnd]:
        """The lower end and the upper end."""
        return self.lower, self.upper

    def _refuse_stateless(self) -> None:
        for end in self.ends:
            if not end.body.has_states:
                raise ComponentError(
                    f"{end.body.name}: expected a body that can save its state, got one that cannot. "
                    "The instant at which two bodies meet is found by going back.",
                    instance=end.body.name,
                )

    def take(self, spec: PairSpec) -> None:
        """Take the numbers of a specification, for the next run."""
        self.clearance, self.restitution = spec.clearance, spec.restitution
        self._surface = 0.0  # gap at which bodies part after a rest: not quite 0
        self._force = PairForce(spec)
        self.yields = self._force.law is not None

    def begin(self, time: float) -> None:
        """Start a run; bodies that overlap raise ComponentError."""
        self.lower.begin(time)
        self.upper.begin(time)
        self.impacts.forget()
        rate = max((rate.fastest() for rate in self._rates), default=0.0)
        self._longest = PART_OF_PERIOD * 2.0 * math.pi / rate if rate > 0.0 else math.inf
        self._force.begin(self._reduced)
        self._is_new = self._is_at_start = True
        self._agreed = self._last_impact = -math.inf
        self._last_flight, self._longest_flight = math.inf, 0.0
        self._longest_step, self._small_bounces = 0.0, 0
        self._overlap = self._opening = 0.0  # largest overlap and opening of bodies at rest, m
        self._most_force = 0.0  # largest force between bodies at rest, N
        self.arrived = self.closed = self._pressed = self.begins_pressed = False
        gap = self.look().gap
        if not gap >= -self._scale.room(time) and not self.yields:
            raise ComponentError(
                f"{self.name}: expected bodies that do not overlap at the start, got a gap of {gap:.6g} m. "
                "The gap is clearance + displacement of the second - displacement of the first.",
                instance=self.lower.body.name,
                time=time,
            )

    @property
    def struck(self) -> Component:
        """The body that gets the event of an impact."""
        return self.lower.body

    @property
    def _reduced(self) -> float:
        """The reduced mass of both points, kg."""
        return 1.0 / (1.0 / self.lower.mass + 1.0 / self.upper.mass)

    def look(self, seconds: float = 0.0) -> Motion:
        """Return the motion of the pair now, `seconds` into a step."""
        low, low_speed = self.lower.look()
        high, high_speed = self.upper.look()
        scale = self._scale
        scale.displacement = max(scale.displacement, abs(low), abs(high), abs(self.clearance))
        scale.speed = max(scale.speed, abs(low_speed), abs(high_speed))
        return Motion(seconds, self.clearance + high - low - self._surface, low_speed - high_speed)

    def is_due(self, now: Motion, time: float) -> bool:
        """Do the bodies touch and close fast enough for an impact?"""
        if self.yields:
            return False
        room = self._scale.room(time)
        if self._force.resting:
            return now.closing > HIT_AT_REST * self._scale.speed
        return now.gap <= room and (now.closing > self._scale.slow or (now.gap < -room and now.closing > 0.0))

    # ---- a step ----

    def begin_step(self, time: float, target: float, steps: float) -> float:
        """Prepare the pair for a step; returns where the step should end, s."""
        is_first, self._is_at_start, self.begins_pressed = self._is_at_start, False, False
        if self._is_new and not self._pulses.under_way:
            self._ask_bodies(time, target - time)
        start, self._time = self.look(), time
        self._longest_step = max(self._longest_step, target - time)
        self._room = self._scale.room(time)
        if self._pulses.under_way and not self.yields:
            self._start, self.closed, self.arrived = start, False, False
            return target
        if self._surface and start.gap + self._surface > self._room:
            start, self._surface = start._replace(gap=start.gap + self._surface), 0.0
        self._start = start
        was_closed, self.arrived = self.closed, False
        self.closed = self._force.resting
        if self.yields:
            self.closed = self._touches(start)
            self.begins_pressed = is_first and self.closed
        self._steps = steps
        target = min(target, time + self._longest)
        if not self.closed:
            self._force.let_go()
            if was_closed and self.yields:
                self.impacts.part(time, -start.closing)
            return target
        if self.yields and not was_closed:
            self._force.arrive(start.closing)
            self.impacts.touch(time, start.closing)
        if self.yields:
            target = min(target, time + self._force.time_scale(start.gap) / steps)
        else:
            target = min(target, time + self._longest / RESTING_STEPS)
        self._force.start(start.gap, start.closing, target - time)
        return target

    def _ask_bodies(self, time: float, size: float) -> None:
        """Find the fastest rates of other tools' bodies by trials, before their first step."""
        rate = max(end.required_rate(time, size) for end in (self.lower, self.upper))
        if rate > 0.0:
            self._longest = min(self._longest, PART_OF_PERIOD * 2.0 * math.pi / rate)
        self._is_new = False

    def apply(self) -> None:
        """Write the force of the contact to both bodies."""
        if self.closed or self._pressed:
            self.lower.press(self.name, -self._force.value)
            self.upper.press(self.name, self._force.value)
            self._pressed = self._force.value != 0.0

    def revised_end(self, time: float, end: float) -> float | None:
        """Return the end of the step if the last one must be repeated, s; None if it is accepted."""
        if not self.closed:
            return None if self._pulses.under_way else self._meeting(time, end)
        if not self.yields:
            return None  # `Pairs.rest_end` handles all bodies at rest together
        now, size = self.look(end - time), end - time
        scale = self._force.time_scale(now.gap) / self._steps
        if size > SLACK * scale:
            self._force.start(self._start.gap, self._start.closing, scale)
            return time + scale
        return end if self._force.corrects(now.gap, now.closing, size) else None

    @property
    def rests(self) -> bool:
        """Do the bodies rest on each other in the step under way?"""
        return self.closed and self._force.resting

    @property
    def force(self) -> float:
        """The force that the bodies press each other with in the step under way, N."""
        return self._force.value

    @force.setter
    def force(self, value: float) -> None:
        self._force.value = value

    def excess(self, size: float) -> float:
        """Return the closing speed left at the end of a step of bodies at rest, m/s."""
        now = self.look(size)
        return self._force.excess(now.gap, now.closing, size)

    def mobility(self, other: Pair) -> float:
        """Return the closing speed that a unit of impulse between another pair takes from this pair, 1/kg."""
        ends = ((self.lower, 1.0), (self.upper, -1.0))
        others = ((other.lower, 1.0), (other.upper, -1.0))
        return sum(s * t / a.mass for a, s in ends for b, t in others if a.name == b.name)

    def stop_resting(self) -> None:
        """Part the bodies in the step under way: they do not press each other."""
        self._part(self._start.gap)
        self._start = self._start._replace(gap=max(self._start.gap, 0.0))
        self.closed = False

    def end_step(self, size: float) -> None:
        """Accept the step of `size` s.

        ComponentError: the bodies overlap deeply, as the forces of several bodies at rest did not agree.
        """
        end = self._time + size
        deep = PRESSED_END_OVERLAP * max(self._scale.displacement, self._held_back()) + self._room
        if not self.yields and not self._pulses.under_way and self.look().gap < -deep:
            raise self.pressed_error(end)
        if self.closed and self.yields:
            self.impacts.press(self._force.value * size, self._force.at(self.look()))
        if self.rests:
            gap = self.look().gap + self._surface
            self._overlap, self._opening = max(self._overlap, -gap), max(self._opening, gap)
        met = abs(end - self._agreed) <= precision_at(end) or self._touches(self.look())
        self.arrived = self.yields and not self.closed and met

    def _held_back(self) -> float:
        """Return the distance over which the force at rest held the bodies back in a longest step, m; else 0.

        Bodies that rest on each other from the start have not moved, so only this distance gives their scale.
        """
        if self.rests:
            self._most_force = max(self._most_force, abs(self._force.value))
        if not self._most_force:
            return 0.0
        longest = self._longest if math.isfinite(self._longest) else self._longest_step
        return 0.5 * self._most_force / self._reduced * longest * longest

    def remark(self) -> str:
        """Return a remark on the overlap and opening of bodies at rest; empty where both are small."""
        if not max(self._overlap, self._opening) > REPORTED_DISTANCE * self._scale.displacement:
            return ""
        distances = f"overlap by up to {self._overlap:.2g} m and part by up to {self._opening:.2g} m"
        return f"{self.name}: bodies at rest on each other {distances}. Use a shorter macro_step"

    def _touches(self, now: Motion) -> bool:
        return now.gap < -self._room or (now.gap <= self._room and now.closing > 0.0)

    def _meeting(self, time: float, end: float) -> float | None:
        """Return the instant of the step just made at which the bodies first meet before `end`, s, or None."""
        precision = precision_at(time)
        size = end - time
        last = self.look(size)
        search = MeetingSearch(lambda seconds: self._motion_at(time, seconds), self._scale, self._room)
        # a step that ends elsewhere has other inputs and forces, which may have moved the bodies since
        if abs(end - self._agreed) <= precision and last.gap >= search.level(self._start) - self._room:
            return None
        if search.keeps_clear(self._start, last):
            return None
        with self._taken_back():
            located = search.first(self._start, last, precision)
        if located is None:
            return None
        if located >= size:
            self._agreed = end
            return None
        self._agreed = time + located
        return self._agreed

    @contextmanager
    def _taken_back(self) -> Iterator[None]:
        with ExitStack() as stack:
            for body in self.bodies:
                stack.enter_context(body.taken_back())
            yield

    def _motion_at(self, time: float, seconds: float) -> Motion:
        for body in self.bodies:
            body.step_from_start(time, seconds)
        return self.look(seconds)

    def strike(self, now: Motion, time: float, *, is_first: bool) -> None:
        """Give both bodies, now before their impact, its impulse; accumulating bounces end in rest.

        `is_first`: the bodies met by themselves, and no other impact of this instant has thrown them at each other.
        """
        restitution = 0.0 if is_first and self._accumulates(now, time) else self.restitution
        if restitution == 0.0:
            self._refuse_rest(time)
        impulse = (1.0 + restitution) * now.closing * self._reduced
        self.lower.strike(-impulse)
        self.upper.strike(impulse)
        if now.closing > self._scale.slow:
            self.impacts.strike(time, now.closing, self._known(impulse), restitution)
        if self._force.resting:
            self._part(now.gap)
            now = now._replace(gap=max(now.gap, 0.0))
        if restitution == 0.0:
            self._force.rest(now.gap)

    def _known(self, impulse: float) -> float:
        """Return an impulse, N s; NaN where its size is unknown."""
        return impulse

    def _refuse_rest(self, time: float) -> None:
        """Raise ComponentError for bodies that cannot be held on each other."""

    def _part(self, gap: float) -> None:
        """Part bodies that have rested on each other, at their present gap."""
        self._force.let_go()
        self._surface += min(gap, 0.0)

    def pressed_error(self, time: float) -> ComponentError:
        """Return the error of bodies that do not part."""
        return ComponentError(
            f"{self.name}: expected bodies that part after their impacts, got two that stay in contact at time "
            f"{time:.12g}. The law restitution cannot hold them: use kelvin_voigt, hertz or hunt_crossley.",
            instance=self.lower.body.name,
            time=time,
        )

    def is_pressed(self, now: Motion, time: float) -> bool:
        """Return whether the bodies overlap, or have made many successive small bounces."""
        overlaps = now.gap < -PRESSED_OVERLAP * self._scale.room(time) and not self._force.resting
        return overlaps or self._small_bounces > MOST_SMALL_BOUNCES

    def _accumulates(self, now: Motion, time: float) -> bool:
        """Are the bounces still to come short in sum, or no higher than the touching distance?"""
        flight, before = time - self._last_impact, self._last_flight
        self._last_impact, self._last_flight = time, flight
        if math.isfinite(flight):
            self._longest_flight = max(self._longest_flight, flight)
        is_small = (
            flight < SMALL_BOUNCE * self._longest_step and now.closing < SMALL_BOUNCE * self._scale.speed
        )
        self._small_bounces = self._small_bounces + 1 if is_small else 0
        if self.restitution in (0.0, 1.0):
            return self.restitution == 0.0
        shrinks = flight < 0.5 * (1.0 + self.restitution) * before
        longest = min(self._longest, self._longest_flight)
        left = flight * self.restitution / (1.0 - self.restitution)
        low = now.closing * flight < LEAST_BOUNCE * self._scale.room(time)
        return low or (shrinks and left < ACCUMULATED * longest)

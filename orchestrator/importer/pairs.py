"""Bodies that hit each other: where two contact points meet, and what they do to each other.

The gap of a pair is `clearance + displacement of the upper body - displacement of the lower one`. No body knows of it,
so their step is looked at from outside: a cubic through gap and closing speed at both ends is compared with the gap
in the middle, and the step is halved until both agree and the cubic keeps clear of 0; the first crossing is refined on
the bodies' own motion, and all components are stepped to it.

At that instant the pairs that touch and close give each other impulses, one pair after the other, the fastest first,
until none closes: docs/equations.md 3.5.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from typing import NamedTuple

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.fmi.instance3 import Instance3
from vibroimpact.orchestrator.importer.component import Component
from vibroimpact.orchestrator.importer.revision import PRECISION, Bracket, refine
from vibroimpact.orchestrator.importer.specification import PairSpec
from vibroimpact.orchestrator.importer.step_path import StepPath

#: Touching pairs are nearer than what the fastest body moves in this many times the precision of an impact ...
TOUCHING_TIMES = 64.0
#: ... and this times the largest displacement.
TOUCHING_SIZE = 1e-12
#: Closing speeds below this times the largest speed of a body are no impacts, unless the bodies sink into each other.
SLOW = 1e-9
#: Bodies sunk into each other by this many times the distance at which they touch are pressed together.
SUNK = 100.0
#: Impulses at one instant.
MOST_IMPULSES = 10_000
#: A step is at most this part of the shortest period of a body that says its own.
PART_OF_PERIOD = 0.125
#: Halvings of a step in search of a contact.
MOST_HALVINGS = 40
#: A gap this many times larger than what the bodies close at their speeds over a step is not looked into.
FAR = 4.0
#: Allowance for the error of a cubic over the defect that it has in its middle.
MARGIN = 2.0


class Motion(NamedTuple):
    """A pair at one instant of a step: seconds from its start, gap (m) and closing speed (m/s)."""

    seconds: float
    gap: float
    closing: float


class PairEnd:
    """The contact point of one body of a pair.

    Attributes
    ----------
    body : Component
        Its body.
    name : str
        `body.contact[k]`.
    mass : float
        Impulse over the change of its velocity, kg; known once a run has begun.
    """

    def __init__(self, components: Mapping[str, Component], end: tuple[str, str]) -> None:
        component, port = end
        self.name = f"{component}.{port}"
        self.body = components[component]
        self._motion = self.body.group("Float64", [f"{port}.displacement", f"{port}.velocity"])
        self._mass = self.body.group("Float64", [f"{port}.mass"])
        self._impulse = self.body.group("Float64", [f"{port}.applied_impulse"])

    def begin(self) -> None:
        """Start a run."""
        self.mass = float(self._mass.get()[0])

    def look(self) -> tuple[float, float]:
        """Return displacement (m) and velocity (m/s)."""
        displacement, velocity = self._motion.get()
        return float(displacement), float(velocity)

    def strike(self, impulse: float) -> None:
        """Give the point an impulse along its displacement, N s; a body with event mode is in it."""
        self._impulse.values[0] = impulse
        self._impulse.set()
        instance = self.body.instance
        if self.body.event_mode and isinstance(instance, Instance3):
            instance.check(instance.update_call(), "UpdateDiscreteStates")


class Scale:
    """The largest displacement (m) and speed (m/s) that any body of a pair has had, by which others are small."""

    def __init__(self) -> None:
        self.displacement = self.speed = 0.0

    def room(self, time: float) -> float:
        """Return the gap below which bodies touch, m."""
        moved = TOUCHING_TIMES * _precision(time) * self.speed
        return moved + TOUCHING_SIZE * self.displacement

    @property
    def slow(self) -> float:
        """Closing speed that is none, m/s."""
        return SLOW * self.speed


class Pair:
    """Two bodies that hit each other.

    Attributes
    ----------
    name : str
        `lower.contact[k] - upper.contact[k]`.
    lower, upper : PairEnd
        The gap between them closes as the displacement of the lower one grows.
    active : bool
        Steps may have to be repeated: always.
    restitution : float
        Coefficient of restitution.
    """

    active = True

    def __init__(self, components: Mapping[str, Component], spec: PairSpec, scale: Scale) -> None:
        for name in {spec.lower[0], spec.upper[0]}:
            if not components[name].has_states:
                raise ComponentError(
                    f"{name}: expected a body that can save its state, got one that cannot. "
                    "The instant at which two bodies meet is found by going back.",
                    instance=name,
                )
        self.lower, self.upper = PairEnd(components, spec.lower), PairEnd(components, spec.upper)
        self.name = f"{self.lower.name} - {self.upper.name}"
        self.bodies = tuple({end.body.name: end.body for end in (self.lower, self.upper)}.values())
        self._scale = scale
        self._rates = [_Rate(body) for body in self.bodies]
        self.take(spec)

    def take(self, spec: PairSpec) -> None:
        """Take the numbers of a specification, for the next run."""
        self.clearance, self.restitution = spec.clearance, spec.restitution

    def begin(self, time: float) -> None:
        """Start a run.

        Raises
        ------
        ComponentError
            The bodies overlap.
        """
        self.lower.begin()
        self.upper.begin()
        rate = max(rate.fastest() for rate in self._rates)
        self._longest = PART_OF_PERIOD * 2.0 * math.pi / rate if rate > 0.0 else math.inf
        self._agreed = -math.inf
        gap = self.look().gap
        if not gap >= -self._scale.room(time):
            raise ComponentError(
                f"{self.name}: expected bodies that do not overlap at the start, got a gap of {gap:.6g} m. "
                "The gap is clearance + displacement of the second - displacement of the first.",
                instance=self.lower.body.name,
                time=time,
            )

    def look(self, seconds: float = 0.0) -> Motion:
        """Return the pair as it is now, `seconds` into a step."""
        low, low_speed = self.lower.look()
        high, high_speed = self.upper.look()
        scale = self._scale
        scale.displacement = max(scale.displacement, abs(low), abs(high), abs(self.clearance))
        scale.speed = max(scale.speed, abs(low_speed), abs(high_speed))
        return Motion(seconds, self.clearance + high - low, low_speed - high_speed)

    def is_due(self, now: Motion, time: float) -> bool:
        """Do the bodies touch and close?"""
        room = self._scale.room(time)
        return now.gap <= room and (now.closing > self._scale.slow or (now.gap < -room and now.closing > 0.0))

    # ---- a step ----

    def begin_step(self, time: float, target: float, _steps: float) -> float:
        """Look at the pair before a step; returns where it should end, s."""
        self._start = self.look()
        return min(target, time + self._longest)

    def apply(self) -> None:
        """Nothing is held over a step."""

    def revised_end(self, time: float, end: float) -> float | None:
        """Return the instant in the step just made at which the bodies meet first, s; None without one before `end`."""
        precision = _precision(time)
        if abs(end - self._agreed) <= precision:
            return None
        self._room = self._scale.room(time)
        size = end - time
        last = self.look(size)
        if self._keeps_clear(self._start, last):
            return None
        with self._taken_back():
            bracket = self._search(time, self._start, last, MOST_HALVINGS)
            if bracket is None:
                return None
            level = self._level(bracket[0])
            near, far = bracket[0].seconds, bracket[1].seconds
            located = precision + refine(
                Bracket(near, bracket[0].gap - level, far),
                lambda u: self._motion_at(time, u).gap - level,
                precision,
            )
        if located >= size:
            return None
        self._agreed = time + located
        return self._agreed

    def end_step(self, size: float) -> None:
        """Nothing is kept of a step."""

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

    def _level(self, start: Motion) -> float:
        """The gap at which bodies meet: 0, or a little less where they touch already and do not close."""
        return 0.0 if start.gap > self._room else min(start.gap, 0.0) - self._room

    def _keeps_clear(self, first: Motion, last: Motion) -> bool:
        """Is the gap too large to be closed at such speeds?"""
        size = last.seconds - first.seconds
        moved = size * max(abs(first.closing), abs(last.closing)) + abs(last.gap - first.gap)
        return min(first.gap, last.gap) > FAR * moved + self._room

    def _search(
        self, time: float, first: Motion, last: Motion, halvings: int
    ) -> tuple[Motion, Motion] | None:
        """Return the ends of a part of the step in which the bodies meet for the first time; None where they do not."""
        if self._keeps_clear(first, last):
            return None
        level = self._level(first)
        path = StepPath(first.gap, -first.closing, last.gap, -last.closing, last.seconds - first.seconds)
        middle = self._motion_at(time, first.seconds + 0.5 * path.size)
        error = MARGIN * abs(middle.gap - path.at(0.5)[0]) + self._rounding()
        if last.gap > level:
            if _lowest(path) - error > level or halvings == 0:
                return None
        elif halvings == 0 or (middle.closing > 0.0 and first.closing >= 0.0 and _falls(path)):
            return first, last
        if middle.gap <= level:
            return self._search(time, first, middle, halvings - 1)
        found = self._search(time, first, middle, halvings - 1)
        return self._search(time, middle, last, halvings - 1) if found is None else found

    def _rounding(self) -> float:
        return 0.01 * self._room

    def strike(self, now: Motion) -> None:
        """Give both bodies the impulse of their impact."""
        below, above = self.lower.mass, self.upper.mass
        impulse = (1.0 + self.restitution) * now.closing / (1.0 / below + 1.0 / above)
        self.lower.strike(-impulse)
        self.upper.strike(impulse)


class Pairs:
    """All pairs of bodies of an importer that hit each other.

    Attributes
    ----------
    pairs : list of Pair
        In the order of their specifications.
    """

    def __init__(self, components: Mapping[str, Component], specs: Sequence[PairSpec]) -> None:
        self._scale = Scale()
        self.pairs = [Pair(components, spec, self._scale) for spec in specs]
        bodies = {body.name: body for pair in self.pairs for body in pair.bodies}
        self._instances = [
            body.instance
            for body in bodies.values()
            if body.event_mode and isinstance(body.instance, Instance3)
        ]

    def begin(self, time: float) -> None:
        """Start a run: initialization has ended."""
        self._scale.displacement = self._scale.speed = 0.0
        for pair in self.pairs:
            pair.look()
        for pair in self.pairs:
            pair.begin(time)

    def __bool__(self) -> bool:
        """Is there any pair?"""
        return bool(self.pairs)

    def resolve(self, time: float) -> list[str]:
        """Give the impulses of the instant `time`, s, if there are any.

        Returns
        -------
        bodies : list of str
            The lower body of each impact.

        Raises
        ------
        ComponentError
            The impulses do not end, or bodies are pressed together.
        """
        hit: list[str] = []
        if not any(pair.is_due(pair.look(), time) for pair in self.pairs):
            return hit
        for instance in self._instances:
            instance.check(instance.enter_event_call(), "EnterEventMode")
        for _ in range(MOST_IMPULSES):
            due = [(now.closing, pair, now) for pair in self.pairs if pair.is_due(now := pair.look(), time)]
            if not due:
                break
            closing, pair, now = max(due, key=lambda found: found[0])
            self._refuse_pressed(pair, now, time)
            pair.strike(now)
            if closing > self._scale.slow:
                hit.append(pair.lower.body.name)
        else:
            raise self._endless(time)
        for instance in self._instances:
            instance.check(instance.enter_step_call(), "EnterStepMode")
        return hit

    def _refuse_pressed(self, pair: Pair, now: Motion, time: float) -> None:
        if now.gap < -SUNK * self._scale.room(time):
            raise ComponentError(
                f"{pair.name}: expected bodies that part after their impacts, got two that stay in contact at time "
                f"{time:.12g}. The law restitution has no force to hold them: use kelvin_voigt, hertz or "
                "hunt_crossley.",
                instance=pair.lower.body.name,
                time=time,
            )

    def _endless(self, time: float) -> ComponentError:
        names = ", ".join(pair.name for pair in self.pairs if pair.is_due(pair.look(), time))
        return ComponentError(
            f"{names}: expected impacts that end, got {MOST_IMPULSES} at time {time:.17g}. "
            "Use a law that yields: kelvin_voigt, hertz or hunt_crossley.",
            instance=self.pairs[0].lower.body.name,
            time=time,
        )


class _Rate:
    """The fastest rate that a body says of itself, rad/s; 0 where it says none."""

    def __init__(self, body: Component) -> None:
        def group(names: Sequence[str]) -> Callable[[], list[float]]:
            if not names:
                return list
            found = body.group("Float64", names)
            return lambda: [float(value) for value in found.get()]

        known = body.variables
        self._natural = group([n for n in known if n.startswith("natural_angular_frequency[")])
        self._forcing = group([n for n in ("forcing.angular_frequency",) if n in known])
        self._spring = group(
            ["mass", "stiffness", "damping"] if {"mass", "stiffness", "damping"} <= set(known) else []
        )

    def fastest(self) -> float:
        """Return it; the parameters are set."""
        rates = [0.0, *self._natural(), *self._forcing()]
        spring = self._spring()
        if spring:
            mass, stiffness, damping = spring
            rates += [math.sqrt(stiffness / mass), damping / mass]
        return max(rates)


def _precision(time: float) -> float:
    """Seconds to which an impact is located."""
    return PRECISION + 2.0 * math.ulp(time)


def _lowest(path: StepPath) -> float:
    """Lowest displacement of a cubic path."""
    return min(path.start, path.end, *(path.at(u)[0] for u in _turns(path)))


def _falls(path: StepPath) -> bool:
    """Does a cubic path never turn?"""
    return not _turns(path)


def _turns(path: StepPath) -> list[float]:
    """Fractions of a step at which the velocity of a cubic path is 0."""
    v, w, mean = path.start_velocity, path.end_velocity, (path.end - path.start) / path.size
    a, b, c = 3.0 * (v + w - 2.0 * mean), 2.0 * (3.0 * mean - 2.0 * v - w), v
    square = b * b - 4.0 * a * c
    if square < 0.0:
        return []
    q = -0.5 * (b + math.copysign(math.sqrt(square), b))
    roots = [q / a if a != 0.0 else math.nan, c / q if q != 0.0 else math.nan]
    return [u for u in roots if 0.0 < u < 1.0]

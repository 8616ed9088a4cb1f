"""Step revision: the instant at which a watched variable of a black-box FMU crosses its level.

The FMU knows nothing of events. Its step is repeated from a saved state until the crossing lies in an interval of
rounding size; each repetition goes to a better estimate. The step that is kept ends just past the crossing. An FMU
that tests its own state at the end of a step thus sees the event there.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.fmi.exchange import ExchangeInstance
from vibroimpact.orchestrator.importer.component import Component
from vibroimpact.orchestrator.importer.specification import EventSpec

#: Width of the interval in which a crossing is located, over (1 + |time|), s.
PRECISION = 2e-13
#: Spacing of two events of one watch, over (1 + |time|), s, below which events have accumulated and are no longer
#: located.
SHORTEST_SPACING = 1e-9
MOST_EVALUATIONS = 200
#: Distance to the level that counts as 0: some FMUs put a bounced ball at the smallest number instead.
NEGLIGIBLE = 1e-300
#: Most halvings of a step in search of a point on the near side of the level.
MOST_HALVINGS = 30


@dataclass(slots=True)
class Bracket:
    """Seconds from the start of the step, and the signed distance from the level: near side > 0 >= far side."""

    near: float
    near_value: float
    far: float

    @property
    def width(self) -> float:
        """Seconds between its ends."""
        return self.far - self.near


class Watch:
    """A watched variable of a component with states.

    `accumulated`: events came too close together and are no longer located. The last located event was at `last_time`,
    s.
    """

    def __init__(self, component: Component, event: EventSpec) -> None:
        if not component.has_states:
            raise ComponentError(
                f"{event.component}.{event.variable}: expected a watched component that can save its state, "
                f"got one that cannot. Its events can be located only to a communication step.",
                instance=event.component,
            )
        self.component = component
        self.event = event
        self._group = component.group("Float64", [event.variable])
        self.begin()

    def begin(self) -> None:
        """Forget the previous run."""
        self.accumulated = False
        self.last_time = -math.inf
        self._agreed = -math.inf
        self._start = 0.0
        self._landed: float | None = None

    def distance(self) -> float:
        """Return the signed distance to the level now, positive on the side from which a crossing is an event."""
        value = float(self._group.get()[0]) - self.event.level
        return -value if self.event.direction == "rising" else value

    def note_start(self) -> None:
        """Remember the distance at the start of a step."""
        self._start = self.distance()

    def find(self, time: float, size: float) -> float | None:
        """Return the seconds into the step just made at which the first crossing lies; None without a crossing.

        The component is left somewhere in the step, and the caller repeats it to the crossing. In that repeated step
        the crossing is the end; the component is then left there.
        """
        self._landed = None
        if self.accumulated:
            return None
        self.component.note_inputs()
        sign = -1.0 if self.event.direction == "either" and self._start < 0.0 else 1.0
        if sign * self.distance() > NEGLIGIBLE:
            return None
        if abs(time + size - self._agreed) <= PRECISION:
            self._landed = self._agreed
            return size
        near = self._near_side(time, size, sign)
        if near is None:
            self._value_at(time, size)  # back to the end of the step
            return None
        bracket = Bracket(near[0], near[1], size)
        precision = PRECISION * (1.0 + abs(time))
        # a little further, so that the FMU's own test sees the crossing too, however it treats an exact zero
        located = precision + refine(bracket, lambda u: sign * self._value_at(time, u), precision)
        if located >= size:
            self._value_at(time, size)
            self._landed = time + size
            return size
        self._agreed = time + located
        return located

    def forget(self) -> None:
        """Forget a step that was taken back."""
        self._landed = None

    def confirm(self) -> None:
        """Accept the step just made: a crossing at its end is an event."""
        if self._landed is not None:
            self.accumulated = self._landed - self.last_time < SHORTEST_SPACING * (1.0 + abs(self._landed))
            self.last_time = self._landed
            self._landed = None

    def _near_side(self, time: float, size: float, sign: float) -> tuple[float, float] | None:
        """Return a point of the step on the near side: its start, or (after an event) a moment later."""
        if sign * self._start > NEGLIGIBLE:
            return 0.0, sign * self._start
        u = size
        for _ in range(MOST_HALVINGS):
            u *= 0.5
            value = sign * self._value_at(time, u)
            if value > NEGLIGIBLE:
                return u, value
        return None

    def _value_at(self, time: float, u: float) -> float:
        self.component.revisit_start()
        self.component.instance.step_undiscarded(time, u)
        return self.distance()


def watch_of(component: Component, event: EventSpec) -> Watch | None:
    """Return the watch of a component's variable; None in model exchange, whose integration finds the crossing."""
    if not isinstance(component.instance, ExchangeInstance):
        return Watch(component, event)
    reference = component.variables[event.variable].valueReference
    component.instance.points.level(reference, event.direction, event.level)
    return None


def refine(bracket: Bracket, value: Callable[[float], float], precision: float) -> float:
    """Narrow a bracket to `precision` and return its far end.

    Guesses come from a parabola through the last near points. Values on the far side may be meaningless, as the FMU
    may have reset its state there. A bisection follows a poor guess. The bracket has near side > 0 >= far side. The
    value is the signed distance at a number of seconds.

    >>> round(refine(Bracket(0.0, 1.0, 2.0), lambda u: 1.0 - u * u, 1e-13), 12)
    1.0
    """
    points = [(bracket.near, bracket.near_value)]
    last_guess: float | None = None
    for turn in range(MOST_EVALUATIONS):
        if bracket.width <= precision:
            break
        guess = _extrapolated(points)
        usable = guess is not None and bracket.near < guess < bracket.far and turn % 4 != 3
        u = guess if usable and guess is not None else 0.5 * (bracket.near + bracket.far)
        margin = abs(u - last_guess) if last_guess is not None else bracket.width
        last_guess = u
        width = bracket.width
        _probe(bracket, points, value, u)
        if usable and bracket.width > 0.5 * width:
            # the guess was good on one side: close the other one
            step = max(0.4 * precision, min(2.0 * margin, 0.25 * bracket.width))
            beyond = bracket.near + step if bracket.near == u else bracket.far - step
            _probe(bracket, points, value, beyond)
    return bracket.far


def _probe(
    bracket: Bracket, points: list[tuple[float, float]], value: Callable[[float], float], u: float
) -> None:
    if not bracket.near < u < bracket.far:
        return
    found = value(u)
    if found > NEGLIGIBLE:
        bracket.near, bracket.near_value = u, found
        points.append((u, found))
        del points[:-3]
    else:
        bracket.far = u


def _extrapolated(points: list[tuple[float, float]]) -> float | None:
    """Return the next root of the parabola (or line) through the last near points; None without a root ahead."""
    if len(points) < 2:
        return None
    (a, fa), (b, fb) = points[-2:]
    if b == a:
        return None
    slope = (fb - fa) / (b - a)
    if len(points) == 2:
        return b - fb / slope if slope < 0.0 else None
    c, fc = points[-3]
    bend = (slope - (fa - fc) / (a - c)) / (b - c)
    # f(b + s) = fb + (slope + bend (b - a)) s + bend s^2
    tangent = slope + bend * (b - a)
    square = tangent * tangent - 4.0 * bend * fb
    if square < 0.0:
        return None
    root = square**0.5
    denominator = -tangent + root
    return b + 2.0 * fb / denominator if denominator > 0.0 else None

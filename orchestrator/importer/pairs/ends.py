"""The ends of a pair of bodies: their contact points, their motion, and the scale of that motion."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from vibroimpact.orchestrator.fmi.exchange import ExchangeInstance
from vibroimpact.orchestrator.fmi.instance3 import Instance3
from vibroimpact.orchestrator.importer.component import Component
from vibroimpact.orchestrator.importer.revision import PRECISION
from vibroimpact.orchestrator.importer.specification import BodyPoint
from vibroimpact.orchestrator.importer.stop_contacts.asked_stop import LOWER_SIDE
from vibroimpact.orchestrator.importer.stop_contacts.force_input import (
    ForceInput,
    ForceInputs,
    TrialSteps,
    force_input_of,
)
from vibroimpact.orchestrator.importer.stop_contacts.pulse import UNKNOWN_MASS, Pulses

#: Factor of the touching distance: bodies touch below the way of the fastest body in this many impact precisions ...
TOUCHING_TIMES = 64.0
#: ... plus this part of the largest displacement.
TOUCHING_SIZE = 1e-12
#: Closing speed, relative to the largest speed of a body, below which bodies that touch have no impact. Bodies that
#: overlap have one at any closing speed.
SLOW = 1e-9


class Motion(NamedTuple):
    """A pair at one instant of a step: seconds from its start, gap (m) and closing speed (m/s)."""

    seconds: float
    gap: float
    closing: float


class PortEnd:
    """The contact port of a body of this package, as one end of a pair.

    Its name is `body.contact[k]`. Its mass is impulse over the change of its velocity, kg, known once a run has begun.
    """

    def __init__(
        self,
        components: Mapping[str, Component],
        end: tuple[str, str],
        inputs: ForceInputs,
    ) -> None:
        component, port = end
        self.name = f"{component}.{port}"
        self.body = components[component]
        self._motion = self.body.group("Float64", [f"{port}.displacement", f"{port}.velocity"])
        self._mass = self.body.group("Float64", [f"{port}.mass"])
        self._impulse = self.body.group("Float64", [f"{port}.applied_impulse"])
        self._side = self.body.group("Int64", [f"{port}.side"])
        self.input = inputs.setdefault(end, ForceInput(self.body, f"{port}.applied_force"))

    def begin(self, time: float) -> None:
        """Start a run at `time`, s."""
        self.mass = float(self._mass.get()[0])
        self._direction = -1.0 if int(self._side.get()[0]) == LOWER_SIDE else 1.0
        self.input.parts.clear()

    def required_rate(self, time: float, size: float) -> float:
        """Return 0: the body gives all its rates itself (`BodyRate`)."""
        return 0.0

    def press(self, pair: str, force: float) -> None:
        """Hold a force of a pair along the displacement over the next step, N."""
        self.input.parts[pair] = -self._direction * force
        self.input.write()

    def look(self) -> tuple[float, float]:
        """Return displacement (m) and velocity (m/s)."""
        displacement, velocity = self._motion.get()
        return float(displacement), float(velocity)

    def strike(self, impulse: float) -> None:
        """Give the point an impulse along its displacement, N s; a body with event mode is in that mode."""
        self._impulse.values[0] = impulse
        self._impulse.set()
        instance = self.body.instance
        if self.body.event_mode and isinstance(instance, Instance3):
            instance.check(instance.update_call(), "UpdateDiscreteStates")

    def free(self) -> None:
        """There is no saved state to free."""


class PointEnd:
    """The point of a body of any tool as one end of a pair: it takes a force, or an impulse as a pulse."""

    def __init__(
        self,
        components: Mapping[str, Component],
        point: BodyPoint,
        inputs: ForceInputs,
        pulses: Pulses | None,
    ) -> None:
        self.name = point.name
        self.body = components[point.component]
        self._given = UNKNOWN_MASS if point.mass is None else point.mass
        if isinstance(self.body.instance, ExchangeInstance):
            self.body.instance.points.has_contacts = True
        self._motion = self.body.group("Float64", [point.displacement, point.velocity])
        self.input = force_input_of(self.body, point.force, inputs)
        """The force input, which all contacts of the point share."""
        self._trials = TrialSteps(self.body, point.velocity, self.input)
        self.pulse = None if pulses is None else pulses.of(point, self.input)
        """Its impulses; None with a yielding law."""

    @property
    def mass(self) -> float:
        """Impulse over the change of the velocity, kg: the given mass, or the mass that pulses have measured."""
        return self._given if self.pulse is None else self.pulse.mass

    def begin(self, time: float) -> None:
        """Start a run at `time`, s: a point with impulses tests that the body answers them."""
        self.input.parts.clear()
        if self.pulse is not None:
            self.pulse.begin(time)

    def required_rate(self, time: float, size: float) -> float:
        """Return the body's fastest rate, rad/s, by trials of at most `size` s; 0 for a slower body.

        With a yielding law the steps follow from the given mass: trials check that mass, and no rate is needed.
        """
        if self.pulse is not None:
            return self._trials.rate(self.pulse.mass, time, size)
        self._trials.check_mass(self._given, time, size)
        return 0.0

    def press(self, pair: str, force: float) -> None:
        """Hold a force of a pair along the displacement over the next step, N."""
        self.input.parts[pair] = force
        self.input.write()

    def look(self) -> tuple[float, float]:
        """Return displacement (m) and velocity (m/s); the velocity includes the impulse still to be given."""
        displacement, velocity = (float(value) for value in self._motion.get())
        if self.pulse is not None and self.pulse.owed:
            velocity += self.pulse.owed / self.pulse.mass
        return displacement, velocity

    def strike(self, impulse: float) -> None:
        """Give the point an impulse along its displacement, N s: at once in model exchange, else in the next step."""
        assert self.pulse is not None
        self.pulse.strike(impulse)

    def free(self) -> None:
        """Free the states that trial steps have saved."""
        self._trials.free()


class SurfaceEnd:
    """The surface of a rigid stop, at a position in m, as one end of a pair: it never moves, its mass is infinite."""

    mass, position = math.inf, 0.0

    def __init__(self, stop: Component) -> None:
        self.body, self.name = stop, stop.name

    def begin(self, time: float) -> None:
        """Start a run at `time`, s."""

    def required_rate(self, time: float, size: float) -> float:
        """Return 0: a surface has no rate."""
        return 0.0

    def press(self, pair: str, force: float) -> None:
        """Do nothing: no force moves the surface."""

    def look(self) -> tuple[float, float]:
        """Return displacement (m) and velocity (m/s)."""
        return self.position, 0.0

    def strike(self, impulse: float) -> None:
        """Do nothing: no impulse moves the surface."""

    def free(self) -> None:
        """There is no saved state to free."""


PairEnd = PortEnd | PointEnd | SurfaceEnd


def end_of(
    components: Mapping[str, Component],
    end: tuple[str, str] | BodyPoint,
    inputs: ForceInputs,
    pulses: Pulses | None,
) -> PairEnd:
    """Return one end of a pair; `pulses` gives it impulses, None with a yielding law."""
    if isinstance(end, BodyPoint):
        return PointEnd(components, end, inputs, pulses)
    return PortEnd(components, end, inputs)


class Scale:
    """Largest displacement (m) and speed (m/s) of the bodies of all pairs: the scale of small gaps and speeds."""

    def __init__(self) -> None:
        self.displacement = self.speed = 0.0

    def room(self, time: float) -> float:
        """Return the gap below which bodies touch, m."""
        moved = TOUCHING_TIMES * precision_at(time) * self.speed
        return moved + TOUCHING_SIZE * self.displacement

    @property
    def slow(self) -> float:
        """Closing speed below which there is no impact, m/s."""
        return SLOW * self.speed


class BodyRate:
    """The fastest rate that a body's variables give, rad/s; 0 without such variables."""

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
        """Return the fastest rate, rad/s; the parameters are set."""
        rates = [0.0, *self._natural(), *self._forcing()]
        spring = self._spring()
        if spring:
            mass, stiffness, damping = spring
            rates += [math.sqrt(stiffness / mass), damping / mass]
        return max(rates)


def precision_at(time: float) -> float:
    """Return the precision of the instant of an impact, s."""
    return PRECISION + 2.0 * math.ulp(time)

"""Stops whose force reaches a body by plain connections: the energy error of such an exchange.

A plain force has the value of the start of a step, or of the step before, and is held over a step. A lossless contact
of n steps gains about 5/n of its energy. Only the energy of a run shows this error, so it is summed and reported.
"""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence

from vibroimpact.orchestrator.importer.component import Component
from vibroimpact.orchestrator.importer.feedthrough import connection_name
from vibroimpact.orchestrator.importer.specification import ConnectionSpec, StopContactSpec
from vibroimpact.orchestrator.importer.stop_contacts.asked_stop import AskedStop, ContactWork
from vibroimpact.orchestrator.importer.stop_contacts.step_path import StepPath

#: Variables of an ImpactStop (the first is its force); other components with a force need not be stops.
FORCE, ANSWER, DISPLACEMENT, VELOCITY = "applied_force", "applied_restitution", "displacement", "velocity"
#: Relative energy gain of a lossless contact by a plain connection, times its number of steps (docs/coupling.md).
GAIN = 5.0
#: Residual relative to the energy of the contacts, above which a remark reports it.
REPORTED_RESIDUAL = 1e-6


def plain_contact(
    variables: Mapping[str, Container[str]], connections: Sequence[ConnectionSpec], force: ConnectionSpec
) -> StopContactSpec | None:
    """Return the contact that a plain connection of an ImpactStop's force closes; None if it closes no contact.

    The variables of each component are given by name, and all connections of an importer.
    """
    (stop, output), (body, target) = force.source, force.target
    port = target.rpartition(".")[0]
    if output != FORCE or ANSWER not in variables[stop] or f"{port}.law" in variables[body]:
        return None
    by_variable = {c.target[1]: c for c in connections if c.target[0] == stop and c.source[0] == body}
    changed = any(c.gain != 1.0 or c.offset for c in by_variable.values()) or force.offset
    if DISPLACEMENT not in by_variable or changed:
        return None
    velocity = by_variable.get(VELOCITY)
    return StopContactSpec(
        body,
        by_variable[DISPLACEMENT].source[1],
        by_variable[DISPLACEMENT].source[1] if velocity is None else velocity.source[1],
        target,
        stop,
        stop_velocity=None if velocity is None else VELOCITY,
    )


class PlainContact:
    """A stop whose force reaches a body by a plain connection.

    The residual is the energy that the body received beyond the law of the stop, J.
    """

    def __init__(
        self, components: Mapping[str, Component], connection: ConnectionSpec, spec: StopContactSpec
    ) -> None:
        self._name, self._spec = connection_name(connection), spec
        self._stop = AskedStop(components[spec.stop], spec)
        body = self._body = components[spec.body]
        self._motion = body.group("Float64", [spec.displacement, spec.velocity])
        self._applied = body.group("Float64", [connection.target[1]])
        self._yields = False
        self.begin(connection.gain)

    def begin(self, gain: float) -> None:
        """Start a run with this gain."""
        self._gain = gain
        self._has_started = self._is_within = False
        self._work = ContactWork()
        self.residual = 0.0

    def before(self, time: float) -> None:
        """Note the start of a step."""
        if not self._has_started:
            self._yields = not self._stop.is_rigid
            if self._yields:
                self._stop.begin()
            self._has_started = True
        if self._yields and not self._is_within:
            self._start, self._began = self._look(), time
            self._stop.mark(time)

    def after(self, time: float, end: float) -> None:
        """Compare the work of the force over the step with that of the law."""
        if not (self._yields and end > time):
            return
        self._is_within = self._body.is_within_own_step(end)
        if self._is_within:
            return
        path = StepPath(*self._start, *self._look(), end - self._began)
        surface = self._stop.surface
        if surface is not None and max(path.start, path.end) < surface and path.turn is None:
            work = 0.0
        else:
            with self._stop.asking():
                work = self._stop.work(path)
        moved = self._stop.sign * (path.end - path.start)
        self.residual += float(self._applied.get()[0]) * moved - self._gain * self._stop.sign * work
        self._work.count(work)

    def remark(self) -> str:
        """Return a remark on the residual; empty where it is small."""
        if not abs(self.residual) > REPORTED_RESIDUAL * self._work.energy:
            return ""
        steps = self._work.steps / max(1, self._work.contacts)
        return (
            f"{self._name}: the force of a stop by a plain connection has {self._work.share(self.residual)}, at about "
            f'{steps:.0f} steps a contact. Use [[contact]] with body = "{self._spec.body}" and '
            f'stop = "{self._spec.stop}", which closes it'
        )

    def free(self) -> None:
        """Free its saved states, before its components are freed."""
        self._stop.free()

    def _look(self) -> tuple[float, float]:
        displacement, velocity = (float(v) for v in self._motion.get())
        if self._spec.stop_velocity is None:
            velocity = 0.0
        return self._stop.sign * displacement, self._stop.sign * velocity


class ForceThatBegins:
    """A force from a component of another tool, which only one body moves: the component may be a stop.

    It counts as a stop if the force begins or ends in a run. Its law is unknown, so a rule gives its error.
    """

    def __init__(self, components: Mapping[str, Component], connection: ConnectionSpec) -> None:
        self._connection = connection
        self._force = components[connection.source[0]].group("Float64", [connection.source[1]])
        self.begin()

    @staticmethod
    def is_one(
        components: Mapping[str, Component], connections: Sequence[ConnectionSpec], force: ConnectionSpec
    ) -> bool:
        """May this connection carry the force of a stop?"""
        (source, output), (body, target) = force.source, force.target
        inward = [c for c in connections if c.target[0] == source]
        at_a_port = f"{target.rpartition('.')[0]}.law" in components[body].variables
        return (
            not at_a_port
            and output not in components[source].shapes
            and ANSWER not in components[source].variables
            and _unit(components[source], output) == "N"
            and any(_unit(components[source], c.target[1]) == "m" for c in inward)
            and all(c.source[0] == body for c in inward)
        )

    def begin(self) -> None:
        """Start a run."""
        self._pressed: bool | None = None
        self._steps = self._contacts = self._ended = 0

    def look(self) -> None:
        """Count the steps, contacts and ends of contacts, after a step."""
        pressed = float(self._force.get()[0]) != 0.0
        self._contacts += pressed and self._pressed is not True
        self._steps += pressed
        self._ended += self._pressed is True and not pressed
        self._pressed = pressed

    def remark(self) -> str:
        """Return a remark on the estimated error; empty if the force never ended."""
        if not self._ended:
            return ""
        steps = self._steps / self._contacts
        (stop, _), (body, _) = self._connection.source, self._connection.target
        return (
            f"{connection_name(self._connection)}: a force that begins and ends, as a stop's, by a plain connection: "
            f"at about {steps:.0f} steps a contact it adds about {min(1.0, GAIN / steps):.2g} of the energy of each. "
            f'Use [[contact]] with body = "{body}" and stop = "{stop}", which closes it'
        )


def _unit(component: Component, name: str) -> str:
    variable = component.variables[name]
    declared = variable.declaredType.unit if variable.declaredType is not None else None
    return str(variable.unit or declared or "")

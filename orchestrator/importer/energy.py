"""The energy that the exchange itself adds to coupled components, for each force-displacement connection.

A force held over a step differs from the force at the other side of the connection. Over the step its excess work is
(mean force applied - mean force connected) * displacement of the receiver. The sum over all steps is the residual of
that connection, in joule; exact coupling has a residual of 0.

At a contact with a yielding stop the body follows a force that is linear in penetration and rate. The residual is the
integral of (that force - the force of the stop's law on the body's path) * velocity. A body that holds its force has
the residual in its bond (`held_force`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from vibroimpact.orchestrator.importer.described import description_of
from vibroimpact.orchestrator.importer.events import StepWatcher
from vibroimpact.orchestrator.importer.feedthrough import connection_name
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.specification import ComponentSpec, ConnectionSpec, StopContactSpec
from vibroimpact.orchestrator.importer.stop_contacts.contact_bond import ContactBond
from vibroimpact.orchestrator.importer.stop_contacts.plain_contacts import (
    ForceThatBegins,
    PlainContact,
    plain_contact,
)
from vibroimpact.orchestrator.importer.stop_contacts.step_path import POINTS, WEIGHTS

#: Names of force inputs (last part), each with the displacement on which it does work.
CONJUGATE = {"force": "displacement", "applied_force": "displacement"}


def conjugate_displacement(variables: Container[str], variable: str) -> str | None:
    """Return the displacement on which a force input does work; None when the input is no such force.

    `variables` has the names of variables that are single numbers.
    """
    head, _, last = variable.rpartition(".")
    if last not in CONJUGATE:
        return None
    name = f"{head}.{CONJUGATE[last]}" if head else CONJUGATE[last]
    return name if name in variables and variable in variables else None


def force_connections(
    components: Sequence[ComponentSpec],
    connections: Sequence[ConnectionSpec],
    contacts: Sequence[StopContactSpec] = (),
) -> tuple[str, ...]:
    """Return the names of the connections whose energy residual is summed, and of the contacts behind them."""
    variables = {
        c.name: {v.name for v in description_of(c.fmu).modelVariables if not v.dimensions} for c in components
    }
    forces = [
        connection_name(c)
        for c in connections
        if conjugate_displacement(variables[c.target[0]], c.target[1])
        or plain_contact(variables, connections, c)
    ]
    return (*forces, *(contact.name for contact in contacts))


#: Resolution of the separation of a body within a step, as a fraction of the step.
SEPARATION = 1e-12


class _Connection:
    """A force that is given once a step, perhaps with its slope over time."""

    def __init__(self, importer: Importer, connection: ConnectionSpec, displacement: str) -> None:
        source = importer.components[connection.source[0]]
        target = importer.components[connection.target[0]]
        self._gain, self._offset = connection.gain, connection.offset
        self._source = source.group("Float64", [connection.source[1]])
        self._applied = target.group("Float64", [connection.target[1]])
        self._displacement = target.group("Float64", [displacement])
        slope = f"{connection.target[1]}_rate"
        self._slope = target.group("Float64", [slope]) if slope in target.variables else None
        self._target = target
        self.begin(connection.gain)

    def begin(self, gain: float) -> None:
        self._gain = gain
        self.residual = self._impulse = self._seconds = 0.0

    def before(self, time: float) -> None:
        self._force_start = self._force()
        if not self._seconds:  # a receiver on its own grid may be within a step
            self._displacement_start = float(self._displacement.get()[0])

    def after(self, time: float, end: float) -> None:
        applied = float(self._applied.get()[0])
        if self._slope is not None:
            applied += 0.5 * (end - time) * float(self._slope.get()[0])
        connected = 0.5 * (self._force_start + self._force())
        moved = float(self._displacement.get()[0]) - self._displacement_start
        if self._target.on_own_grid:
            self._impulse += connected * (end - time)
            self._seconds += end - time
            if self._target.is_within_own_step(end):
                return
            connected = self._impulse / self._seconds if self._seconds else connected
            self._impulse = self._seconds = 0.0
        self.residual += (applied - connected) * moved

    def _force(self) -> float:
        return self._gain * float(self._source.get()[0]) + self._offset


class _Contact:
    """The force of a yielding stop: the force felt over a step, against the stop's own law on the body's path.

    The body is taken back to a few points of the step, and the stop gives its force at each.
    """

    def __init__(self, bond: ContactBond) -> None:
        self._bond = bond
        port = bond.port
        self._motion = bond.body.group(
            "Float64", [f"{port}.{x}" for x in ("displacement", "velocity", "force")]
        )
        self.residual = 0.0

    @property
    def follows(self) -> bool:
        """Does the body follow the force of the stop in this run?"""
        return self._bond.follows

    def begin(self, gain: float) -> None:
        self.residual = 0.0

    def before(self, time: float) -> None:
        pass

    def after(self, time: float, end: float) -> None:
        bond = self._bond
        if not (bond.active and bond.body.has_states and end > time):
            return
        self._last_force = bond.look().force
        with bond.body.taken_back():
            kinks = [0.0, *self._kinks(time, end - time), end - time]
            parts = [(a, b) for a, b in pairwise(kinks) if b > a]
            ways = [self._way(time, begin, finish) for begin, finish in parts]
        for (begin, finish), way in zip(parts, ways, strict=True):
            self.residual += (finish - begin) * float(np.sum(WEIGHTS * self._power(time, end, way)))

    def _kinks(self, time: float, size: float) -> list[float]:
        """Return the times (s) from the start of the step to the separation from the stop and to its surface."""
        bond = self._bond
        kinks = []
        if bond.start.force > 0.0 and not self._felt(time, size)[3] > 0.0:
            kinks.append(self._last(time, size, lambda felt: felt[3] > 0.0))
        if bond.start.penetration > 0.0 and not self._penetration(self._felt(time, size)) > 0.0:
            kinks.append(self._last(time, size, lambda felt: self._penetration(felt) > 0.0))
        return sorted(kinks)

    def _penetration(self, felt: tuple[float, float, float, float]) -> float:
        return self._bond.penetration_at(felt[1])

    def _last(
        self, time: float, size: float, holds: Callable[[tuple[float, float, float, float]], bool]
    ) -> float:
        """Return the last moment of a condition that is true at the start of the step and false at its end, s."""
        near, far = 0.0, size
        while far - near > SEPARATION * size:
            middle = 0.5 * (near + far)
            near, far = (middle, far) if holds(self._felt(time, middle)) else (near, middle)
        return far

    def _way(self, time: float, begin: float, finish: float) -> NDArray[np.float64]:
        """Seconds from the start, displacement, velocity and force felt at the points of a part; one row each."""
        return np.array([self._felt(time, begin + float(u) * (finish - begin)) for u in POINTS])

    def _felt(self, time: float, size: float) -> tuple[float, float, float, float]:
        self._bond.body.step_from_start(time, size)
        displacement, velocity, force = (float(v) for v in self._motion.get())
        return size, displacement, velocity, force

    def _power(self, time: float, end: float, way: NDArray[np.float64]) -> NDArray[np.float64]:
        """Excess power that the body receives at the points of a part, W."""
        bond = self._bond
        if bond.stop.has_states:
            with bond.stop.taken_back():
                answered = np.array([self._answered(time, *map(float, row[:3])) for row in way])
        else:
            answered = bond.start.force + (self._last_force - bond.start.force) * way[:, 0] / (end - time)
        # a force that presses the body away from the stop works against its velocity into the stop
        return np.asarray((way[:, 3] - answered) * -bond.sign * way[:, 2])

    def _answered(self, time: float, size: float, displacement: float, velocity: float) -> float:
        stop = self._bond.stop
        stop.instance.restore(stop.at_start)
        self._bond.show_stop(displacement, velocity)
        stop.instance.step(time, size)
        return self._bond.force_of_stop()


class InterfaceEnergy:
    """Sums the energy residual of every force-displacement connection of an importer, and of its contacts.

    Attributes
    ----------
    names : tuple of str
        The connections, `component.output -> component.input`; then the contacts with a held force, written alike.
    """

    def __init__(self, importer: Importer, connections: Sequence[ConnectionSpec]) -> None:
        bonds = {f"{bond.name}.applied_force": bond for bond in importer.contacts.ports}
        found: list[tuple[ConnectionSpec, _Connection | _Contact | PlainContact]] = []
        self._plain: list[PlainContact] = []
        self._starting_forces = [
            ForceThatBegins(importer.components, connection)
            for connection in connections
            if ForceThatBegins.is_one(importer.components, connections, connection)
        ]
        variables = {name: c.variables.keys() - c.shapes.keys() for name, c in importer.components.items()}
        for connection in connections:
            displacement = conjugate_displacement(variables[connection.target[0]], connection.target[1])
            bond = bonds.get(".".join(connection.target))
            contact = plain_contact(variables, connections, connection)
            if bond is not None:
                found.append((connection, _Contact(bond)))
            elif contact is not None:
                self._plain.append(PlainContact(importer.components, connection, contact))
                found.append((connection, self._plain[-1]))
            elif displacement is not None:
                found.append((connection, _Connection(importer, connection, displacement)))
        self._held = importer.contacts.held
        self.names = (
            *(connection_name(connection) for connection, _ in found),
            *(bond.name for bond in self._held),
        )
        self._connections = [watched for _, watched in found]
        self._specs = [connection for connection, _ in found]
        if found or self._starting_forces:
            importer.watchers.append(StepWatcher(self._before, self._after, self._patience))

    def begin(self, connections: Sequence[ConnectionSpec]) -> None:
        """Start a run with the gains of `connections`, which are otherwise unchanged."""
        gains = {connection.target: connection.gain for connection in connections}
        for spec, watched in zip(self._specs, self._connections, strict=True):
            watched.begin(gains[spec.target])
        for force in self._starting_forces:
            force.begin()

    def residuals(self) -> NDArray[np.float64]:
        """Residual of each connection so far, J."""
        return np.array([watched.residual for watched in (*self._connections, *self._held)])

    def remarks(self) -> list[str]:
        """Remarks on stops whose forces are plain connections."""
        found = [*(c.remark() for c in self._plain), *(f.remark() for f in self._starting_forces)]
        return [text for text in found if text]

    def free(self) -> None:
        """Free saved states, before the components are freed."""
        for contact in self._plain:
            contact.free()

    def _patience(self) -> float:
        """Return an infinite time where all are contacts that press no stop: then no step needs to be seen."""
        is_idle = all(isinstance(c, _Contact) and not c.follows for c in self._connections)
        return math.inf if is_idle and not self._starting_forces else 0.0

    def _before(self, time: float) -> None:
        for watched in self._connections:
            watched.before(time)

    def _after(self, time: float, end: float) -> None:
        for watched in self._connections:
            watched.after(time, end)
        for force in self._starting_forces:
            force.look()

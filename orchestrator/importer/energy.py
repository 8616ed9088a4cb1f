"""The energy that the exchange itself adds to coupled components, for each force-displacement connection.

A force that is held over a step is not the force that the other side has: over the step it does the work
(mean force applied - mean force connected) * displacement of the receiver too much. The sum is the residual of
that connection, in joule; exact coupling has none.
"""

from __future__ import annotations

from collections.abc import Container, Sequence

import numpy as np
from numpy.typing import NDArray

from vibroimpact.orchestrator.importer.component import description_of
from vibroimpact.orchestrator.importer.events import StepWatcher
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.specification import ComponentSpec, ConnectionSpec
from vibroimpact.orchestrator.importer.wiring import connection_name

#: Inputs that are forces, by the last part of their name, with the displacement that they do work on.
CONJUGATE = {"force": "displacement", "applied_force": "displacement"}


def conjugate_displacement(variables: Container[str], variable: str) -> str | None:
    """Return the displacement on which a force input does work; None when the input is no such force."""
    head, _, last = variable.rpartition(".")
    if last not in CONJUGATE:
        return None
    name = f"{head}.{CONJUGATE[last]}" if head else CONJUGATE[last]
    return name if name in variables else None


def force_connections(
    components: Sequence[ComponentSpec], connections: Sequence[ConnectionSpec]
) -> tuple[str, ...]:
    """Return the names of the connections whose energy residual is summed."""
    variables = {c.name: {v.name for v in description_of(c.fmu).modelVariables} for c in components}
    return tuple(
        connection_name(c) for c in connections if conjugate_displacement(variables[c.target[0]], c.target[1])
    )


class _Connection:
    def __init__(self, importer: Importer, connection: ConnectionSpec, displacement: str) -> None:
        source = importer.components[connection.source[0]]
        target = importer.components[connection.target[0]]
        self._gain = connection.gain
        self._source = source.group("Float64", [connection.source[1]])
        self._applied = target.group("Float64", [connection.target[1]])
        self._displacement = target.group("Float64", [displacement])
        slope = f"{connection.target[1]}_rate"
        self._slope = target.group("Float64", [slope]) if slope in target.variables else None
        self.residual = 0.0

    def begin(self, gain: float) -> None:
        self._gain = gain
        self.residual = 0.0

    def before(self) -> None:
        self._force_start = self._gain * self._source.get()[0]
        self._displacement_start = float(self._displacement.get()[0])

    def after(self, size: float) -> None:
        applied = float(self._applied.get()[0])
        if self._slope is not None:
            applied += 0.5 * size * float(self._slope.get()[0])
        connected = 0.5 * (self._force_start + self._gain * float(self._source.get()[0]))
        moved = float(self._displacement.get()[0]) - self._displacement_start
        self.residual += (applied - connected) * moved


class InterfaceEnergy:
    """Sums the energy residual of every force-displacement connection of an importer.

    Attributes
    ----------
    names : tuple of str
        The connections, `component.output -> component.input`.
    """

    def __init__(self, importer: Importer, connections: Sequence[ConnectionSpec]) -> None:
        found = []
        for connection in connections:
            target = importer.components[connection.target[0]]
            displacement = conjugate_displacement(target.variables, connection.target[1])
            if displacement is not None:
                found.append((connection, _Connection(importer, connection, displacement)))
        self.names = tuple(connection_name(connection) for connection, _ in found)
        self._connections = [watched for _, watched in found]
        self._specs = [connection for connection, _ in found]
        if found:
            importer.watchers.append(StepWatcher(self._before, self._after))

    def begin(self, connections: Sequence[ConnectionSpec]) -> None:
        """Start a run; the gains are those of `connections`, which are the same ones otherwise."""
        gains = {connection.target: connection.gain for connection in connections}
        for spec, watched in zip(self._specs, self._connections, strict=True):
            watched.begin(gains[spec.target])

    def residuals(self) -> NDArray[np.float64]:
        """Residual of each connection so far, J."""
        return np.array([watched.residual for watched in self._connections])

    def _before(self, time: float) -> None:
        for watched in self._connections:
            watched.before()

    def _after(self, time: float, end: float) -> None:
        for watched in self._connections:
            watched.after(end - time)

"""The variables through which components move each other, and the contact points that a step must show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.importer.component import Component
from vibroimpact.orchestrator.importer.feedthrough import connection_name
from vibroimpact.orchestrator.importer.parts import Parts
from vibroimpact.orchestrator.importer.specification import (
    BodyPoint,
    ConnectionSpec,
    PairSpec,
    StopContactSpec,
)

#: Component, variable, and its name in messages.
Variable = tuple[Component, str, str]
#: First letters of the variables of a contact port, whose body locates its contacts.
PORT = "contact["


def _refuse_grids(components: Mapping[str, Component]) -> None:
    for name, component in components.items():
        if component.capabilities.grid:
            raise ComponentError(
                f'{name}: expected communication steps of any size with macro_step = "auto", got an FMU with '
                f"{component.capabilities.grid}. Give the macro step as a number.",
                instance=name,
            )


def needs_coupling_steps(
    parts: Parts, contacts: Sequence[StopContactSpec], pairs: Sequence[PairSpec]
) -> bool:
    """Does a run need communication steps beyond those of events, samples and contact ports?

    ComponentError: a component's steps have one size, or end on a grid of its own.
    """
    _refuse_grids(parts.named)
    return bool(coupling_sources(parts, contacts) or points_of(parts.named, contacts, pairs))


def coupling_sources(parts: Parts, contacts: Sequence[StopContactSpec]) -> list[Variable]:
    """Return the sources of connections, each named by its connection; without those of contacts."""
    of_contacts = {connection.target for contact in contacts for connection in contact.connections}
    return [
        (transfer.source, connection.source[1], connection_name(connection))
        for transfer in (*parts.transfers, *parts.tuning.transfers)
        for connection in transfer.connections
        if connection.target not in of_contacts and is_coupling(connection)
    ]


def points_of(
    components: Mapping[str, Component], contacts: Sequence[StopContactSpec], pairs: Sequence[PairSpec]
) -> list[Variable]:
    """Return the motions of the contact points of bodies of other tools."""
    points = [point for pair in pairs for point in (pair.lower, pair.upper) if isinstance(point, BodyPoint)]
    motions = [
        *((contact.body, name) for contact in contacts for name in (contact.displacement, contact.velocity)),
        *((point.component, name) for point in points for name in (point.displacement, point.velocity)),
    ]
    return [(components[owner], name, f"{owner}.{name}") for owner, name in motions]


def halved(parts: Parts, sources: Sequence[Variable]) -> list[Variable]:
    """Return the variables that a step and its halves compare: sources, and named states of coupled components.

    A held force changes a velocity by more than a displacement: outputs that are displacements alone hide the error.
    """
    moved = {transfer.target.name for transfer in parts.transfers} | {c.name for c, _, _ in sources}
    states = [state for c in parts.components if c.name in moved for state in _named_states(c)]
    return [variable for variable in (*sources, *states) if variable[0].has_states]


def _named_states(component: Component) -> list[Variable]:
    """Return the continuous states that the description names, by the derivatives that it declares."""
    found = [v.derivative.name for v in component.variables.values() if v.derivative is not None]
    return [(component, name, f"{component.name}.{name}") for name in found if name in component.variables]


def is_coupling(connection: ConnectionSpec) -> bool:
    """Is this connection none of a contact port?"""
    return not (connection.source[1].startswith(PORT) or connection.target[1].startswith(PORT))

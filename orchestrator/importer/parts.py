"""The parts of an importer: components, and what connects, watches and steps them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from vibroimpact.orchestrator.fmi.instance import Wrapper
from vibroimpact.orchestrator.fmi.log import LogTail
from vibroimpact.orchestrator.importer.component import Component
from vibroimpact.orchestrator.importer.contacts import ContactBonds
from vibroimpact.orchestrator.importer.feedthrough import order_of
from vibroimpact.orchestrator.importer.loops.solver import LoopSolver
from vibroimpact.orchestrator.importer.order import stepping_order
from vibroimpact.orchestrator.importer.revision import Watch, watch_of
from vibroimpact.orchestrator.importer.specification import (
    ComponentSpec,
    ConnectionSpec,
    EventSpec,
    PairSpec,
    StopContactSpec,
)
from vibroimpact.orchestrator.importer.ticks import Ticks
from vibroimpact.orchestrator.importer.tuning import Tuning, is_tunable
from vibroimpact.orchestrator.importer.wiring import Transfer, transfers_of


@dataclass(frozen=True, slots=True)
class Parts:
    """The parts of an importer."""

    named: dict[str, Component]
    """The components by name, in the order of event reports."""
    components: Sequence[Component]
    """The components, in the order in which they are stepped."""
    transfers: Sequence[Transfer]
    loops: LoopSolver
    watches: Sequence[Watch]
    contacts: ContactBonds
    tuning: Tuning
    ticks: Ticks


def parts_of(
    specs: Sequence[ComponentSpec],
    connections: Sequence[ConnectionSpec],
    events: Sequence[EventSpec],
    contacts: Sequence[StopContactSpec],
    pairs: Sequence[PairSpec],
    contact_steps: float,
    log: Callable[[str], LogTail] | None,
    wrap: Callable[[str], Wrapper] | None,
) -> Parts:
    """Return the parts for the arguments of an `Importer`; components are instantiated."""
    watched = {event.component for event in events}
    named = {
        spec.name: Component(
            spec,
            log=log(spec.name) if log else None,
            wrap=wrap(spec.name) if wrap else None,
            events=spec.name not in watched,
        )
        for spec in specs
    }
    watches = [watch for event in events if (watch := watch_of(named[event.component], event))]
    connections = [*connections, *(c for contact in contacts for c in contact.connections)]
    tuned = [c for c in connections if is_tunable(c, named)]
    connections = [c for c in connections if c not in tuned]
    transfers = transfers_of(order_of(connections, named), named)
    parts = Parts(
        named=named,
        components=stepping_order(named, connections),
        transfers=transfers,
        watches=watches,
        tuning=Tuning(named, tuned, transfers),
        loops=LoopSolver(connections, named, transfers),
        ticks=Ticks(named.values()),
        contacts=ContactBonds(named, transfers, connections, contacts, pairs, contact_steps),
    )
    fed = [*(c.target for c in connections), *((c.body, c.force) for c in contacts if c.force)]
    for name, component in named.items():
        component.watch_inputs(variable for owner, variable in fed if owner == name)
    return parts

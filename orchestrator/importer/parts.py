"""The parts of an importer: components, and what connects, watches and steps them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.fmi.instance import Wrapper
from vibroimpact.orchestrator.fmi.log import LogTail
from vibroimpact.orchestrator.importer.component import Component
from vibroimpact.orchestrator.importer.contacts import ContactBonds
from vibroimpact.orchestrator.importer.feedthrough import order_of
from vibroimpact.orchestrator.importer.loops.solver import LoopSolver
from vibroimpact.orchestrator.importer.order import stepping_order
from vibroimpact.orchestrator.importer.own_grid import Divisions, OwnGrids, cut_components
from vibroimpact.orchestrator.importer.revision import Watch, watch_of
from vibroimpact.orchestrator.importer.specification import (
    ComponentSpec,
    ConnectionSpec,
    EventSpec,
    PairSpec,
    StopContactSpec,
)
from vibroimpact.orchestrator.importer.ticks import Ticks, joins_clocks
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
    grids: OwnGrids


def parts_of(
    specs: Sequence[ComponentSpec],
    connections: Sequence[ConnectionSpec],
    events: Sequence[EventSpec],
    contacts: Sequence[StopContactSpec],
    pairs: Sequence[PairSpec],
    divisions: Divisions,
    contact_steps: float,
    log: Callable[[str], LogTail] | None,
    wrap: Callable[[str], Wrapper] | None,
) -> Parts:
    """Return the parts for the arguments of an `Importer`; components are instantiated."""
    watched = {event.component for event in events}
    named: dict[str, Component] = {}

    def made(spec: ComponentSpec, *, events: bool) -> Component:
        tail, wrapper = log(spec.name) if log else None, wrap(spec.name) if wrap else None
        return Component(spec, log=tail, wrap=wrapper, events=events)

    try:
        for spec in specs:
            named[spec.name] = made(spec, events=spec.name not in watched)
        for cut in cut_components(named.values(), divisions, has_events=bool(events or contacts or pairs)):
            if cut.event_mode:  # its events lie inside its own steps
                cut.free()
                named[cut.name] = made(cut.spec, events=False)
            named[cut.name].keep_own_grid()
    except ComponentError:
        for component in named.values():
            component.free()
        raise
    watches = [watch for event in events if (watch := watch_of(named[event.component], event))]
    connections = [*connections, *(c for contact in contacts for c in contact.connections)]
    clocks = [c for c in connections if joins_clocks(c, named)]
    tuned = [c for c in connections if is_tunable(c, named)]
    connections = [c for c in connections if c not in tuned and c not in clocks]
    transfers = transfers_of(order_of(connections, named), named)
    parts = Parts(
        named=named,
        components=stepping_order(named, connections),
        transfers=transfers,
        watches=watches,
        tuning=Tuning(named, tuned, transfers),
        loops=LoopSolver(connections, named, transfers),
        grids=OwnGrids(named.values()),
        ticks=Ticks(named.values(), clocks),
        contacts=ContactBonds(named, transfers, connections, contacts, pairs, contact_steps),
    )
    fed = [*(c.target for c in connections), *((c.body, c.force) for c in contacts if c.force)]
    for name, component in named.items():
        component.watch_inputs(variable for owner, variable in fed if owner == name)
    return parts

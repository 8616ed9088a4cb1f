"""The order in which components are stepped."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from vibroimpact.orchestrator.importer.component import Component
from vibroimpact.orchestrator.importer.specification import ConnectionSpec


def stepping_order(
    components: Mapping[str, Component], connections: Sequence[ConnectionSpec]
) -> list[Component]:
    """Components with event mode first, then others with states, those without states last.

    Among equals a component comes after those whose outputs its own outputs depend on directly.
    """

    def rank(component: Component) -> int:
        if not component.has_states:
            return 2
        return 0 if component.event_mode else 1

    after: dict[str, set[str]] = {name: set() for name in components}
    for connection in connections:
        (source, _), (name, variable) = connection.source, connection.target
        if any(variable in inputs for inputs in components[name].depends.values()):
            after[name].add(source)
    waiting = sorted(components.values(), key=rank)
    order: list[Component] = []
    while waiting:
        equals = {c.name for c in waiting if rank(c) == rank(waiting[0])}
        ready = (c for c in waiting if c.name in equals and not (after[c.name] - {c.name}) & equals)
        chosen = next(ready, waiting[0])  # in a circle the order of declaration decides
        waiting.remove(chosen)
        order.append(chosen)
    return order

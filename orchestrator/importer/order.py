"""The order in which components are stepped."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from vibroimpact.orchestrator.importer.component import Component
from vibroimpact.orchestrator.importer.specification import ConnectionSpec
from vibroimpact.orchestrator.importer.wiring import Transfer, drawn_inputs


def stepping_order(
    components: Mapping[str, Component], connections: Sequence[ConnectionSpec]
) -> list[Component]:
    """Return the components in order: those with event mode first, then others with states, those without states last.

    Among those without states a component with event mode comes first: the others follow to its events.

    Among components with states, one that gives an input its slope comes last, such as a Replay. Value and slope
    belong to the start of a step.

    Among equals a component comes after the components whose outputs its own outputs depend on directly. In a circle
    only connected outputs count: unconnected outputs may be late.
    """

    drawing = _drawing(connections)

    def rank(component: Component) -> int:
        if not component.has_states:
            return 3 if component.event_mode else 4
        return 0 if component.event_mode else 2 if component.name in drawing else 1

    after = _feeding(components, connections, connected=False)
    after_connected = _feeding(components, connections, connected=True)
    waiting = sorted(components.values(), key=rank)
    order: list[Component] = []
    while waiting:
        equals = {c.name for c in waiting if rank(c) == rank(waiting[0])}
        ready = (
            c
            for feeding in (after, after_connected)
            for c in waiting
            if c.name in equals and not (feeding[c.name] - {c.name}) & equals
        )
        chosen = next(ready, waiting[0])  # in a circle of connected outputs the order of declaration decides
        waiting.remove(chosen)
        order.append(chosen)
    return order


def fresh_inputs(
    order: Sequence[Component],
    incoming: Mapping[str, Sequence[Transfer]],
    stops: Collection[Component] = (),
    *,
    jacobi: bool,
) -> dict[str, list[Transfer]]:
    """Return the transfers from components stepped earlier, made just before each component's own step.

    With exchange "jacobi" only two kinds of component need them: the stops of contact ports, and formulas. Neither has
    event mode. All outputs of a formula depend on inputs directly, by its description, which names no state.
    """
    place = {c.name: i for i, c in enumerate(order)}

    def fresh(component: Component) -> list[Transfer]:
        earlier = [t for t in incoming[component.name] if place[t.source.name] < place[component.name]]
        answers = not component.event_mode and (component in stops or _is_formula(component))
        return earlier if not jacobi or answers else []

    return {c.name: fresh(c) for c in order if c.name in incoming}


def _is_formula(component: Component) -> bool:
    depends = component.depends.values()
    has_derivatives = any(v.derivative is not None for v in component.variables.values())
    return bool(depends) and all(depends) and not has_derivatives


def _drawing(connections: Sequence[ConnectionSpec]) -> set[str]:
    """Return the components that give another component an input and its slope."""
    pairs: dict[tuple[str, str], list[ConnectionSpec]] = {}
    for connection in connections:
        pairs.setdefault((connection.source[0], connection.target[0]), []).append(connection)
    return {source for (source, _), joined in pairs.items() if drawn_inputs(joined)}


def _feeding(
    components: Mapping[str, Component], connections: Sequence[ConnectionSpec], *, connected: bool
) -> dict[str, set[str]]:
    """Return the components that feed an output (or a connected output) of each component directly."""
    used = {connection.source for connection in connections}
    feeding: dict[str, set[str]] = {name: set() for name in components}
    for connection in connections:
        (source, _), (name, variable) = connection.source, connection.target
        outputs = components[name].depends.items()
        if any(variable in inputs for output, inputs in outputs if not connected or (name, output) in used):
            feeding[name].add(source)
    return feeding

"""The graph of direct feedthrough: which connection depends on which, their order, and the algebraic loops."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from graphlib import TopologicalSorter
from typing import Any

from vibroimpact.orchestrator.importer.component import Component
from vibroimpact.orchestrator.importer.described import description_of
from vibroimpact.orchestrator.importer.specification import ConnectionSpec

Connections = Sequence[ConnectionSpec]
_Needed = Callable[[str, str], Iterable[str]]
Graph = dict[int, set[int]]
"""The connections, by number, that the output of each connection depends on directly."""


def connection_name(connection: ConnectionSpec) -> str:
    """Return `component.output -> component.input`."""
    return f"{'.'.join(connection.source)} -> {'.'.join(connection.target)}"


def unlisted_dependence(output: ConnectionSpec, source: ConnectionSpec) -> str:
    """Return the remark that the output of a connection depends on the input of another, against its description."""
    return (
        f"{'.'.join(output.source)} depends on {'.'.join(source.target)}, "
        "which its list of dependencies leaves out"
    )


@dataclass(frozen=True, slots=True)
class TransferOrder:
    """Connections in the order in which they are moved, and the algebraic loops among them.

    The outputs of `unlisted` have no list of dependencies, and are in no circle: they may depend on all inputs.
    """

    connections: tuple[ConnectionSpec, ...]
    loops: tuple[tuple[ConnectionSpec, ...], ...]
    unlisted: tuple[ConnectionSpec, ...] = ()

    def loops_back(self, connection: ConnectionSpec) -> bool:
        """Is the connection part of an algebraic loop?"""
        return any(connection in loop for loop in self.loops)


def order_of(connections: Connections, components: Mapping[str, Component]) -> TransferOrder:
    """Order connections so that each is moved after those that its output depends on directly.

    Connections that depend on each other in a circle are an algebraic loop: a strong component of the graph. They have
    no order among themselves. An output without a list comes after all inputs of its component, except in a circle.
    """
    graph, undeclared = declared_graph(connections, components), undeclared_graph(connections, components)
    loops = loops_of(graph)
    ranked = list(TopologicalSorter(_without_loops(graph, loops)).static_order())
    unlisted = {i for i in graph if undeclared[i] != graph[i]}
    if unlisted:
        place = {i: rank for rank, i in enumerate(ranked)}
        ranked = [i for part in strong_components(undeclared) for i in sorted(part, key=place.__getitem__)]
        unlisted -= {i for loop in loops_of(undeclared) for i in loop}
    return TransferOrder(
        tuple(connections[i] for i in ranked),
        tuple(tuple(connections[i] for i in loop) for loop in loops),
        tuple(connections[i] for i in ranked if i in unlisted),
    )


def _without_loops(graph: Graph, loops: Sequence[tuple[int, ...]]) -> Graph:
    """Return the graph without the edges inside loops."""
    number = {i: k for k, loop in enumerate(loops) for i in loop}
    return {
        i: {j for j in before if i not in number or number.get(j) != number[i]} for i, before in graph.items()
    }


# ---- graphs ----


def declared_graph(connections: Connections, components: Mapping[str, Component]) -> Graph:
    """Return the graph that the descriptions declare for steps; an output without a list depends on no input."""
    return _graph(connections, lambda name, output: components[name].depends.get(output, frozenset()))


def starting_graph(connections: Connections, components: Mapping[str, Component]) -> Graph:
    """Return the graph that the descriptions declare for initialization (InitialUnknowns), joined to that for steps."""
    lists = {
        name: {u.variable.name: u.dependencies for u in _start_of(component) if u.variable is not None}
        for name, component in components.items()
    }
    graph = _graph(
        connections,
        lambda name, output: [v.name for v in lists[name].get(output) or () if v.causality == "input"],
    )
    return {i: before | graph[i] for i, before in declared_graph(connections, components).items()}


def _start_of(component: Component) -> list[Any]:
    """Return the unknowns of a component's initialization, with the variables that they depend on."""
    unknowns: list[Any] = description_of(component.spec.fmu).initialUnknowns
    return unknowns


def undeclared_graph(connections: Connections, components: Mapping[str, Component]) -> Graph:
    """Return the declared graph, where each output without a list depends on all inputs of its component."""
    without = {
        name: {
            unknown.variable.name
            for unknown in description_of(component.spec.fmu).outputs
            if unknown.variable is not None and unknown.dependencies is None
        }
        for name, component in components.items()
    }
    full = full_graph(connections)
    graph = declared_graph(connections, components)
    return {
        i: full[i] if c.source[1] in without[c.source[0]] else graph[i] for i, c in enumerate(connections)
    }


def full_graph(connections: Connections) -> Graph:
    """Return the graph in which each output depends on all inputs of its component, whatever is declared."""
    return {
        i: {j for j, other in enumerate(connections) if other.target[0] == c.source[0]}
        for i, c in enumerate(connections)
    }


def _graph(connections: Connections, needed: _Needed) -> Graph:
    into: dict[tuple[str, str], list[int]] = {}
    for j, connection in enumerate(connections):
        into.setdefault(connection.target, []).append(j)
    return {
        i: {j for name in needed(*c.source) for j in into.get((c.source[0], name), ())}
        for i, c in enumerate(connections)
    }


# ---- loops ----


def loops_of(graph: Mapping[int, Collection[int]]) -> list[tuple[int, ...]]:
    """Return the algebraic loops of a graph, each after the loops that it depends on, with their members sorted."""
    return [
        tuple(sorted(members))
        for members in strong_components(graph)
        if len(members) > 1 or members[0] in graph[members[0]]
    ]


def strong_components(graph: Mapping[int, Collection[int]]) -> list[list[int]]:
    """Return the strong components of a graph, each after those that its nodes lead to (Tarjan, SIAM J. Comput. 1972).

    The recursion is a list of open nodes: a chain of thousands of connections overflows no stack.

    Examples
    --------
    >>> strong_components({0: [1], 1: [0], 2: [1]})
    [[1, 0], [2]]
    """
    number: dict[int, int] = {}
    lowest: dict[int, int] = {}
    waiting: list[int] = []
    is_waiting: set[int] = set()
    found: list[list[int]] = []
    for root in graph:
        if root in number:
            continue
        open_nodes = [(root, iter(sorted(graph[root])))]
        number[root] = lowest[root] = len(number)
        waiting.append(root)
        is_waiting.add(root)
        while open_nodes:
            node, following = open_nodes[-1]
            for other in following:
                if other not in number:
                    number[other] = lowest[other] = len(number)
                    waiting.append(other)
                    is_waiting.add(other)
                    open_nodes.append((other, iter(sorted(graph[other]))))
                    break
                if other in is_waiting:
                    lowest[node] = min(lowest[node], number[other])
            else:
                open_nodes.pop()
                if open_nodes:
                    parent = open_nodes[-1][0]
                    lowest[parent] = min(lowest[parent], lowest[node])
                if lowest[node] == number[node]:
                    place = waiting.index(node)
                    found.append([*waiting[:place:-1], node])
                    is_waiting.difference_update(waiting[place:])
                    del waiting[place:]
    return found


def between(graph: Graph, loops: Sequence[tuple[int, ...]]) -> list[tuple[int, ...]]:
    """Return, for each loop, the connections outside loops that carry solutions of earlier loops to it, in order."""
    if len(loops) < 2:
        return [() for _ in loops]
    ranked = list(TopologicalSorter(_without_loops(graph, loops)).static_order())
    behind = behind_loops(graph, loops)
    carried: list[tuple[int, ...]] = []
    moved: set[int] = set()
    for loop in loops:
        ahead = _ahead(graph, loop)
        carried.append(tuple(i for i in ranked if i in (ahead & behind) - moved))
        moved |= set(carried[-1])
    return carried


def behind_loops(graph: Graph, loops: Sequence[tuple[int, ...]]) -> set[int]:
    """Return the connections outside loops that carry solutions of loops, directly or through others."""
    inside = {i for loop in loops for i in loop}
    return {i for i in graph if inside and i not in inside and _ahead(graph, (i,)) & inside}


def _ahead(graph: Graph, loop: Sequence[int]) -> set[int]:
    """Return all connections that a loop depends on."""
    found, waiting = set(loop), list(loop)
    while waiting:
        fresh = graph[waiting.pop()] - found
        found |= fresh
        waiting += fresh
    return found

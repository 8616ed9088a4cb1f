"""The algebraic loops of an importer: found from the descriptions and at initialization, solved one after the other."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.fmi.capabilities import SET_ONCE
from vibroimpact.orchestrator.importer.component import Component
from vibroimpact.orchestrator.importer.feedthrough import (
    Graph,
    behind_loops,
    between,
    declared_graph,
    full_graph,
    loops_of,
    starting_graph,
    undeclared_graph,
    unlisted_dependence,
)
from vibroimpact.orchestrator.importer.loops.link import Link
from vibroimpact.orchestrator.importer.loops.newton import Loop
from vibroimpact.orchestrator.importer.loops.slopes import Slopes
from vibroimpact.orchestrator.importer.specification import ConnectionSpec
from vibroimpact.orchestrator.importer.wiring import Transfer


class LoopSolver:
    """Solves the algebraic loops of an exchange, each after the loops that it depends on.

    Parameters
    ----------
    connections : sequence of ConnectionSpec
        All connections to inputs.
    components : mapping of str to Component
        The components by name.
    transfers : sequence of Transfer
        The transfers of these connections: they have the present gains.

    Attributes
    ----------
    names : tuple of str
        The loops of a step, each by its connections.
    arrangement : int
        A number that changes with the loops.
    residual : float
        Largest relative change that a solution of the run has left in a loop's inputs.
    """

    def __init__(
        self,
        connections: Sequence[ConnectionSpec],
        components: Mapping[str, Component],
        transfers: Sequence[Transfer],
    ) -> None:
        self._connections, self._components = list(connections), components
        self._main = transfers
        self._links: dict[int, tuple[Link, ...]] = {}
        self._slopes = Slopes()
        self._made: dict[tuple[tuple[int, ...], tuple[frozenset[int], ...]], Loop] = {}
        self._declared = declared_graph(self._connections, components)
        self._starting = starting_graph(self._connections, components)
        self._undeclared = undeclared_graph(self._connections, components)
        self._measured: Graph = {}
        self.arrangement = 0
        self._arrange()

    @property
    def transfers(self) -> list[Transfer]:
        """The transfers that loops use, one for each connection."""
        return [links[0].transfer for links in self._links.values()]

    @property
    def residual(self) -> float:
        """Largest relative residual of the run."""
        return max((loop.worst for loop in self._active), default=0.0)

    @property
    def _active(self) -> list[Loop]:
        """The loops of initialization and of steps."""
        return list(dict.fromkeys(loop for loop, _ in (*self._first, *self._steps)))

    def remarks(self) -> list[str]:
        """Return the false declarations of FMUs, and the loops with more than one solution nearby."""
        open_loops = [
            f"algebraic loop {loop.name} is singular: other values nearby solve it as well "
            f"(relative residual {loop.worst:.3g})"
            for loop in self._active
            if loop.is_singular
        ]
        return [*self._slopes.remarks, *open_loops]

    def solves_first(self, transfer: Transfer) -> bool:
        """Are all connections of a transfer in loops of initialization?"""
        return all(c.target in self._first_targets for c in transfer.connections)

    def leads(self, transfer: Transfer) -> bool:
        """Does a transfer carry solutions of loops of initialization on to other components?"""
        return any(c.target in self._behind_first for c in transfer.connections)

    def solves(self, transfer: Transfer) -> bool:
        """Are all connections of a transfer in loops of a step?"""
        return all(c.target in self._step_targets for c in transfer.connections)

    # ---- initialization ----

    def begin(self) -> None:
        """Begin a run, in initialization mode: measure what no list declares, and start at the inputs' start values."""
        if self._measured:
            self._measured = {}
            self._arrange()
        self._is_searched = False
        if self._undeclared != self._declared:
            self._measure(self._undeclared)
        for loop in self._active:
            loop.begin()
            loop.take_start()

    def search(self) -> None:
        """Find loops that descriptions hide, once in a run: values change more often than their lists allow."""
        if not self._is_searched:
            self._is_searched = True
            before = self._active
            self._measure(full_graph(self._connections))
            for loop in self._active:
                if loop not in before:
                    loop.begin()
                    loop.take_start()

    def solve_first(self, time: float) -> None:
        """Solve the loops of initialization at `time`, s; ComponentError with the loop that has no solution."""
        _solve(self._first, time)

    def end_beginning(self) -> None:
        """Look whether the solutions are the only ones, and start the loops of steps at the present inputs."""
        for loop, _ in self._first:
            loop.check_solution()
        first = [loop for loop, _ in self._first]
        for loop, _ in self._steps:
            if loop not in first:
                loop.take_start()

    def solve(self, time: float) -> None:
        """Make the loops of a step consistent; ComponentError with the loop that has no solution."""
        _solve(self._steps, time)

    def hold(self) -> None:
        """Write solutions again that were moved together with connections outside loops."""
        for loop in self._mixed:
            loop.write()

    # ---- the loops ----

    def _arrange(self) -> None:
        """Make the loops of initialization and of steps."""
        self._steps = self._loops(self._joined(self._declared), self._undeclared)
        either = {i: before | self._undeclared[i] for i, before in self._starting.items()}
        self._first = self._loops(self._joined(self._starting), either)
        self.arrangement += 1
        starting = self._joined(self._starting)
        behind = behind_loops(starting, loops_of(starting))
        self._behind_first = {self._connections[i].target for i in behind}
        self._first_targets, self._step_targets = _targets(self._first), _targets(self._steps)
        partly = {c.target for t in self._main if not self.solves(t) for c in t.connections}
        self._mixed = [
            loop for loop, _ in self._steps if any(link.connection.target in partly for link in loop.links)
        ]
        self.names = tuple(loop.name for loop, _ in self._steps)
        self._refuse_inputs_set_once()

    def _refuse_inputs_set_once(self) -> None:
        """Raise ComponentError if an input in a loop of steps takes one value at an instant."""
        for name, variable in self._step_targets:
            component = self._components[name]
            if component.variables[variable].valueReference in component.capabilities.set_once:
                raise ComponentError(
                    f"{name}.{variable}: expected an input that may be set more than once at an instant, as it is in "
                    f"an algebraic loop, got one with {SET_ONCE} = false.",
                    instance=name,
                )

    def _joined(self, graph: Graph) -> Graph:
        return {i: before | self._measured.get(i, set()) for i, before in graph.items()}

    def _loops(self, graph: Graph, allowed: Graph) -> list[tuple[Loop, list[Transfer]]]:
        """Return the loops of a graph, each with the transfers that carry solutions of earlier loops to it.

        Directional derivatives are asked for between the pairs of another graph alone.
        """
        members = loops_of(graph)
        carried = between(graph, members)
        return [
            (self._loop(loop, allowed), [self._elements(i)[0].transfer for i in more])
            for loop, more in zip(members, carried, strict=True)
        ]

    def _loop(self, members: tuple[int, ...], allowed: Graph) -> Loop:
        elements = [(i, link) for i in members for link in self._elements(i)]
        depends = tuple(
            frozenset(k for k, (j, _) in enumerate(elements) if j in allowed[i]) for i, _ in elements
        )
        key = (members, depends)
        if key not in self._made:
            self._made[key] = Loop([link for _, link in elements], depends, self._slopes)
        return self._made[key]

    def _elements(self, i: int) -> tuple[Link, ...]:
        """Return the links of a connection, with its present gain: one for each element of an array."""
        if i not in self._links:
            connection = self._connections[i]
            source, target = (self._components[end[0]] for end in (connection.source, connection.target))
            transfer = Transfer(source, target, [connection])
            for main in self._main:
                if main.carries(connection) and main.gain_of(connection) != connection.gain:
                    transfer.set_gain(connection, main.gain_of(connection))
            written = transfer.write.values.copy()
            self._links[i] = tuple(Link(transfer, k, written) for k in range(written.size))
        return self._links[i]

    # ---- dependences that no list declares ----

    def _measure(self, graph: Graph) -> None:
        """Measure the dependences in circles that a graph has beyond the known ones; keep those that close circles."""
        known = self._joined(self._declared)
        found: Graph = {}
        for members in loops_of(graph):
            for j in members:
                rows = [i for i in members if j in graph[i] - known[i]]
                for i in self._responding(j, rows):
                    found.setdefault(i, set()).add(j)
        joined = {i: before | found.get(i, set()) for i, before in known.items()}
        in_loop = {i: loop for loop in loops_of(joined) for i in loop}
        kept = {i: {j for j in js if j in in_loop.get(i, ())} for i, js in found.items()}
        for i, js in kept.items():
            self._measured.setdefault(i, set()).update(js)
            self._note_list(i, js)
        if any(kept.values()):
            self._arrange()

    def _note_list(self, i: int, inputs: set[int]) -> None:
        """Say that an output's list of dependencies leaves inputs out."""
        for j in sorted(inputs - self._undeclared[i]):
            self._slopes.remarks[unlisted_dependence(self._connections[i], self._connections[j])] = None

    def _responding(self, j: int, rows: Sequence[int]) -> list[int]:
        """Return the connections, among those given, whose output changes with the input of connection `j`."""
        links = [(i, link) for i in rows for link in self._elements(i)]
        responding: dict[int, None] = {}
        for link in self._elements(j) if links else ():
            x = link.start()
            before = [other.read() for _, other in links]
            if not (link.is_real and math.isfinite(x) and link.write(link.near(x, 0.0, 1.0))):
                continue
            after = [other.read() for _, other in links]
            link.write(x)
            again = [other.read() for _, other in links]
            responding |= {
                i: None
                for (i, _), a, b, c in zip(links, before, after, again, strict=True)
                if a == c and math.isfinite(b) and b != a
            }
        return list(responding)


def _targets(loops: Sequence[tuple[Loop, Sequence[Transfer]]]) -> set[tuple[str, str]]:
    """Return the inputs of loops."""
    return {link.connection.target for loop, _ in loops for link in loop.links}


def _solve(loops: Sequence[tuple[Loop, Sequence[Transfer]]], time: float) -> None:
    for loop, carried in loops:
        for transfer in carried:
            transfer.move()
        loop.solve(time)

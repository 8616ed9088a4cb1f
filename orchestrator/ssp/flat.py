"""A nested system as components side by side: their connections with gains, and their start values."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from vibroimpact.fmus.units import Unit, agree, conversion, converts, gain_unit_between
from vibroimpact.orchestrator.scene.component_facts import ComponentFacts, StartValue
from vibroimpact.orchestrator.scene.problems import quoted
from vibroimpact.orchestrator.ssp.names import GIVING, TAKING
from vibroimpact.orchestrator.ssp.refusal import RefusalError
from vibroimpact.orchestrator.ssp.structure import Component, Connection, DictionaryReference, System
from vibroimpact.orchestrator.ssp.values import (
    Parameter,
    Table,
    Transformation,
    converted,
    start_value,
)

_DOT = re.compile(r"\.")
Path = tuple[str, ...]
"""Names of systems, from the outermost, and of the element; empty for the outermost system."""


class Node(NamedTuple):
    """A connector of an element."""

    element: Path
    name: str


@dataclass(frozen=True, slots=True)
class Link:
    """A component's input: gain times another component's output plus offset, through components that are gains.

    With a `table` the input has the value that the table gives for the output.
    """

    source: Node
    target: Node
    gain: float = 1.0
    gain_unit: str | None = None
    through: tuple[Path, ...] = ()
    offset: float = 0.0
    table: Table | None = None


@dataclass(frozen=True, slots=True)
class _Edge:
    source: Node
    target: Node
    connection: Connection


class FlatSystem:
    """A system without nested systems, and without the components that are gains of connections.

    RefusalError: a connection has no element at an end, or cannot be a gain.
    """

    def __init__(
        self, system: System, facts: Mapping[Path, ComponentFacts], gains: Collection[Path] = ()
    ) -> None:
        self._all = dict(components_of(system))
        self.components = {path: one for path, one in self._all.items() if path not in gains}
        """The components, in the order of the file."""
        self.ignored: list[str] = []
        """Parameters without a variable, and mapping entries without a parameter: SSP wants both ignored."""
        self.overruled: list[str] = []
        """Parameters with one value from a connection and another from a set: the connection's is taken."""
        self._facts = facts
        self._systems = dict(_systems(system, ()))
        self._references = dict(_references(self._systems))
        self._edges: dict[Node, _Edge] = {}
        self._leaving: dict[Node, list[_Edge]] = {}
        for path, inner in self._systems.items():
            for connection in inner.connections:
                self._add(self._directed(path, connection))
        self._connected: dict[Node, StartValue] = {}
        self._values = self._start_values()

    def links(self, gains: Mapping[Path, float] | None = None) -> list[Link]:
        """Return the links into the components' inputs, in the order of the file; `gains` overrides gain values."""
        ends = (target for target in self._edges if target.element in self.components)
        return [link for link in (self._link(end, gains or {}) for end in ends) if link is not None]

    def start_values(self) -> dict[Path, dict[str, StartValue]]:
        """Return the start values of each component: an outer system's override an inner system's."""
        return {path: dict(self._values[path]) for path in self.components}

    def _start_values(self) -> dict[Path, dict[str, StartValue]]:
        values: dict[Path, dict[str, StartValue]] = {path: {} for path in self._all}
        elements: list[tuple[Path, Component | System]] = [*self._all.items(), *self._inner_first()]
        for path, element in elements:
            for binding in element.bindings:
                self.ignored += [".".join((*path, name)) for name in binding.unmatched]
                for parameter in binding.parameters:
                    self.apply(parameter, path, values, self._connected)
        return values

    def connected(self) -> dict[Node, StartValue]:
        """Return the start values that connections carry from a system's parameter to a component's."""
        return dict(self._connected)

    def named(self, parameter: Parameter) -> tuple[Parameter, ...]:
        """Return an outside set's parameter by the names of the system, after the system's own mappings."""
        mapped = [one for binding in self._systems[()].bindings for one in binding.renamed(parameter)]
        return tuple(mapped) or (parameter,)

    def apply(
        self,
        parameter: Parameter,
        path: Path,
        values: dict[Path, dict[str, StartValue]],
        connected: dict[Node, StartValue],
    ) -> list[Node]:
        """Give a parameter of an element to the variables that it names; returns these variables.

        A connected variable takes the value of its connection, even if a set gives it another. `connected` has the
        values of connections, and grows.
        """
        taken = []
        for node, value, through in self._meant(path, parameter.name, parameter):
            given = self._given(node, value)
            if given is None:
                continue
            taken.append(node)
            other = connected.get(node) if not through else values[node.element].get(node.name)
            if other is not None and other != given and not (through and node in connected):
                self._overrule(node, *((given, other) if through else (other, given)))
            if through:
                connected[node] = given
            values[node.element][node.name] = connected.get(node, given)
        if not taken:
            self.ignored.append(".".join((*path, parameter.name)))
        return taken

    def _overrule(self, node: Node, taken: StartValue, other: StartValue) -> None:
        where = ".".join((*node.element, node.name))[:100]
        self.overruled.append(
            f"{where}: {quoted(taken)} of its connection was taken, not {quoted(other)} of a parameter set"
        )

    def _given(self, node: Node, parameter: Parameter) -> StartValue | None:
        """Return the start value for a variable; None if it takes none."""
        variable = self._facts[node.element].variables.get(node.name)
        if variable is None or not variable.settable or not variable.scalar:
            return None
        return start_value(variable, parameter, ".".join((*node.element, node.name))[:100])

    def _meant(
        self,
        path: Path,
        name: str,
        parameter: Parameter,
        seen: frozenset[Node] = frozenset(),
        through: bool = False,
    ) -> Iterator[tuple[Node, Parameter, bool]]:
        """Yield each variable that a name means in an element, its value, and whether a connection gives it."""
        if path in self._all:
            yield Node(path, name), parameter, through
            return
        system, node = self._systems[path], Node(path, name)
        if name in system.connectors and node not in seen:
            own = system.connectors[name].unit
            inner = Parameter(name, _in_unit(parameter, own, name), own or parameter.unit)
            for edge in self._leaving.get(node, ()):
                given = _along(inner, edge.connection, self._unit(edge.target))
                yield from self._meant(edge.target.element, edge.target.name, given, seen | {node}, True)
        # a dot may be part of an element's name
        for dot in (match.start() for match in _DOT.finditer(name)):
            if isinstance(system.elements.get(name[:dot]), Component | System):
                yield from self._meant((*path, name[:dot]), name[dot + 1 :], parameter, seen, through)

    def _inner_first(self) -> list[tuple[Path, System]]:
        return sorted(self._systems.items(), key=lambda item: -len(item[0]))

    def _add(self, edge: _Edge) -> None:
        other = self._edges.setdefault(edge.target, edge)
        if other is not edge:
            expected = "an input of its own for each connection"
            raise RefusalError(
                edge.connection.where, expected, f"one that {other.connection.where} feeds already"
            )
        self._leaving.setdefault(edge.source, []).append(edge)

    def _directed(self, path: Path, connection: Connection) -> _Edge:
        """Return a connection, from the end that gives the value to the end that takes it."""
        start, end = (self._end(path, place, connection) for place in (connection.start, connection.end))
        for source, target in ((start, end), (end, start)):
            if source[1] in _giving(source[0], path) and target[1] in _taking(target[0], path):
                return _Edge(source[0], target[0], connection)
        got = f"{start[1] or 'none'} and {end[1] or 'none'}"
        hint = "The kinds of its connectors say it, such as output and input."
        raise RefusalError(
            connection.where, "an end that gives a value and one that takes it", quoted(got), hint
        )

    def _end(self, path: Path, place: tuple[str | None, str], connection: Connection) -> tuple[Node, str]:
        element = path if place[0] is None else (*path, place[0])
        if element in self._references:
            return self._signal(path, self._references[element], place[1], connection)
        owner = self._all.get(element) or self._systems.get(element)
        if owner is None:
            raise RefusalError(connection.where, "an element of its system", quoted(place[0]))
        if place[1] not in owner.connectors:
            raise RefusalError(connection.where, f"a connector of {owner.name[:60]}", quoted(place[1]))
        return Node(element, place[1]), owner.connectors[place[1]].kind

    def _signal(
        self, path: Path, reference: DictionaryReference, name: str, connection: Connection
    ) -> tuple[Node, str]:
        """Return a signal of the nearest dictionary of this name, in the system itself or around it."""
        if name not in reference.connectors:
            raise RefusalError(connection.where, f"a connector of {reference.name[:60]}", quoted(name))
        for depth in range(len(path), -1, -1):
            signals = self._systems[path[:depth]].dictionaries.get(reference.dictionary)
            if signals is None:
                continue
            if name not in signals:
                expected = f"an entry of the signal dictionary {quoted(reference.dictionary)}"
                raise RefusalError(connection.where, expected, quoted(name))
            return Node(_dictionary(path[:depth], reference.dictionary), name), reference.connectors[
                name
            ].kind
        raise RefusalError(connection.where, "a signal dictionary", quoted(reference.dictionary))

    def _unit(self, node: Node) -> Unit | None:
        """Return the unit of a connector; an FMU's own unit comes first."""
        if node.element in self._all:
            variable = self._facts[node.element].variables.get(node.name)
            if variable is not None and variable.unit is not None:
                return variable.unit
            return self._all[node.element].connectors[node.name].unit
        return self._systems[node.element].connectors[node.name].unit

    def _link(self, target: Node, gains: Mapping[Path, float]) -> Link | None:
        """Return the link into an input; None if it comes from a connector of the whole system."""
        edges = [self._edges[target]]
        while edges[-1].source.element not in self.components:
            source = edges[-1].source
            # the output of a gain has the source of its input
            before = self._edges.get(Node(source.element, "input") if source.element in self._all else source)
            if before is None:
                return None
            if before in edges:
                raise RefusalError(before.connection.where, "a value that comes from a component", "a circle")
            edges.append(before)
        return self._gain(edges[::-1], gains)

    def _gain(self, edges: list[_Edge], gains: Mapping[Path, float]) -> Link:
        """Return the edges from an output to an input as one gain and offset."""
        gain, offset, noted, source = 1.0, 0.0, None, self._unit(edges[0].source)
        unit, passed, table = source, [], _joined_table(edges)
        for edge in edges:
            connection, after = edge.connection, self._unit(edge.target)
            noted = connection.gain_unit or noted
            changes = connection.suppressed or connection.gain_unit is not None
            # the number is converted first, and then transformed
            by, shift = (1.0, 0.0) if changes else _conversion(unit, after, connection)
            change = connection.change or Transformation()
            gain, offset = gain * by * change.factor, (offset * by + shift) * change.factor + change.offset
            unit = after or unit
            through = self._all.get(edge.target.element) if edge is not edges[-1] else None
            if through is not None:
                own = float(self._values[edge.target.element].get("gain", 1.0))
                own = gains.get(edge.target.element, own)
                gain, offset = gain * own, offset * own
                passed.append(edge.target.element)
                unit, noted = self._unit(Node(edge.target.element, "output")), through.gain_unit
        target = self._unit(edges[-1].target)
        if table is not None and (gain, offset) != (1.0, 0.0):
            got = f"gain {gain:g} and offset {offset:g}"
            raise RefusalError(edges[-1].connection.where, "no gain beside a mapping of values", got)
        if (
            noted is None
            and source is not None
            and target is not None
            and not _fit(gain, offset, source, target)
        ):
            noted = gain_unit_between(*(one.difference if one.offset else one for one in (source, target)))
            if noted is None:
                got = f"{source.name} to {target.name}"
                raise RefusalError(edges[-1].connection.where, "units whose ratio is one of SI symbols", got)
        if not (math.isfinite(gain) and math.isfinite(offset)):
            got = f"{gain:g} and {offset:g}"
            raise RefusalError(edges[-1].connection.where, "a finite gain and offset", got)
        return Link(edges[0].source, edges[-1].target, gain, noted, tuple(passed), offset, table)


def components_of(system: System, path: Path = ()) -> Iterator[tuple[Path, Component]]:
    """Yield the components of a system and of its nested systems, with their paths."""
    for name, element in system.elements.items():
        if isinstance(element, Component):
            yield (*path, name), element
        elif isinstance(element, System):
            yield from components_of(element, (*path, name))


def _systems(system: System, path: Path) -> Iterator[tuple[Path, System]]:
    yield path, system
    for name, signals in system.dictionaries.items():
        # a system of signals alone passes them on
        yield _dictionary(path, name), System(name, signals)
    for name, element in system.elements.items():
        if isinstance(element, System):
            yield from _systems(element, (*path, name))


def _references(systems: Mapping[Path, System]) -> Iterator[tuple[Path, DictionaryReference]]:
    for path, system in systems.items():
        for name, element in system.elements.items():
            if isinstance(element, DictionaryReference):
                yield (*path, name), element


def _dictionary(path: Path, name: str) -> Path:
    """Return the path of a signal dictionary; no element has an empty name."""
    return (*path, "", name)


def _giving(node: Node, path: Path) -> frozenset[str]:
    """Return the kinds of connectors that give a value inside a system; its own connectors give outside values."""
    return TAKING if node.element == path else GIVING


def _taking(node: Node, path: Path) -> frozenset[str]:
    return GIVING if node.element == path else TAKING


def _fit(gain: float, offset: float, source: Unit, target: Unit) -> bool:
    """Return whether a connection needs no unit of its gain: one unit, or a conversion between units of two zeros."""
    have_two_zeros = source.offset != target.offset
    return agree(source, target) or (have_two_zeros and converts(gain, offset, source, target))


def _joined_table(edges: Sequence[_Edge]) -> Table | None:
    """Return the mappings of values on the way from an output to an input as one; None without any."""
    table: Table | None = None
    for edge in edges:
        change = edge.connection.change
        if change is None or change.table is None:
            continue
        where = edge.connection.where
        table = change.table if table is None else tuple((a, change.of(b, where)) for a, b in table)
    return table


def _conversion(before: Unit | None, after: Unit | None, connection: Connection) -> tuple[float, float]:
    """Return factor and offset of the conversion from one unit to the next."""
    if before is None or after is None or agree(before, after):
        return 1.0, 0.0
    got = f"{before.name or '1'} to {after.name or '1'}"
    if before.exponents != after.exponents:
        if connection.change is not None:
            return 1.0, 0.0  # the factor is the gain, in any unit
        hint = "Give it a LinearTransformation, and suppressUnitConversion."
        raise RefusalError(connection.where, "units of one kind, or a gain", got, hint)
    return conversion(before, after)


def _in_unit(parameter: Parameter, unit: Unit | None, where: str) -> StartValue:
    if isinstance(parameter.value, str | bool):
        return parameter.value
    return converted(float(parameter.value), parameter.unit, unit, where) if unit else parameter.value


def _along(parameter: Parameter, connection: Connection, unit: Unit | None) -> Parameter:
    """Return a parameter after a connection."""
    change, where = connection.change, connection.where
    if change is not None and change.table is not None:
        return Parameter(parameter.name, change.of(parameter.value, where), parameter.unit)
    if isinstance(parameter.value, str | bool):
        return parameter
    if change is None and not connection.suppressed:
        return parameter
    after = None if connection.suppressed else unit
    value = float(_in_unit(parameter, after, where))
    return Parameter(parameter.name, (change or Transformation()).of(value, where), after or None)

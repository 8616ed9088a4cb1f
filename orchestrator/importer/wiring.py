"""Moving values from outputs to inputs: in an order that respects direct feedthrough, without allocation."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.fmi.instance import Instance
from vibroimpact.orchestrator.fmi.variables import DTYPES, VariableGroup
from vibroimpact.orchestrator.importer.component import Component
from vibroimpact.orchestrator.importer.described import kind_of
from vibroimpact.orchestrator.importer.feedthrough import Connections, TransferOrder, connection_name
from vibroimpact.orchestrator.importer.specification import ConnectionSpec


def drawn_inputs(connections: Connections) -> set[str]:
    """Return the inputs, among connections from one component to another, that get a value and its slope."""
    named = {c.target[1] for c in connections}
    return {name for x in named if f"{x}_rate" in named for name in (x, f"{x}_rate")}


@dataclass(frozen=True, slots=True)
class StatusCall:
    """A bare call that returns FMI's status, with the data for an error message."""

    call: Callable[[], int]
    instance: Instance
    function: str
    moved: VariableGroup | Scaling | None = None
    """The variables that the call reads or writes, or the scaling that it makes."""


@dataclass(frozen=True, slots=True)
class Scaling:
    """Real numbers times their gains, plus their offsets, into another buffer; as a call it returns status 0.

    Without `offsets` nothing is added, not even 0: the sign of a zero is kept.
    """

    read: NDArray[np.float64]
    gains: NDArray[np.float64]
    write: NDArray[np.float64]
    offsets: NDArray[np.float64] | None = None

    def __call__(self) -> int:
        """Write the scaled values; returns status 0."""
        np.multiply(self.read, self.gains, out=self.write)
        if self.offsets is not None:
            np.add(self.write, self.offsets, out=self.write)
        return 0


class Transfer:
    """Connections from one component to another that are moved by one read and one write.

    Where the two sides have the same type and no gains, both use one buffer and nothing is copied. An array is moved
    whole, by a transfer of its own.
    """

    def __init__(self, source: Component, target: Component, connections: Connections) -> None:
        self.source, self.target = source, target
        self.connections = tuple(connections)
        self.kind = kind_of(source.variables[connections[0].source[1]])
        target_kind = kind_of(target.variables[connections[0].target[1]])
        inputs = [target.variables[c.target[1]].valueReference for c in connections]
        self.read: VariableGroup = source.group(self.kind, [c.source[1] for c in connections])
        sizes = [source.size_of(c.source[1]) for c in connections]
        self._ends = np.cumsum([0, *sizes])
        self._gains = np.repeat([c.gain for c in connections], sizes)
        self._offsets = np.repeat([c.offset for c in connections], sizes)
        same_type = DTYPES[target.instance.fmi_version].get(target_kind) is self.read.values.dtype.type
        changed = any(c.mapping for c in connections)
        shared = same_type and not changed and bool(np.all((self._gains == 1.0) & (self._offsets == 0.0)))
        own = self.read.values if shared else None
        written = target.instance.group(target_kind, inputs, size=self.read.values.size, values=own)
        self.write = target.clocked(written, [c.target[1] for c in connections])
        self.convert: Callable[[], int] | None = None if shared else self._converter()
        """Carries the values read to the values written, returns status 0; None when both share one buffer."""
        self._bind_rates()

    def _converter(self) -> Callable[[], int]:
        if any(c.mapping for c in self.connections):
            return partial(_map_values, self.connections, self._ends, self.read.values, self.write.values)
        read, write, gains = self.read.values, self.write.values, self._gains
        offsets = self._offsets if np.any(self._offsets) else None
        if self.kind == "Float64" and write.dtype == np.float64:
            return Scaling(read, gains, write, offsets)

        def convert() -> int:
            np.multiply(read, gains, out=write, casting="unsafe")
            return 0

        def shift() -> int:
            np.copyto(write, read * gains + offsets, casting="unsafe")
            return 0

        def copy() -> int:
            np.copyto(write, read, casting="unsafe")
            return 0

        if offsets is not None:
            return shift
        return copy if bool(np.all(gains == 1.0)) else convert

    def _places(self, chosen: Iterable[int]) -> list[int]:
        """Return the places of the values of some connections."""
        return [place for i in chosen for place in range(self._ends[i], self._ends[i + 1])]

    def _bind_rates(self) -> None:
        """Find the inputs that follow a straight line: those with an input for their slope (`force`, `force_rate`).

        If the source gives the slope too, value and slope belong to the start of a step.
        """
        variables = self.target.variables
        slopes = [f"{c.target[1]}_rate" for c in self.connections]
        given = drawn_inputs(self.connections)
        sloping = [
            i
            for i, name in enumerate(slopes)
            if name in variables and variables[name].causality == "input" and name not in given
        ]
        names = [slopes[i] for i in sloping]
        self._sloping = self._places(sloping)
        drawn = [i for i, c in enumerate(self.connections) if c.target[1] in given]
        self.is_straight = len({*drawn, *sloping}) == len(self.connections)
        """Does every input follow a straight line over a step of the exchange "iterated"?"""
        self._rates = self.target.group("Float64", names) if names else None
        self._kept = self._places(drawn)
        self._begin_values = self.write.values.copy()

    def keep_at_start(self, inputs: Container[str], *, kept: bool) -> None:
        """Fix these inputs to their values at the start of a step, also in a repeated step, or release them."""
        named = set(self._places(i for i, c in enumerate(self.connections) if c.target[1] in inputs))
        self._kept = sorted({*self._kept, *named} if kept else {*self._kept} - named)

    def note_begin(self) -> None:
        """Remember the inputs at the start of a step."""
        if self._rates is not None or self._kept:
            self._begin_values[:] = self.write.values

    def write_over_step(self, size: float) -> None:
        """Write inputs for a repeated step of `size` s from the outputs at its end, which `take` has read.

        An input with a slope follows the straight line from the start of the step. An input fixed to the start keeps
        its value. Any other input is held at its value at the end.
        """
        values, begin = self.write.values, self._begin_values
        if self._rates is not None:
            self._rates.values[:] = (values[self._sloping] - begin[self._sloping]) / size
            self._rates.set()
        at_start = [*self._sloping, *self._kept]
        at_end = values.copy()
        values[at_start] = begin[at_start]
        self.write.set()
        values[:] = at_end

    def take(self) -> NDArray[Any]:
        """Read the outputs into the inputs' buffer, without writing; returns a copy of it."""
        self.read.get()
        if self.convert is not None:
            self.convert()
        return self.write.values.copy()

    def carries(self, connection: ConnectionSpec) -> bool:
        """Is this one of the connections moved here?"""
        return any(c.target == connection.target for c in self.connections)

    def gain_of(self, connection: ConnectionSpec) -> float:
        """Return the present gain of one connection."""
        return float(self._gains[self._ends[self._place_of(connection)]])

    def set_gain(self, connection: ConnectionSpec, gain: float) -> None:
        """Change the gain of one connection; the calls from `calls` must be bound again."""
        if self.convert is None:
            kind = kind_of(self.target.variables[connection.target[1]])
            self.write = self.target.group(kind, [c.target[1] for c in self.connections])
        self._gains[self._places([self._place_of(connection)])] = gain
        self.convert = self._converter()

    def _place_of(self, connection: ConnectionSpec) -> int:
        return [c.target for c in self.connections].index(connection.target)

    def move(self) -> None:
        """Read the outputs and write the inputs."""
        self.read.get()
        if self.convert is not None:
            self.convert()
        self.write.set()

    def calls(self) -> list[StatusCall]:
        """Return the bare calls of a move, for code that checks their status itself."""
        source, target = self.source.instance, self.target.instance
        scaling = self.convert if isinstance(self.convert, Scaling) else None
        middle = [] if self.convert is None else [StatusCall(self.convert, target, "convert", scaling)]
        return [
            StatusCall(self.read.get_call, source, f"Get{self.read.name}", self.read),
            *middle,
            StatusCall(self.write.set_call, target, f"Set{self.write.name}", self.write),
        ]


def _map_values(
    connections: Connections, ends: NDArray[np.int64], read: NDArray[Any], write: NDArray[Any]
) -> int:
    """Write the values that the mappings of connections give; a value that a mapping lacks raises ComponentError."""
    for i, connection in enumerate(connections):
        part = slice(ends[i], ends[i + 1])
        table = dict(connection.mapping)
        values = [int(value) for value in read[part]] if table else []
        lacking = next((value for value in values if value not in table), None)
        if lacking is not None:
            known = ", ".join(map(str, table))
            raise ComponentError(
                f"{connection_name(connection)}: expected a value of its mapping ({known}), got {lacking}.",
                instance=connection.source[0],
            )
        write[part] = [table[value] for value in values] if table else read[part]
    return 0


#: Scale of values below which they compare as 0.
SMALLEST = 1e-300


class SettlingInputs:
    """Inputs of a step, given by transfers; the step is repeated until the inputs at its end stay the same.

    The tolerance is the relative difference below which values are equal.
    """

    def __init__(self, transfers: Sequence[Transfer], tolerance: float) -> None:
        self._transfers, self._tolerance = transfers, tolerance
        self._before: list[NDArray[Any]] | None = None

    def have_settled(self) -> bool:
        """Take the inputs; returns whether they equal the inputs taken before."""
        before, self._before = self._before, [transfer.take() for transfer in self._transfers]
        return before is not None and all(
            equal_values(a, b, self._tolerance) for a, b in zip(self._before, before, strict=True)
        )


def equal_values(a: NDArray[Any], b: NDArray[Any], tolerance: float) -> bool:
    """Are values equal, relative to the largest? Booleans and integers count as numbers; NaN equals NaN."""
    wide_a, wide_b = a.astype(np.float64), b.astype(np.float64)
    # fmax: a NaN does not hide the size of the others
    largest = np.fmax.reduce(np.abs(wide_a), initial=0.0)
    close = np.abs(wide_a - wide_b) <= tolerance * (SMALLEST + largest)
    return bool(np.all(close | (np.isnan(wide_a) & np.isnan(wide_b))))


class CallList:
    """Bare calls made one after the other; the first bad status raises its instance's error.

    Attributes
    ----------
    calls : tuple of StatusCall
        The calls.
    """

    __slots__ = ("_bare", "calls")

    def __init__(self, calls: Iterable[StatusCall]) -> None:
        self.calls = tuple(calls)
        self._bare = tuple(c.call for c in self.calls)

    def __call__(self) -> None:
        """Make the calls."""
        for call in self._bare:
            status = call()
            if status:
                self._explain(call, status)

    def __len__(self) -> int:
        """Return the number of calls."""
        return len(self._bare)

    def find(self, call: object) -> StatusCall | None:
        """Return the instance and function of a call; None if it is not in the list."""
        return next((c for c in self.calls if c.call is call), None)

    def _explain(self, call: Callable[[], int], status: int) -> None:
        found = self.find(call)
        assert found is not None
        found.instance.check(status, found.function)


def moves_of(transfers: Iterable[Transfer]) -> CallList:
    """Return the calls that move transfers in their order."""
    return CallList(call for transfer in transfers for call in transfer.calls())


def transfers_of(order: TransferOrder, components: dict[str, Component]) -> tuple[Transfer, ...]:
    """Group ordered connections into as few transfers as their order allows; loops are kept apart."""
    groups: list[list[ConnectionSpec]] = []
    for connection in order.connections:
        alike = [group for group in groups if order.loops_back(group[0]) == order.loops_back(connection)]
        place = _group_for(connection, alike, components, order)
        if place is None:
            groups.append([connection])
        else:
            place.append(connection)
    return tuple(
        Transfer(components[group[0].source[0]], components[group[0].target[0]], group) for group in groups
    )


def _key(connection: ConnectionSpec, components: dict[str, Component]) -> tuple[object, ...]:
    source, target = components[connection.source[0]], components[connection.target[0]]
    return (
        source.name,
        target.name,
        kind_of(source.variables[connection.source[1]]),
        kind_of(target.variables[connection.target[1]]),
        source.clocks_of(connection.source[1]),
        target.clocks_of(connection.target[1]),
        connection.target[1] if connection.source[1] in source.shapes else None,
    )


def _group_for(
    connection: ConnectionSpec,
    groups: list[list[ConnectionSpec]],
    components: dict[str, Component],
    order: TransferOrder,
) -> list[ConnectionSpec] | None:
    """Return the last group with the same ends, if no transfer since then feeds this connection's output."""
    key = _key(connection, components)
    source = components[connection.source[0]]
    listed = source.depends.get(connection.source[1], frozenset())
    needed = source.variables if connection in order.unlisted else listed
    for group in reversed(groups):
        if _key(group[0], components) == key:
            return group
        if any(c.target[0] == source.name and c.target[1] in needed for c in group):
            return None
    return None

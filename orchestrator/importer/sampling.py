"""Sampling recorded variables on a time grid without disturbing the steps.

A component with states goes back to the start of the step, is read at each sample, and returns to the end of its step.
The run is the same, bit for bit, with and without sampling. A component in model exchange is read on the motion of its
solver, without any repeated step.

A component without states, or with one step size, is read at the communication points. Between them its real numbers
follow straight lines, and all other values are those of the step's start. On a grid of its own all its values are held.
"""

from __future__ import annotations

from array import array
from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.orchestrator.fmi.exchange import ExchangeInstance
from vibroimpact.orchestrator.fmi.variables import VariableGroup
from vibroimpact.orchestrator.importer.component import SAME_INSTANT, Component
from vibroimpact.orchestrator.importer.described import kind_of
from vibroimpact.orchestrator.importer.events import StepWatcher
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.stop_contacts.law_bond import LawBond

REAL_KINDS = ("Float64", "Float32")


class _Row:
    """One sample: the time and the plain numbers in columns, and the values of formed variables."""

    def __init__(self, columns: int, formed: int) -> None:
        self.numbers = np.empty(columns)
        self.formed: list[Any] = [None] * formed


class _Probe:
    """The recorded variables of one component: plain numbers by their columns, formed ones by their places."""

    def __init__(
        self, component: Component, columns: Sequence[tuple[int, str]], places: Sequence[tuple[int, str]]
    ) -> None:
        self.component = component
        self.exchange = component.instance if isinstance(component.instance, ExchangeInstance) else None
        self.groups: list[tuple[list[int], VariableGroup]] = []
        alike: dict[tuple[str, frozenset[int]], list[tuple[int, str]]] = {}
        for place, name in columns:
            key = kind_of(component.variables[name]), component.clocks_of(name)
            alike.setdefault(key, []).append((place, name))
        for (kind, _), chosen in alike.items():
            self.groups.append(([i for i, _ in chosen], component.group(kind, [name for _, name in chosen])))
        self.is_revisited = component.has_states and component.capabilities.variable_steps
        self._formed = [(i, component.group(self._kind(name), [name])) for i, name in places]
        kinds = {i: kind for (kind, _), chosen in alike.items() for i, _ in chosen}
        self._drawn = [i for i, kind in kinds.items() if kind in REAL_KINDS]
        self._held = [i for i, kind in kinds.items() if kind not in REAL_KINDS]
        self._drawn_places = [i for i, name in places if self._kind(name) in REAL_KINDS]

    def _kind(self, name: str) -> str:
        return kind_of(self.component.variables[name])

    def read(self, row: _Row) -> None:
        """Write the present values into a row."""
        for columns, group in self.groups:
            row.numbers[columns] = group.get()
        for place, group in self._formed:
            row.formed[place] = group.get().copy()

    def interpolate(self, row: _Row, share: float, start: _Row, end: _Row) -> None:
        """Write the values after a share of a step, from those at its start and its end."""
        row.numbers[self._drawn] = (1.0 - share) * start.numbers[self._drawn] + share * end.numbers[
            self._drawn
        ]
        row.numbers[self._held] = start.numbers[self._held]
        for place, _ in self._formed:
            row.formed[place] = start.formed[place]
        for place in self._drawn_places:
            row.formed[place] = (1.0 - share) * start.formed[place] + share * end.formed[place]


class Sampler:
    """Samples variables of an importer's components.

    Parameters
    ----------
    importer : Importer
        Its steps are observed from now on.
    variables : sequence of (component, variable)
        The recorded variables.
    rate : float
        Samples per second.
    formed : collection of (component, variable)
        The variables whose samples keep their type and shape, such as arrays and texts. All other variables are
        columns of float64.

    Attributes
    ----------
    rows : ndarray, shape (sample, 1 + variables)
        One row for each sample: time, then the variables that are plain numbers.
    """

    def __init__(
        self,
        importer: Importer,
        variables: Sequence[tuple[str, str]],
        rate: float,
        formed: Collection[tuple[str, str]] = (),
    ) -> None:
        self._importer = importer
        self._rate = rate
        plain = [one for one in variables if one not in formed]
        self._formed = [one for one in variables if one in formed]
        self._width = 1 + len(plain)
        columns, places = _by_component(plain, 1), _by_component(self._formed, 0)
        self._probes = [
            _Probe(importer.components[name], columns.get(name, ()), places.get(name, ()))
            for name in dict.fromkeys(component for component, _ in variables)
        ]
        self._values = array("d")
        self._kept: list[list[Any]] = [[] for _ in self._formed]
        self._first, self._index, self._end = np.inf, 0, -np.inf
        importer.watchers.append(StepWatcher(self._before_step, self._after_step, self._patience))

    @property
    def rows(self) -> NDArray[np.float64]:
        """The samples so far."""
        return np.array(self._values).reshape(-1, self._width)

    def formed(self, place: int, dtype: str, shape: tuple[int, ...]) -> NDArray[Any]:
        """Return the samples of a formed variable so far, with a type and a shape of each sample."""
        rows = self._kept[place]
        found = np.empty((len(rows), *shape), dtype=dtype)
        for number, row in enumerate(rows):
            found[number] = row.reshape(shape)[()]
        return found

    def begin(self, first: float, end: float) -> None:
        """Sample from `first` to `end`, s; the first sample is taken when the run reaches `first`."""
        self._values = array("d")
        self._kept = [[] for _ in self._formed]
        self._first, self._index, self._end = first, 0, end
        if self._importer.time >= first - self._room(first):
            self._importer.keeps_start = any(probe.exchange is None for probe in self._probes)
            self._take_now(self._importer.time)

    @staticmethod
    def _room(time: float) -> float:
        return SAME_INSTANT * (1.0 + abs(time))

    def _next(self) -> float:
        time = self._first + self._index / self._rate
        return time if time <= self._end + self._room(self._end) else np.inf

    def _patience(self) -> float:
        """Return an infinite time before sampling begins and after the last sample, else 0."""
        return np.inf if self._next() == np.inf else 0.0

    def _take_now(self, time: float) -> None:
        row = self._row(time)
        for probe in self._probes:
            probe.read(row)
        self._keep(row)
        self._index += 1

    def _row(self, time: float) -> _Row:
        row = _Row(self._width, len(self._formed))
        row.numbers[0] = time
        return row

    def _keep(self, row: _Row) -> None:
        self._values.extend(row.numbers)
        for kept, values in zip(self._kept, row.formed, strict=True):
            kept.append(values)

    def _before_step(self, time: float) -> None:
        self._start_row = self._row(time)
        for probe in self._probes:
            if not probe.is_revisited:
                probe.read(self._start_row)
            instance, _ = self._moving(probe)
            if instance is not None:
                instance.points.keep_samples(self._ahead(time))

    def _ahead(self, time: float) -> NDArray[np.float64]:
        """Return the instants of samples in a step from `time`, s, which may be as long as a macro step."""
        last = min(self._end, time + self._importer.macro_step)
        count = int((last - self._first) * self._rate) + 1 - self._index if np.isfinite(self._first) else 0
        return self._first + np.arange(self._index, self._index + max(0, count)) / self._rate

    def _after_step(self, time: float, end: float) -> None:
        inside = []
        while self._next() < end - self._room(end):
            inside.append(self._next())
            self._index += 1
        if inside:
            self._take_inside(time, end, inside)
        if self._next() <= end + self._room(end):
            self._take_now(end)

    def _take_inside(self, time: float, end: float, instants: Sequence[float]) -> None:
        rows = [self._row(instant) for instant in instants]
        for probe in self._probes:
            if self._follow(probe, time, end, rows):
                continue
            if probe.is_revisited:
                self._revisit(probe, time, instants, rows)
            else:
                self._interpolate(probe, time, end, instants, rows)
        for row in rows:
            self._keep(row)

    def _moving(self, probe: _Probe) -> tuple[ExchangeInstance | None, LawBond | None]:
        """Return the integrated motion that a component follows: its own, or that of a stop's body."""
        law = self._importer.contacts.law_of(probe.component)
        return (probe.exchange, None) if law is None else (law.instance, law)

    def _follow(self, probe: _Probe, time: float, end: float, rows: Sequence[_Row]) -> bool:
        """Read a component at the states that an integrated step has kept; returns whether there are any."""
        instance, law = self._moving(probe)
        if instance is None or len(found := instance.kept_samples(time, end)) < len(rows):
            return False
        with instance.points.as_within_step():
            for row, states in zip(rows, found, strict=False):
                instance.show(states, row.numbers[0])
                if law is not None:
                    law.show()
                probe.read(row)
        instance.show(instance.states)
        if law is not None:
            law.show()
        return True

    def _revisit(self, probe: _Probe, time: float, instants: Sequence[float], rows: Sequence[_Row]) -> None:
        """Read a component inside the step just made, and put it back at the step's end.

        Each sample is reached from the start of the step. Some inputs (a slope from the start, the force of a yielding
        stop) have their meaning only from that start.
        """
        component = probe.component
        with component.taken_back():
            for row, instant in zip(rows, instants, strict=True):
                if instant > time:
                    component.step_from_start(time, instant - time)
                else:
                    component.revisit_start()
                probe.read(row)

    def _interpolate(
        self, probe: _Probe, time: float, end: float, instants: Sequence[float], rows: Sequence[_Row]
    ) -> None:
        last = self._row(end)
        probe.read(last)
        for row, instant in zip(rows, instants, strict=True):
            share = 0.0 if probe.component.on_own_grid else (instant - time) / (end - time)
            probe.interpolate(row, share, self._start_row, last)


def _by_component(variables: Sequence[tuple[str, str]], first: int) -> dict[str, list[tuple[int, str]]]:
    """Return numbers from `first` on and names of variables, by their components."""
    found: dict[str, list[tuple[int, str]]] = {}
    for number, (component, name) in enumerate(variables, start=first):
        found.setdefault(component, []).append((number, name))
    return found

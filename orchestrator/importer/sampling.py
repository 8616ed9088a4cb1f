"""Sampling recorded variables on a time grid without disturbing the steps.

A component with states goes back to the start of the step, is read at each sample, and returns to the end of its step.
The run is the same, bit for bit, with and without sampling. A component in model exchange is read on the motion of its
solver, without any repeated step. Any other component without states is read at the communication points, with
straight lines between them.
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vibroimpact.orchestrator.fmi.exchange import ExchangeInstance
from vibroimpact.orchestrator.fmi.variables import VariableGroup
from vibroimpact.orchestrator.importer.component import SAME_INSTANT, Component, kind_of
from vibroimpact.orchestrator.importer.events import StepWatcher
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.stop_contacts.law_bond import LawBond


class _Probe:
    """The recorded variables of one component."""

    def __init__(self, component: Component, columns: Sequence[tuple[int, str]]) -> None:
        self.component = component
        self.exchange = component.instance if isinstance(component.instance, ExchangeInstance) else None
        self.groups: list[tuple[list[int], VariableGroup]] = []
        alike: dict[tuple[str, frozenset[int]], list[tuple[int, str]]] = {}
        for place, name in columns:
            key = kind_of(component.variables[name]), component.clocks_of(name)
            alike.setdefault(key, []).append((place, name))
        for (kind, _), chosen in alike.items():
            self.groups.append(([i for i, _ in chosen], component.group(kind, [name for _, name in chosen])))
        self.before = np.zeros(0)

    def read(self, row: NDArray[np.float64]) -> None:
        """Write the present values into their columns of a row."""
        for columns, group in self.groups:
            row[columns] = group.get()

    @property
    def columns(self) -> list[int]:
        """The columns of a row that this probe fills."""
        return [column for columns, _ in self.groups for column in columns]


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

    Attributes
    ----------
    rows : ndarray, shape (sample, 1 + variables)
        One row for each sample: time, then the variables.
    """

    def __init__(self, importer: Importer, variables: Sequence[tuple[str, str]], rate: float) -> None:
        self._importer = importer
        self._rate = rate
        self._width = 1 + len(variables)
        columns: dict[str, list[tuple[int, str]]] = {}
        for i, (component, name) in enumerate(variables, start=1):
            columns.setdefault(component, []).append((i, name))
        self._probes = [_Probe(importer.components[c], found) for c, found in columns.items()]
        self._values = array("d")
        self._first, self._index, self._end = np.inf, 0, -np.inf
        importer.watchers.append(StepWatcher(self._before_step, self._after_step, self._patience))

    @property
    def rows(self) -> NDArray[np.float64]:
        """The samples so far."""
        return np.array(self._values).reshape(-1, self._width)

    def begin(self, first: float, end: float) -> None:
        """Sample from `first` to `end`, s; the first sample is taken when the run reaches `first`."""
        self._values = array("d")
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
        row = np.empty(self._width)
        row[0] = time
        for probe in self._probes:
            probe.read(row)
        self._values.extend(row)
        self._index += 1

    def _before_step(self, time: float) -> None:
        self._start_row = np.empty(self._width)
        for probe in self._probes:
            if not probe.component.has_states:
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
        rows = [np.empty(self._width) for _ in instants]
        for row, instant in zip(rows, instants, strict=True):
            row[0] = instant
        for probe in self._probes:
            if self._follow(probe, time, end, rows):
                continue
            if probe.component.has_states:
                self._revisit(probe, time, instants, rows)
            else:
                self._interpolate(probe, time, end, instants, rows)
        for row in rows:
            self._values.extend(row)

    def _moving(self, probe: _Probe) -> tuple[ExchangeInstance | None, LawBond | None]:
        """Return the integrated motion that a component follows: its own, or that of a stop's body."""
        law = self._importer.contacts.law_of(probe.component)
        return (probe.exchange, None) if law is None else (law.instance, law)

    def _follow(self, probe: _Probe, time: float, end: float, rows: Sequence[NDArray[np.float64]]) -> bool:
        """Read a component at the states that an integrated step has kept; returns whether there are any."""
        instance, law = self._moving(probe)
        if instance is None or len(found := instance.kept_samples(time, end)) < len(rows):
            return False
        with instance.points.as_within_step():
            for row, states in zip(rows, found, strict=False):
                instance.show(states, row[0])
                if law is not None:
                    law.show()
                probe.read(row)
        instance.show(instance.states)
        if law is not None:
            law.show()
        return True

    def _revisit(
        self, probe: _Probe, time: float, instants: Sequence[float], rows: Sequence[NDArray[np.float64]]
    ) -> None:
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
        self,
        probe: _Probe,
        time: float,
        end: float,
        instants: Sequence[float],
        rows: Sequence[NDArray[np.float64]],
    ) -> None:
        last = np.empty(self._width)
        probe.read(last)
        columns = probe.columns
        for row, instant in zip(rows, instants, strict=True):
            share = (instant - time) / (end - time)
            row[columns] = (1.0 - share) * self._start_row[columns] + share * last[columns]

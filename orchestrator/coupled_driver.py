"""A short-form scene with every component its own FMU: the body, and one ImpactStop for each stop (`coupled`).

The same interface as `body_driver.BodyDriver`, so that a run does not know which of the two carries it.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence

from vibroimpact.fmus import fmu_path
from vibroimpact.orchestrator.body_record import DeadlineReached, ImpactLimitReached, RecordedBody
from vibroimpact.orchestrator.fmi.variables import VariableGroup
from vibroimpact.orchestrator.importer.component import Value
from vibroimpact.orchestrator.importer.events import Event
from vibroimpact.orchestrator.importer.master import SAME_INSTANT, Importer
from vibroimpact.orchestrator.importer.specification import ComponentSpec, ConnectionSpec, Exchange

#: Impacts between two emptyings of the body's record: one impact writes at most two rows, of room for 512.
IMPACTS_PER_BLOCK = 200
BODY = "body"


def stop_name(k: int) -> str:
    """Name of the component of stop `k` (1-based)."""
    return f"stop{k}"


def connections_of(stops: int) -> list[ConnectionSpec]:
    """Return the connections between a body and its stops."""
    found = []
    for k in range(1, stops + 1):
        port, stop = f"contact[{k}]", stop_name(k)
        found += [
            ConnectionSpec((BODY, f"{port}.displacement"), (stop, "displacement")),
            ConnectionSpec((BODY, f"{port}.velocity"), (stop, "velocity")),
            ConnectionSpec((stop, "applied_restitution"), (BODY, f"{port}.applied_restitution")),
            ConnectionSpec((stop, "applied_force"), (BODY, f"{port}.applied_force")),
        ]
    return found


class CoupledDriver(RecordedBody):
    """Drives a body and its stops through whole runs.

    Parameters
    ----------
    floats, integers : mapping
        Parameters of the body, as for `BodyDriver`; the laws of its contacts must be `external`.
    stops : int
        Number of stops.
    macro_step : float
        Longest communication step, s.
    exchange : str
        How values are exchanged; the contacts do not depend on it.
    """

    def __init__(
        self,
        floats: Mapping[str, float],
        integers: Mapping[str, int],
        stops: int,
        *,
        macro_step: float = math.inf,
        exchange: Exchange = "gauss_seidel",
    ) -> None:
        self._integers = dict(integers)
        self._limit = self._integers.pop("impact_limit")
        self._stops = stops
        specs = [ComponentSpec(BODY, fmu_path("Oscillator"), self._integers)]
        specs += [ComponentSpec(stop_name(k), fmu_path("ImpactStop")) for k in range(1, stops + 1)]
        self.importer = Importer(specs, connections_of(stops), macro_step=macro_step, exchange=exchange)
        self.importer.on_event = self._count_event
        self.importer.on_pause = self._make_room
        super().__init__(self._group)
        self._deadline = math.inf
        self._events = 0

    def _group(self, kind: str, names: Sequence[str], size: int | None = None) -> VariableGroup:
        body = self.importer.components[BODY]
        references = [body.variables[name].valueReference for name in names]
        return body.instance.group(kind, references, size=size)

    @property
    def hashes(self) -> dict[str, str]:
        """SHA-256 of each component's FMU."""
        return {name: component.sha256 for name, component in self.importer.components.items()}

    @property
    def time(self) -> float:
        """The time reached, s."""
        return self.importer.time

    def begin(self, floats: Mapping[str, float], deadline: float | None) -> None:
        """Start a run at time 0 with these parameters; it may take `deadline` seconds of wall time."""
        self._deadline = math.inf if deadline is None else time.perf_counter() + deadline
        self._events = 0
        self.rows.blocks = []
        values: dict[tuple[str, str], Value] = {(BODY, name): value for name, value in floats.items()}
        for k in range(1, self._stops + 1):
            values[stop_name(k), "restitution"] = floats[f"contact[{k}].restitution"]
        self.importer.begin(0.0, values)

    def advance(self, end: float, slice_length: float = math.inf) -> None:
        """Advance to time `end`, s."""
        while self.importer.time < end:
            size = min(end - self.importer.time, slice_length)
            self.importer.advance(end if size == end - self.importer.time else self.importer.time + size)
            if time.perf_counter() > self._deadline:
                raise DeadlineReached
            self.take_rows()
            if end - self.importer.time <= SAME_INSTANT * (1.0 + abs(end)):
                break

    def _make_room(self) -> None:
        """Empty the record; the body pauses when it is full."""
        self.take_rows()
        if time.perf_counter() > self._deadline:
            raise DeadlineReached

    def _count_event(self, event: Event) -> None:
        self._events += 1
        if self._events % IMPACTS_PER_BLOCK == 0:
            self._make_room()
        if self._events > self._limit:
            raise ImpactLimitReached

    def close(self) -> None:
        """Free the components."""
        self.importer.free()

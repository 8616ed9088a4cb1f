"""A short-form scene with every component its own FMU: the body, and one ImpactStop for each stop (`coupled`).

It has the interface of `fused.BodyDriver`, so a run works with either of the two.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus import fmu_path
from vibroimpact.fmus.core import contact_law, numbered_contact_law
from vibroimpact.fmus.packaging.archive import unpack, value_references
from vibroimpact.orchestrator.fmi.instance import WrapOf
from vibroimpact.orchestrator.fmi.variables import VariableGroup
from vibroimpact.orchestrator.importer.component import Value
from vibroimpact.orchestrator.importer.events import Event, LateEvents
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.specification import ComponentSpec, ConnectionSpec, Exchange
from vibroimpact.orchestrator.run.record import ImpactLimitReached, RecordedBody

#: Events after which the body's record is emptied: an impact writes at most two rows, and there is room for 512.
IMPACTS_PER_BLOCK = 200
BODY = "body"
#: Parameters of a contact port that its stop has, too.
LAW_PARAMETERS = ("position", "restitution", "yield_velocity", "stiffness", "damping", "exponent")
ANSWERS = ("applied_restitution", "applied_force", "applied_stiffness", "applied_damping")


def stop_name(k: int) -> str:
    """Return the name of the component of stop `k` (1-based)."""
    return f"stop{k}"


def connections_of(stops: int) -> list[ConnectionSpec]:
    """Return the connections between a body and its stops."""
    found = []
    for k in range(1, stops + 1):
        port, stop = f"contact[{k}]", stop_name(k)
        found += [
            ConnectionSpec((BODY, f"{port}.{name}"), (stop, name)) for name in ("displacement", "velocity")
        ]
        found += [ConnectionSpec((stop, name), (BODY, f"{port}.{name}")) for name in ANSWERS]
    return found


def body_integers(integers: Mapping[str, int]) -> dict[str, int]:
    """Return a body's integer parameters for stops that are separate FMUs: their laws become external."""
    answers = {"rigid": contact_law("external").number, "yielding": contact_law("external_force").number}

    def law_of(number: int) -> int:
        law = numbered_contact_law(number)
        return number if law.external else answers.get(law.stop, number)

    return {name: law_of(v) if name.endswith("].law") else v for name, v in integers.items()}


def stop_of(k: int, integers: Mapping[str, int], version: str = "3.0") -> ComponentSpec:
    """Return the component of stop `k` (1-based) with its law and side."""
    rigid = contact_law("restitution").number
    law, side = integers.get(f"contact[{k}].law", rigid), integers.get(f"contact[{k}].side", 1)
    given = numbered_contact_law(law)
    own = rigid if given.external or given.stop == "none" else law
    return ComponentSpec(stop_name(k), fmu_path("ImpactStop", version), {"law": own, "side": side})


def stop_parameters(stops: int, floats: Mapping[str, float]) -> dict[tuple[str, str], str]:
    """Return the parameters of the stops, each with the name of the body's parameter that gives its value."""
    known = value_references(unpack(fmu_path("ImpactStop")))
    return {
        (stop_name(k), name): f"contact[{k}].{name}"
        for k in range(1, stops + 1)
        for name in LAW_PARAMETERS
        if f"contact[{k}].{name}" in floats and name in known
    }


class CoupledDriver(RecordedBody):
    """Drives a body and its stops through whole runs.

    `floats` and `integers` are the parameters of `BodyDriver`, with the laws of the stops as in a scene. Each stop gets
    its law, and the body gets external laws instead; laws that are external already stay.

    `macro_step` is the longest communication step, s. `exchange` is the way of exchanging values; contacts do not
    depend on it. `body` names the body's FMU: `Oscillator`, `Chain` or `Beam`. `others` are further components, such as
    a Replay, and `connections` are their connections to the body. `wrap` returns, for a component's name, the wrapper
    of its FMU's functions.
    """

    def __init__(
        self,
        floats: Mapping[str, float],
        integers: Mapping[str, int],
        stops: int,
        *,
        macro_step: float = math.inf,
        exchange: Exchange = "gauss_seidel",
        body: str = "Oscillator",
        others: Sequence[ComponentSpec] = (),
        connections: Sequence[ConnectionSpec] = (),
        wrap: WrapOf | None = None,
    ) -> None:
        self._limit = integers["impact_limit"]
        own = {name: value for name, value in integers.items() if name != "impact_limit"}
        self._stops = [stop_of(k, own) for k in range(1, stops + 1)]
        specs = [ComponentSpec(BODY, fmu_path(body), body_integers(own)), *self._stops, *others]
        joined = [*connections_of(stops), *connections]
        self.importer = Importer(specs, joined, macro_step=macro_step, exchange=exchange, wrap=wrap)
        self.importer.on_event = self._count_event
        self.importer.late_events = LateEvents(self._uncounted, self._count_late)
        self.importer.on_pause = self._make_room
        self._stop_floats = stop_parameters(stops, floats)
        super().__init__(self._group)
        self.importer.watchers.append(self._deadline.watcher)
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
        self._deadline.begin(deadline)
        self._events = 0
        self.rows.blocks = []
        values: dict[tuple[str, str], Value] = {(BODY, name): value for name, value in floats.items()}
        values |= {target: floats[source] for target, source in self._stop_floats.items()}
        log = self.importer.components[BODY].instance.log
        log.take()  # discard messages of the run before
        self.importer.begin(0.0, values)
        self.warnings = log.take()

    def advance(self, end: float) -> None:
        """Advance to time `end`, s."""
        self.importer.advance(end)
        self.take_rows()

    def _make_room(self) -> None:
        """Empty the record and check the deadline, each time the body pauses or a block of events is full."""
        self.take_rows()
        self._deadline.refuse_late()

    def _uncounted(self) -> int:
        """Return the number of events that may pass before the record must be emptied, or the run end."""
        return min(IMPACTS_PER_BLOCK - 1 - self._events % IMPACTS_PER_BLOCK, self._limit - self._events)

    def _count_late(self, events: NDArray[np.float64]) -> None:
        self._events += len(events)

    def _count_event(self, event: Event) -> None:
        self._events += 1
        if self._events % IMPACTS_PER_BLOCK == 0:
            self._make_room()
        if self._events > self._limit:
            raise ImpactLimitReached

    def close(self) -> None:
        """Free the components."""
        self.importer.free()

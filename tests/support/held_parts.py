"""Contacts of foreign masses with compliant stops: coupled, and their energy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from support import fmu_factory
from support.coupled_parts import events_of, part, values
from vibroimpact.orchestrator.importer.component import Value
from vibroimpact.orchestrator.importer.energy import InterfaceEnergy
from vibroimpact.orchestrator.importer.events import Event
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.specification import ComponentSpec, StopContactSpec


class HeldRun(NamedTuple):
    """A foreign mass `b` among stops, initialized, with its energy residual and events."""

    importer: Importer
    energy: InterfaceEnergy
    events: list[Event]

    def motion(self, end: float) -> tuple[float, float]:
        """Advance to `end`, s; return displacement and velocity of the mass."""
        self.importer.advance(end)
        displacement, velocity = values(self.importer, "b", "x", "v")
        return displacement, velocity

    def residual(self) -> float:
        """Return the sum of the residuals of all contacts, J."""
        return float(self.energy.residuals().sum())


def foreign_contact(stop: str = "s", mass: float | None = 1.0, **more: Any) -> StopContactSpec:
    """Return the contact of the mass `b` with a stop."""
    return StopContactSpec("b", "x", "v", "f", stop, mass, **more)


def held(
    folder: Path,
    stops: Sequence[ComponentSpec],
    body: Mapping[str, Value],
    *,
    contacts: Sequence[StopContactSpec] = (),
    states: bool = True,
    version: str = "3.0",
    macro_step: float = 0.1,
    **options: Any,
) -> HeldRun:
    """Return a foreign mass that meets stops, initialized at time 0."""
    fmu = fmu_factory.mass(folder, version, states=states)
    importer = Importer(
        [part("b", fmu, **body), *stops],
        contacts=contacts or [foreign_contact(stop.name) for stop in stops],
        macro_step=macro_step,
        **options,
    )
    energy = InterfaceEnergy(importer, [])
    importer.begin()
    energy.begin([])
    return HeldRun(importer, energy, events_of(importer))

"""Bodies that hit each other: parts of coupled scenes, and their momentum and energy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

from support.coupled_parts import events_of, values
from vibroimpact.fmus import fmu_path
from vibroimpact.orchestrator.importer.component import Value
from vibroimpact.orchestrator.importer.events import Event
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.specification import ComponentSpec, PairSpec

ENERGIES = ("energy.kinetic", "energy.potential")


def hit(name: str, model: str = "Oscillator", version: str = "3.0", **parameters: Value) -> ComponentSpec:
    """Return a body with a contact at port 1 for other bodies; `__` in parameter names stands for `.`."""
    given = {key.replace("__", "."): value for key, value in parameters.items()}
    return ComponentSpec(name, fmu_path(model, version), {"contact[1].law": "pair", **given})


def pair(lower: str, upper: str, restitution: float = 1.0, clearance: float = 0.0, **more: Any) -> PairSpec:
    """Return two bodies that hit each other at their ports 1."""
    ends = (lower, "contact[1]"), (upper, "contact[1]")
    return PairSpec(*ends, clearance=clearance, restitution=restitution, **more)


class PairRun(NamedTuple):
    """Bodies that hit each other, initialized, with their events."""

    importer: Importer
    events: list[Event]

    def at(self, time: float) -> PairRun:
        """Advance to a time, s."""
        self.importer.advance(time)
        return self

    def motion(self, name: str) -> tuple[float, float]:
        """Return displacement and velocity of an Oscillator."""
        displacement, velocity = values(self.importer, name, "displacement", "velocity")
        return displacement, velocity

    def momentum(self) -> float:
        """Return the momentum of all Oscillators, N s."""
        return sum(m * v for m, v in (values(self.importer, name, "mass", "velocity") for name in self.names))

    def energy(self) -> float:
        """Return the kinetic and elastic energy of all bodies, J."""
        return sum(sum(values(self.importer, name, *ENERGIES)) for name in self.names)

    @property
    def names(self) -> Sequence[str]:
        """Return the names of all components."""
        return tuple(self.importer.components)


def run_of(bodies: Sequence[ComponentSpec], pairs: Sequence[PairSpec], **options: Any) -> PairRun:
    """Return bodies that hit each other, initialized at time 0."""
    importer = Importer(bodies, pairs=pairs, **{"macro_step": 0.25, **options})
    run = PairRun(importer, events_of(importer))
    importer.begin()
    return run


def cradle(
    starts: Mapping[int, float], count: int = 5, restitution: float = 1.0, version: str = "3.0"
) -> PairRun:
    """Return Newton's cradle of unit masses that swing in 2 pi s and touch at rest; `starts` are displacements."""
    names = [f"ball{k}" for k in range(count)]
    bodies = [
        hit(name, version=version, displacement_start=starts.get(k, 0.0)) for k, name in enumerate(names)
    ]
    return run_of(bodies, [pair(*ends, restitution) for ends in pairwise(names)])

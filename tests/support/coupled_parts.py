"""Parts of coupled scenes for the tests: bodies, stops and their connections, and a log of the impacts."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from vibroimpact.fmus import fmu_path
from vibroimpact.orchestrator.importer.component import Value
from vibroimpact.orchestrator.importer.events import Event, StepWatcher
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.specification import ComponentSpec, ConnectionSpec

VERSIONS = ("3.0", "2.0")
EXCHANGES = ("gauss_seidel", "jacobi", "iterated")

#: P(1,1) of zeta=.1, angular frequency 1, F=.5, r=.7, stop 1: 40-digit closed form (thesis eqs. 2.48 to 2.66).
P11 = {"damping": 0.2, "forcing.amplitude": 0.5, "forcing.angular_frequency": 1.0}
P11_PHASE, P11_VELOCITY = 0.3665212101960540571, 0.7910497883492130773


def external(position: float, side: str = "upper", k: int = 1) -> dict[str, Value]:
    """Return the parameters of a contact whose impacts another FMU answers."""
    port = f"contact[{k}]"
    return {f"{port}.law": "external", f"{port}.position": position, f"{port}.side": side}


def body(name: str, parameters: Mapping[str, Value], version: str = "3.0") -> ComponentSpec:
    return ComponentSpec(name, fmu_path("Oscillator", version), dict(parameters))


def stop(name: str, restitution: float = 0.7, version: str = "3.0") -> ComponentSpec:
    return ComponentSpec(name, fmu_path("ImpactStop", version), {"restitution": restitution})


def part(name: str, fmu: Path, **parameters: Value) -> ComponentSpec:
    return ComponentSpec(name, fmu, parameters)


def link(source: str, target: str, gain: float = 1.0) -> ConnectionSpec:
    """Connect `component.variable` to `component.variable`."""
    here, there = source.split(".", 1), target.split(".", 1)
    return ConnectionSpec((here[0], here[1]), (there[0], there[1]), gain)


def contact(body_name: str, stop_name: str, k: int = 1) -> list[ConnectionSpec]:
    """Connect a contact of a body with a stop, both ways."""
    port = f"{body_name}.contact[{k}]"
    return [
        link(f"{port}.displacement", f"{stop_name}.displacement"),
        link(f"{port}.velocity", f"{stop_name}.velocity"),
        link(f"{stop_name}.applied_restitution", f"{port}.applied_restitution"),
        link(f"{stop_name}.applied_force", f"{port}.applied_force"),
    ]


def values(importer: Importer, component: str, *names: str) -> list[float]:
    return [float(v) for v in importer.components[component].group("Float64", names).get()]


def events_of(importer: Importer) -> list[Event]:
    """Return a list that grows with the importer's events."""
    found: list[Event] = []
    importer.on_event = found.append
    return found


class Impact(NamedTuple):
    time: float
    phase: float
    velocity: float


class ImpactLog:
    """The impacts of one contact, read after each step; a body meets a stop of another FMU at most once in a step."""

    def __init__(self, importer: Importer, body_name: str, k: int = 1) -> None:
        port = f"contact[{k}]"
        owner = importer.components[body_name]
        self._count = owner.group("Int64", [f"{port}.count"])
        self._last = owner.group("Float64", [f"{port}.last_{name}" for name in Impact._fields])
        self._seen = 0
        self._impacts: list[Impact] = []
        importer.watchers.append(StepWatcher(lambda time: None, self._look))

    def _look(self, time: float, end: float) -> None:
        count = int(self._count.get()[0])
        if count != self._seen:
            assert count == self._seen + 1
            self._seen = count
            self._impacts.append(Impact(*map(float, self._last.get())))

    def take(self) -> list[Impact]:
        """Return all impacts so far."""
        self._look(0.0, 0.0)
        return self._impacts


def phase_error(a: float, b: float) -> float:
    """Return the distance of two phases on the circle, rad."""
    return abs(math.remainder(a - b, 2.0 * math.pi))


def largest_difference(one: Sequence[Impact], other: Sequence[Impact]) -> float:
    """Return the largest difference of times, phases and velocities of two equally long lists of impacts."""
    difference = np.abs(np.array(one) - np.array(other))
    around = 2.0 * math.pi - difference[:, 1]
    difference[:, 1] = np.minimum(difference[:, 1], np.abs(around))
    return float(difference.max())


def bounce_times(
    count: int, restitution: float = 0.7, height: float = 1.0, gravity: float = 9.81
) -> np.ndarray:
    """Return the times of the bounces of a ball that is dropped at time 0, s, shape (count,)."""
    first, n = math.sqrt(2.0 * height / gravity), np.arange(count)
    return first + 2.0 * first * restitution * (1.0 - restitution**n) / (1.0 - restitution)

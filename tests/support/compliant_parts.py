"""Parts of coupled scenes with compliant stops, and plain importers for comparison."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from typing import NamedTuple

from support.coupled_parts import body, link
from vibroimpact.fmus import fmu_path
from vibroimpact.orchestrator.fmi.instance3 import Instance3
from vibroimpact.orchestrator.importer.component import Component, Value
from vibroimpact.orchestrator.importer.energy import InterfaceEnergy
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.specification import ComponentSpec, ConnectionSpec

#: Stops with about the same contact time for a unit mass at 1 m/s.
LAWS: dict[str, dict[str, float]] = {
    "kelvin_voigt": {"stiffness": 1e4, "damping": 20.0},
    "hertz": {"stiffness": 1e6},
    "hunt_crossley": {"stiffness": 1e6, "damping": 0.2, "exponent": 1.5},
}
ANSWERS = ("applied_restitution", "applied_force", "applied_stiffness", "applied_damping")
#: A free unit mass that reaches a stop at 1 m after 1 s, at 1 m/s.
FREE: dict[str, Value] = {"stiffness": 0.0, "velocity_start": 1.0}


def follows(position: float, side: str = "upper", k: int = 1) -> dict[str, Value]:
    """Return the parameters of a contact that follows the force of another FMU."""
    port = f"contact[{k}]"
    return {f"{port}.law": "external_force", f"{port}.position": position, f"{port}.side": side}


def yielding_stop(
    name: str,
    law: str,
    parameters: Mapping[str, float],
    position: float = 1.0,
    side: str = "upper",
    version: str = "3.0",
) -> ComponentSpec:
    """Return an ImpactStop with a force law."""
    own: dict[str, Value] = {"law": law, "position": position, "side": side, **parameters}
    return ComponentSpec(name, fmu_path("ImpactStop", version), own)


def yielding_contact(
    body_name: str, stop_name: str, k: int = 1, *, slopes: bool = True
) -> list[ConnectionSpec]:
    """Connect a contact of a body with a compliant stop, both ways; with its slopes or without."""
    port = f"{body_name}.contact[{k}]"
    answers = ANSWERS if slopes else ANSWERS[:2]
    return [
        *(link(f"{port}.{name}", f"{stop_name}.{name}") for name in ("displacement", "velocity")),
        *(link(f"{stop_name}.{name}", f"{port}.{name}") for name in answers),
    ]


class Coupled(NamedTuple):
    """A body with one compliant stop."""

    importer: Importer
    energy: InterfaceEnergy

    def values(self, *names: str) -> list[float]:
        return [float(v) for v in self.importer.components["b"].group("Float64", names).get()]

    def residual(self) -> float:
        return float(self.energy.residuals().sum())


def coupled(
    law: str,
    parameters: Mapping[str, float],
    start: Mapping[str, Value] = FREE,
    *,
    versions: tuple[str, str] = ("3.0", "3.0"),
    slopes: bool = True,
    position: float = 1.0,
    side: str = "upper",
    **settings: object,
) -> Coupled:
    """Return an initialized importer of body `b` and stop `s`."""
    links = yielding_contact("b", "s", slopes=slopes)
    importer = Importer(
        [
            body("b", {**start, **follows(position, side)}, versions[0]),
            yielding_stop("s", law, parameters, position, side, versions[1]),
        ],
        links,
        **settings,  # type: ignore[arg-type]
    )
    energy = InterfaceEnergy(importer, links)
    importer.begin()
    energy.begin(links)
    return Coupled(importer, energy)


def contact_energy_error(
    law: str, parameters: Mapping[str, float], **settings: object
) -> tuple[float, float]:
    """Return the relative energy error of one elastic contact of a free mass, and the reported residual."""
    run = coupled(law, parameters, **settings)  # type: ignore[arg-type]
    run.importer.advance(2.0)
    (velocity,) = run.values("velocity")
    residual = run.residual()
    run.importer.free()
    return velocity**2 - 1.0, residual / 0.5


def contact_time(law: str, stiffness: float) -> float:
    """Return the duration of an elastic contact of a unit mass at 1 m/s, s: equations.md 6.9 and 6.10."""
    return math.pi / math.sqrt(stiffness) if law == "kelvin_voigt" else 3.218065 / stiffness**0.4


def plain_energy_error(exchange: str, steps: int, stiffness: float = 1e4, law: str = "kelvin_voigt") -> float:
    """Return the relative energy error of one elastic contact with a plain importer of fixed steps."""
    return plain_contact(exchange, steps, stiffness, law)[0]


def plain_contact(exchange: str, steps: int, stiffness: float, law: str) -> tuple[float, float]:
    """Return the relative energy error of one elastic contact with a plain importer, and the seconds of its steps.

    No events, no slopes: the mass has a constant force from the stop over each step, and starts at the surface.
    `jacobi`: both sides have the inputs of the step's start. `gauss_seidel`: the stop has the mass's motion at its end.
    """
    mass = Component(ComponentSpec("mass", fmu_path("Oscillator"), FREE))
    stop = Component(yielding_stop("stop", law, {"stiffness": stiffness}, position=0.0))
    for component in (mass, stop):
        component.begin({}, 0.0, first=True)
        component.instance.exit_initialization()
    assert isinstance(mass.instance, Instance3)
    mass.instance.check(mass.instance.update_call(), "UpdateDiscreteStates")
    mass.instance.check(mass.instance.enter_step_call(), "EnterStepMode")
    motion, force = mass.group("Float64", ["displacement", "velocity"]), mass.group("Float64", ["force"])
    seen, answer = (
        stop.group("Float64", ["displacement", "velocity"]),
        stop.group("Float64", ["applied_force"]),
    )
    size = contact_time(law, stiffness) / steps
    began = time.perf_counter()
    for i in range(3 * steps):
        seen.values[:] = motion.get()
        force.values[0] = -answer.get()[0]
        if exchange == "jacobi":
            seen.set()
        force.set()
        mass.instance.step(i * size, size)
        if exchange == "gauss_seidel":
            seen.values[:] = motion.get()
            seen.set()
        stop.instance.step(i * size, size)
    seconds = time.perf_counter() - began
    velocity = float(motion.get()[1])
    mass.free()
    stop.free()
    return velocity**2 - 1.0, seconds

"""Declared dependencies against the outputs and derivatives that really change when one known is set."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
from support.component_fmu import HERTZ, HUNT_CROSSLEY, KELVIN_VOIGT, LOWER, RESTITUTION
from support.integrated import Integrated

from vibroimpact.fmus import fmu_path
from vibroimpact.fmus.packaging.export import export_fmu

NONE, EXTERNAL, EXTERNAL_FORCE, PAIR = 0, 5, 6, 7
INSIDE = (NONE, RESTITUTION, KELVIN_VOIGT, HERTZ, HUNT_CROSSLEY)
KINDS = {"2.0": "CoSimulation", "3.0": "ModelExchange"}
"""Kind of an instance of each version: laws that another component answers need an importer with events in FMI 3.0."""
LAWS = {"ModelExchange": INSIDE, "CoSimulation": (*INSIDE, EXTERNAL, EXTERNAL_FORCE, PAIR)}
BODIES: dict[str, dict[str, Any]] = {
    "Oscillator": {},
    "Chain": {"masses": 2},
    "Beam": {"modes": 2, "sensors": 1},
    "Structure": {"modes": 2, "model_exchange": True},
}
OTHERS = ("AnalogInput", "Exciter", "Gain", "ImpactStop", "LoadCell", "Noise", "Sensor")
START = {
    "Oscillator": "displacement_start",
    "Chain": "displacement_start[1]",
    "Beam": "modal_displacement_start[1]",
}
EVENT = "applied_impulse"
"""An impulse is taken as an event: what it changes are states."""


def kind_of(it: Integrated, variable: Any) -> str:
    """Return the name of a variable's type in FMI's calls."""
    kinds = {"Real": "Real", "Float64": "Float64", "Boolean": "Boolean"}
    return kinds.get(variable.type, "Int64" if it.new else "Integer")


def values(it: Integrated, variables: Sequence[Any]) -> dict[str, float]:
    """Return the values of variables by name, read by one call for each type."""
    found: dict[str, float] = {}
    for kind in {kind_of(it, variable) for variable in variables}:
        chosen = [variable for variable in variables if kind_of(it, variable) == kind]
        read = getattr(it.fmu, f"get{kind}")([variable.valueReference for variable in chosen])
        found |= {variable.name: float(number) for variable, number in zip(chosen, read, strict=True)}
    return found


def put(it: Integrated, variable: Any, number: float) -> None:
    kind = kind_of(it, variable)
    typed = number if kind in {"Real", "Float64"} else int(number)
    getattr(it.fmu, f"set{kind}")([variable.valueReference], [typed])


def knowns_of(it: Integrated) -> Iterator[Any]:
    """Yield states (in model exchange), inputs and, in FMI 3.0, tunable parameters."""
    if hasattr(it.fmu, "setContinuousStates") and it.description.modelExchange is not None:
        yield from (unknown.variable.derivative for unknown in it.description.derivatives)
    for variable in it.description.modelVariables:
        tunable = it.new and variable.variability == "tunable" and "stop[" not in variable.name
        known = (variable.causality == "input" or tunable) and EVENT not in variable.name
        if known and not variable.dimensions:
            yield variable


def undeclared(it: Integrated) -> set[tuple[str, str]]:
    """Return pairs of an output or derivative and a known that changes it, but is none of its dependencies."""
    structure = [*it.description.outputs, *it.description.derivatives]
    dependencies = {u.variable.name: u.dependencies for u in structure if not u.variable.dimensions}
    unknowns = [unknown.variable for unknown in structure if unknown.variable.name in dependencies]
    found = set()
    for known in knowns_of(it):
        before, now = values(it, unknowns), values(it, [known])[known.name]
        is_real = kind_of(it, known) in {"Real", "Float64"}
        put(it, known, now + 0.25 * (1.0 + abs(now)) if is_real else float(now == 0.0))
        for name, new in values(it, unknowns).items():
            old, listed = before[name], dependencies[name]
            same = math.isclose(new, old, rel_tol=1e-9, abs_tol=1e-9) or (math.isnan(new) and math.isnan(old))
            if not same and name != known.name and listed is not None and known not in listed:
                found.add((name, known.name))
        put(it, known, now)
    return found


@pytest.fixture(scope="module", params=[(body, version) for body in BODIES for version in KINDS])
def body(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str, Path]:
    component, version = request.param
    path = tmp_path_factory.mktemp("body") / f"{component}.fmu"
    options = {"external": True, "contacts": 2, **BODIES[component]}
    return component, version, export_fmu(component, path, fmi=version, **options)


@pytest.mark.parametrize("flies", [True, False])
def test_what_changes_an_output_of_a_body_is_among_its_dependencies(
    body: tuple[str, str, Path], flies: bool
) -> None:
    component, version, path = body
    kind, found = KINDS[version], set()
    for law in (RESTITUTION, *LAWS[kind][-1:]) if flies else LAWS[kind]:
        it = Integrated(component, version, path, kind)
        rigid = law in {RESTITUTION, EXTERNAL, PAIR}
        stop = {"law": law, "stiffness": 500.0, "damping": 0.2, "position": 1.0 if flies else -0.01}
        it.set({f"contact[1].{name}": number for name, number in stop.items()})
        it.set({"forcing.angular_frequency": 3.0, "force[1]" if component == "Chain" else "force": 100.0})
        it.set(
            {
                "contact[2].law": PAIR if kind == "CoSimulation" else RESTITUTION,
                "contact[2].side": LOWER,
                "contact[2].position": -1.0,
            }
        )
        it.set({"contact[1].position": 0.0} if rigid and not flies else {})
        it.set({START[component]: 0.0} if component in START else {})
        it.set({"contact[1].mass_number": 1} if component == "Chain" else {})
        if kind == "ModelExchange":
            it.begin()
        else:
            it.fmu.exitInitializationMode()
            if law == RESTITUTION:
                it.fmu.doStep(0.0, 0.01)  # the body comes to rest
        found |= {(law, *pair) for pair in undeclared(it)}
        it.fmu.freeInstance()
    assert not found


@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("component", OTHERS)
def test_what_changes_another_output_is_among_its_dependencies(component: str, version: str) -> None:
    it = Integrated(component, version, fmu_path(component, version), "CoSimulation")
    if component == "ImpactStop":
        it.set({"law": KELVIN_VOIGT, "stiffness": 10.0, "damping": 0.1, "position": -0.1})
    it.fmu.exitInitializationMode()
    assert not undeclared(it)

"""The coupled components of orbit control: body, stop, controller."""

from __future__ import annotations

import json
from pathlib import Path

from vibroimpact.fmus.core import contact_law
from vibroimpact.fmus.shipped import fmu_path
from vibroimpact.orchestrator.importer.specification import ComponentSpec, ConnectionSpec
from vibroimpact.orchestrator.orbits.control_plan import ControlPlan
from vibroimpact.orchestrator.run.parameters import float_parameters, integer_parameters

SEEN = ("count", "last_time", "last_phase", "last_velocity")
"""Outputs of the contact that feed the controller."""


def coupled(plan: ControlPlan, controller: Path) -> tuple[list[ComponentSpec], list[ConnectionSpec]]:
    """Return the components and connections of a plan, which begin on its first orbit."""
    scene, orbit, settings = plan.scene, plan.orbits[0], plan.settings
    port = f"contact[{int(orbit.contacts[0]) + 1}]"
    numbers: dict[str, float | int | bool | str] = {
        **float_parameters(scene, None),
        **integer_parameters(scene),
    }
    contact, speed = orbit.body.contacts[int(orbit.contacts[0])], float(orbit.velocities[0])
    numbers |= {
        f"{port}.law": contact_law("external").number,
        "forcing.angular_frequency": orbit.body.angular_frequency,
        "forcing.phase": float(orbit.phases[0]),
        "displacement_start": contact.position,
        "velocity_start": -contact.direction * float(contact.restitution_at(speed)) * speed,
    }
    law = {"restitution": contact.restitution, "yield_velocity": contact.yield_velocity}
    stop = {"law": contact_law("restitution").number, **law}
    errors = {"noise": settings.noise, "seed": settings.seed}
    components = [
        ComponentSpec("body", fmu_path("Oscillator"), numbers),
        ComponentSpec("stop", fmu_path("ImpactStop"), stop),
        ComponentSpec("controller", controller, errors),
    ]
    pairs = [
        (f"body.{port}.displacement", "stop.displacement"),
        (f"body.{port}.velocity", "stop.velocity"),
        ("stop.applied_restitution", f"body.{port}.applied_restitution"),
        *((f"body.{port}.{name}", f"controller.{name}") for name in SEEN),
        ("controller.forcing_amplitude", "body.forcing.amplitude"),
        ("controller.forcing_angular_frequency", "body.forcing.angular_frequency"),
    ]
    return components, [ConnectionSpec(_split(source), _split(target)) for source, target in pairs]


def coupled_scene(plan: ControlPlan, controller: str) -> str:
    """Return a scene of the coupled components; `controller` is the name of its FMU beside the scene."""
    components, connections = coupled(plan, Path(controller))
    title = f"{plan.scene.title or Path(plan.scene.source).stem}: an orbit that is kept"
    lines = ["[scene]", f"title = {json.dumps(title)}", f'units = "{plan.scene.units}"', ""]
    files = {"body": "Oscillator", "stop": "ImpactStop", "controller": controller}
    for component in components:
        values = (f"{json.dumps(name)} = {json.dumps(value)}" for name, value in component.parameters.items())
        lines += [
            f"[component.{component.name}]",
            f"fmu = {json.dumps(files[component.name])}",
            f"parameters = {{ {', '.join(values)} }}",
            "",
        ]
    for connection in connections:
        source, target = ".".join(connection.source), ".".join(connection.target)
        lines += ["[[connection]]", f"from = {json.dumps(source)}", f"to = {json.dumps(target)}", ""]
    period = plan.orbits[0].body.period
    seen = [
        *(f"controller.{name}" for name in ("row", "correction", "kept")),
        "body.displacement",
        "body.velocity",
    ]
    lines += [
        "[record]",
        f"recorded_time = {float(4.0 * len(plan.orbits) * plan.settings.periods * plan.orbits[-1].body.period)!r}",
        f"variables = {json.dumps(seen)}",
        "rate = 4",
        "events = true",
        "",
        "[execution]",
        'how = "coupled"',
        f"macro_step = {float(period)!r}",
        "",
    ]
    return "\n".join(lines)


def _split(reference: str) -> tuple[str, str]:
    component, _, variable = reference.partition(".")
    return component, variable

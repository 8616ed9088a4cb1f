"""From the document of a general scene to what the importer is asked, or to all that is wrong in it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vibroimpact.orchestrator.importer.specification import (
    ComponentSpec,
    ConnectionSpec,
    EventSpec,
    PairSpec,
    StopContactSpec,
)
from vibroimpact.orchestrator.scene.component_facts import Misfit, StartValue, swept_value
from vibroimpact.orchestrator.scene.component_models import (
    BodyPair,
    ConnectionTable,
    EventTable,
    GeneralRecord,
    StopContactTable,
)
from vibroimpact.orchestrator.scene.component_numbers import ComponentNumbers, component_variable, contact_key
from vibroimpact.orchestrator.scene.component_sweep import read_general_sweep
from vibroimpact.orchestrator.scene.components import DraftComponent, GeneralDraft
from vibroimpact.orchestrator.scene.models import Execution, Record, TimeSeries
from vibroimpact.orchestrator.scene.problems import Problem
from vibroimpact.orchestrator.scene.rules.components import general_problems
from vibroimpact.orchestrator.scene.rules.contacts import contact_problems, velocity_input
from vibroimpact.orchestrator.scene.rules.pairs import PortPlan, plan_ports
from vibroimpact.orchestrator.scene.rules.steps import step_problems
from vibroimpact.orchestrator.scene.sweep import SweepAxis


def read_general(document: Mapping[str, Any], folder: Path) -> tuple[dict[str, Any], list[Problem]]:
    """Validate a document that has components; as `read_tables`."""
    draft = GeneralDraft(document, folder)
    axes, sweep_problems = read_general_sweep(draft)
    plan = plan_ports(draft)
    problems = [
        *draft.problems,
        *general_problems(draft),
        *contact_problems(draft),
        *plan.problems,
        *step_problems(draft),
        *sweep_problems,
    ]
    if problems:
        return {}, problems
    assert draft.header is not None
    assert draft.record is not None
    assert draft.execution is not None
    return {
        **dict(draft.header),
        **_parts(draft, plan, axes),
        "record": _record(draft.record),
        "sweep": axes,
        "execution": _execution(draft, draft.execution),
    }, []


def _record(record: GeneralRecord) -> Record:
    """Return what is recorded as every scene has it; there are no periods."""
    series = None
    if record.variables:  # names of components and variables are longer than those of one body
        series = TimeSeries.model_construct(rate=record.rate, variables=record.variables)
    return Record(
        transient_time=record.transient_time,
        recorded_time=record.recorded_time,
        impacts=record.events,
        extrema=False,
        strobe=False,
        time_series=series,
    )


def _execution(draft: GeneralDraft, execution: Execution) -> Execution:
    """Return the execution with the guard that it has by default: on as soon as there is foreign code."""
    if "guard" in execution.model_fields_set:
        return execution
    foreign = any(not component.shipped for component in draft.components.values())
    return execution.model_copy(update={"guard": foreign})


def _parts(draft: GeneralDraft, plan: PortPlan, axes: tuple[SweepAxis, ...]) -> dict[str, Any]:
    """Return the parts that a file with components names, with the units and the doubts that their FMUs declare."""
    assert draft.record is not None
    facts = [component.facts for component in draft.components.values() if component.facts]
    components = tuple(_component(component, plan, axes) for component in draft.components.values())
    connections = tuple(_connection(table) for table in draft.connections if table)
    contacts = tuple(_contact(draft, plan, *each, axes) for each in enumerate(draft.contacts))
    numbers = ComponentNumbers(components, connections, contacts).numbers()
    keys = (*draft.record.variables, *(axis.key for axis in axes), *(key for key, _ in numbers))
    return {
        "bodies": components,
        "contacts": contacts,
        "connections": connections,
        "events": tuple(_event(table) for table in draft.events if table),
        "declared_units": {key: draft.unit(key) for key in keys},
        "doubts": tuple(dict.fromkeys(f"{one.file}: {doubt}" for one in facts for doubt in one.doubts)),
        "remarks": {one.file: one.remarks for one in facts if one.remarks},
    }


def _component(component: DraftComponent, plan: PortPlan, axes: tuple[SweepAxis, ...]) -> ComponentSpec:
    assert component.fmu is not None
    ports = plan.parameters.get(component.name, {})
    parameters = {**_first_swept(component, axes), **(component.parameters or {}), **ports}
    return ComponentSpec(component.name, component.fmu, parameters, component.tolerance)


def _first_swept(component: DraftComponent, axes: tuple[SweepAxis, ...]) -> dict[str, StartValue]:
    """Return the first swept value of each swept start value, so that the scene itself can run."""
    assert component.facts is not None
    first: dict[str, StartValue] = {}
    for axis in axes:
        owner, name = component_variable(axis.key)
        if owner == component.name:
            value = swept_value(component.facts.variables[name], axis.values[0])
            assert not isinstance(value, Misfit)
            first[name] = value
    return first


def _connection(table: ConnectionTable) -> ConnectionSpec:
    return ConnectionSpec(
        component_variable(table.source), component_variable(table.target), table.gain, table.gain_unit
    )


def _event(table: EventTable) -> EventSpec:
    return EventSpec(*component_variable(table.watch), table.direction, table.level)


def _contact(
    draft: GeneralDraft,
    plan: PortPlan,
    place: int,
    table: StopContactTable | BodyPair | None,
    axes: tuple[SweepAxis, ...],
) -> StopContactSpec | PairSpec:
    assert table is not None
    if not isinstance(table, StopContactTable):
        return plan.pair(place, table)
    swept = next((axis.values[0] for axis in axes if contact_key(axis.key) == (place, "mass")), None)
    return StopContactSpec(
        body=table.body,
        displacement=table.displacement,
        velocity=table.velocity,
        force=table.force,
        stop=table.stop,
        mass=swept if table.mass is None else table.mass,
        stop_displacement=table.stop_displacement,
        stop_velocity=velocity_input(draft, table),
        stop_force=table.stop_force,
        side=table.side,
    )

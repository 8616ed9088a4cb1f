"""From the document of a general scene to what the importer is asked, or to all that is wrong in it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from vibroimpact.orchestrator.importer.specification import ComponentSpec, ConnectionSpec, EventSpec
from vibroimpact.orchestrator.scene.general.components import DraftComponent, components_of
from vibroimpact.orchestrator.scene.general.models import ConnectionTable, EventTable, GeneralRecord
from vibroimpact.orchestrator.scene.general.rules import GeneralDraft, general_problems, split
from vibroimpact.orchestrator.scene.general.scene import GeneralScene
from vibroimpact.orchestrator.scene.general.start_values import Misfit, StartValue, swept_value
from vibroimpact.orchestrator.scene.general.sweep import read_general_sweep, swept_units, unit_of_key
from vibroimpact.orchestrator.scene.models import Execution, Record, SceneHeader
from vibroimpact.orchestrator.scene.problems import Problem
from vibroimpact.orchestrator.scene.sweep import SweepAxis
from vibroimpact.orchestrator.scene.table_reader import read_array, read_table


@dataclass(frozen=True, slots=True)
class GeneralTables:
    """All tables of a general scene, valid by themselves, together, and against the FMUs."""

    header: SceneHeader
    record: Record
    sweep: tuple[SweepAxis, ...]
    execution: Execution
    general: GeneralScene


def read_general(document: Mapping[str, Any], folder: Path) -> tuple[GeneralTables | None, list[Problem]]:
    """Validate a document that has components.

    Parameters
    ----------
    document : mapping
        A parsed TOML document.
    folder : Path
        The folder of the scene file, from which FMU paths count.

    Returns
    -------
    tables : GeneralTables or None
        None when there is a problem.
    problems : list of Problem
        All of them, in the order of the tables.
    """
    problems: list[Problem] = []
    header = read_table(SceneHeader, document.get("scene", {}), ("scene",), problems)
    draft = GeneralDraft(
        document,
        components_of(document.get("component"), folder, problems),
        read_array(ConnectionTable, document.get("connection", []), "connection", problems),
        read_array(EventTable, document.get("event", []), "event", problems),
        read_table(GeneralRecord, document.get("record", {}), ("record",), problems),
        read_table(Execution, document.get("execution", {}), ("execution",), problems),
    )
    problems += general_problems(draft)
    axes, sweep_problems = read_general_sweep(draft)
    problems += sweep_problems
    if problems or header is None or draft.record is None or draft.execution is None:
        return None, problems
    execution = _execution(draft, draft.execution)
    general = _general(draft, draft.record, execution, axes)
    return GeneralTables(header, _record(draft.record), axes, execution, general), []


def _record(record: GeneralRecord) -> Record:
    """Return the durations as every scene has them; there are no periods."""
    return Record(
        transient_time=record.transient_time,
        recorded_time=record.recorded_time,
        impacts=record.events,
        extrema=False,
        strobe=False,
    )


def _execution(draft: GeneralDraft, execution: Execution) -> Execution:
    """Return the execution with the guard that it has by default: on as soon as there is foreign code."""
    if "guard" in draft.document.get("execution", {}):
        return execution
    foreign = any(not component.shipped for component in draft.components.values())
    return execution.model_copy(update={"guard": foreign})


def _general(
    draft: GeneralDraft, record: GeneralRecord, execution: Execution, axes: tuple[SweepAxis, ...]
) -> GeneralScene:
    recorded = ((name, draft.variable(name)) for name in record.variables)
    units = {name: (variable.unit_name or "1") if variable else "1" for name, variable in recorded}
    general = GeneralScene(
        components=tuple(_component(component, axes) for component in draft.components.values()),
        connections=tuple(_connection(table) for table in draft.connections if table),
        events=tuple(_event(table) for table in draft.events if table),
        variables=record.variables,
        rate=record.rate,
        macro_step=execution.macro_step or record.transient_time + record.recorded_time,
        exchange=execution.exchange,
        guard=execution.guard,
        units={**units, **swept_units(axes, draft)},
    )
    return replace(general, start_units={key: unit_of_key(key, draft) for key, _ in general.numbers()})


def _component(component: DraftComponent, axes: tuple[SweepAxis, ...]) -> ComponentSpec:
    assert component.fmu is not None
    parameters = {**_first_swept(component, axes), **(component.parameters or {})}
    return ComponentSpec(component.name, component.fmu, parameters)


def _first_swept(component: DraftComponent, axes: tuple[SweepAxis, ...]) -> dict[str, StartValue]:
    """Return the first swept value of each swept start value, so that the scene itself can run."""
    assert component.facts is not None
    first: dict[str, StartValue] = {}
    for axis in axes:
        owner, name = split(axis.key)
        if owner == component.name:
            value = swept_value(component.facts.variables[name], axis.values[0])
            assert not isinstance(value, Misfit)
            first[name] = value
    return first


def _connection(table: ConnectionTable) -> ConnectionSpec:
    return ConnectionSpec(split(table.source), split(table.target), table.gain, table.gain_unit)


def _event(table: EventTable) -> EventSpec:
    return EventSpec(*split(table.watch), table.direction, table.level)

"""From a document with components to the input of the importer, or to all its problems."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from pydantic.fields import FieldInfo

from vibroimpact.analysis.dataset.sample_forms import SampleForm
from vibroimpact.orchestrator.importer.specification import (
    ComponentSpec,
    ConnectionSpec,
    EventSpec,
    PairSpec,
    StartValue,
    StopContactSpec,
)
from vibroimpact.orchestrator.scene.array_values import is_structural, sample_form, structural_dimensions
from vibroimpact.orchestrator.scene.component_facts import (
    MODEL_EXCHANGE,
    Misfit,
    swept_value,
)
from vibroimpact.orchestrator.scene.component_models import (
    BodyPair,
    ConnectionTable,
    EventTable,
    GeneralRecord,
    StopContactTable,
)
from vibroimpact.orchestrator.scene.component_numbers import (
    ComponentNumbers,
    component_variable,
    contact_key,
    gain_place,
)
from vibroimpact.orchestrator.scene.components import (
    DraftComponent,
    GeneralDraft,
    settable_names,
    start_problems,
)
from vibroimpact.orchestrator.scene.draft import Reading
from vibroimpact.orchestrator.scene.execution_model import Execution
from vibroimpact.orchestrator.scene.fields import bounds_of, field_of, numeric_keys, rule_of
from vibroimpact.orchestrator.scene.keys import coordinate_name
from vibroimpact.orchestrator.scene.models import Record, TimeSeries
from vibroimpact.orchestrator.scene.problems import Problem, key_path, nearest, quoted
from vibroimpact.orchestrator.scene.rules.components import general_problems, reference_problem
from vibroimpact.orchestrator.scene.rules.contacts import contact_problems, velocity_input
from vibroimpact.orchestrator.scene.rules.mappings import mapped_numbers
from vibroimpact.orchestrator.scene.rules.pairs import PortPlan, plan_ports
from vibroimpact.orchestrator.scene.rules.scene import sweep_problems
from vibroimpact.orchestrator.scene.rules.steps import step_problems
from vibroimpact.orchestrator.scene.sweep import SweepAxis
from vibroimpact.orchestrator.scene.sweep_table import read_sweep


def read_components(document: Mapping[str, Any], folder: Path) -> Reading:
    """Read a document with components; paths of FMU files are relative to `folder`."""
    draft = GeneralDraft(document, folder)
    axes, wrong_axes = _read_sweep(draft)
    plan = plan_ports(draft)
    problems = [
        *general_problems(draft),
        *contact_problems(draft),
        *plan.problems,
        *step_problems(draft),
        *wrong_axes,
    ]
    return Reading(draft, problems, partial(_parts, draft, plan, axes))


def _record(record: GeneralRecord) -> Record:
    """Return the record in the form of all scenes, without periods."""
    series = None
    if record.variables:  # names with components may be longer than the model allows
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
    """Return the execution with its default guard: on if any component is not from the package."""
    if "guard" in execution.model_fields_set:
        return execution
    foreign = any(not component.shipped for component in draft.components.values())
    return execution.model_copy(update={"guard": foreign})


def _parts(draft: GeneralDraft, plan: PortPlan, axes: tuple[SweepAxis, ...]) -> dict[str, Any]:
    """Return the parts of a scene of components, with the declared units and the doubts of their FMUs."""
    assert draft.record is not None
    assert draft.execution is not None
    facts = [component.facts for component in draft.components.values() if component.facts]
    deadline = None if draft.execution is None else draft.execution.deadline
    components = tuple(_component(component, plan, axes, deadline) for component in draft.components.values())
    connections = tuple(_connection(table, draft) for table in draft.connections if table)
    contacts = tuple(_contact(draft, plan, *each, axes) for each in enumerate(draft.contacts))
    numbers = ComponentNumbers(components, connections, contacts).numbers()
    keys = (*draft.record.variables, *(axis.key for axis in axes), *(key for key, _ in numbers))
    return {
        "bodies": components,
        "contacts": contacts,
        "connections": connections,
        "events": tuple(_event(table) for table in draft.events if table),
        "sample_forms": _sample_forms(draft),
        "declared_units": {key: draft.unit(key) for key in keys},
        "doubts": tuple(dict.fromkeys(f"{one.file}: {doubt}" for one in facts for doubt in one.doubts)),
        "remarks": {one.file: one.remarks for one in facts if one.remarks},
        "record": _record(draft.record),
        "start_time": draft.record.start_time,
        "sweep": axes,
        "execution": _execution(draft, draft.execution),
    }


def _sample_forms(draft: GeneralDraft) -> dict[str, SampleForm]:
    """Return the forms of the recorded variables that are no plain numbers."""
    found: dict[str, SampleForm] = {}
    for reference in draft.record.variables if draft.record else ():
        variable = draft.variable(reference)
        form = variable and sample_form(variable, draft.shape(reference))
        if form:
            found[reference] = form
    return found


def _component(
    component: DraftComponent, plan: PortPlan, axes: tuple[SweepAxis, ...], deadline: float | None
) -> ComponentSpec:
    assert component.fmu is not None
    ports = plan.parameters.get(component.name, {})
    parameters = {**_first_swept(component, axes), **(component.parameters or {}), **ports}
    facts = component.facts
    if facts is None or facts.kind != MODEL_EXCHANGE:
        server = component.server
        if server is not None and deadline is not None:
            server = replace(server, seconds=deadline)
        return ComponentSpec(component.name, component.fmu, parameters, component.tolerance, server=server)
    tolerance = component.tolerance or facts.capabilities.tolerance
    return ComponentSpec(component.name, component.fmu, parameters, tolerance, MODEL_EXCHANGE)


def _first_swept(component: DraftComponent, axes: tuple[SweepAxis, ...]) -> dict[str, StartValue]:
    """Return the first value of each swept start value, so that the scene itself can run."""
    assert component.facts is not None
    first: dict[str, StartValue] = {}
    for axis in axes:
        owner, name = component_variable(axis.key)
        if owner == component.name:
            value = swept_value(component.facts.variables[name], axis.values[0])
            assert not isinstance(value, Misfit)
            first[name] = value
    return first


def _connection(table: ConnectionTable, draft: GeneralDraft) -> ConnectionSpec:
    return ConnectionSpec(
        component_variable(table.source),
        component_variable(table.target),
        table.gain,
        table.gain_unit,
        table.offset,
        mapped_numbers(table, draft),
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


# ---- the sweep: start values, gains of connections, numbers of contacts ----


def _read_sweep(draft: GeneralDraft) -> tuple[tuple[SweepAxis, ...], list[Problem]]:
    """Return the valid axes of a scene of components, and the problems of all other axes and between axes."""
    axes, problems = read_sweep(
        draft.document,
        lambda key, entry: _key_problems(key, entry, draft),
        lambda axis: _axis_problems(axis, draft),
    )
    return axes, [*problems, *sweep_problems(axes), *_names_differ(axes), *_events_tell_motions(axes, draft)]


def _events_tell_motions(axes: Sequence[SweepAxis], draft: GeneralDraft) -> Iterator[Problem]:
    is_adaptive = any(axis.adaptive is not None for axis in axes)
    if is_adaptive and draft.record is not None and not draft.record.events:
        hint = "Without them nothing but outcomes is compared."
        yield Problem("record.events", "true beside an adaptive axis", "false", hint)


def _key_problems(key: str, entry: object, draft: GeneralDraft) -> Iterator[Problem]:
    where = key_path(("sweep", key))
    hint = _quotes_hint(key, entry, draft)
    if hint:
        yield Problem(where, "a start value or a gain of this scene", quoted(key), hint)
    elif draft.names_step(key):
        return
    elif _names_an_entry(key, "connection", draft):
        yield from _gain_problems(key, where, draft)
    elif _names_an_entry(key, "contact", draft):
        yield from _contact_key_problems(key, where, draft)
    else:
        yield from _start_value_problems(key, where, draft)


def _names_an_entry(key: str, name: str, draft: GeneralDraft) -> bool:
    table = component_variable(key)[0]
    return table.partition("[")[0] == name and table not in draft.components


def _quotes_hint(key: str, entry: Any, draft: GeneralDraft) -> str:
    """Return the advice for a dotted key without quotes, which TOML reads as nested tables."""
    if "." in key or key not in draft.components or not isinstance(entry, dict) or not entry:
        return ""
    words = [key]
    while isinstance(entry, dict) and len(entry) == 1:
        word, entry = next(iter(entry.items()))
        words += [] if word == "values" else [word]
    return f"Put the whole key in quotes: {quoted('.'.join(words))}." if len(words) > 1 else ""


def _gain_problems(key: str, where: str, draft: GeneralDraft) -> Iterator[Problem]:
    place, count = gain_place(key), len(draft.connections)
    if place is None or place >= count:
        has = f"Indices start at 1 and this scene has {count} [[connection]]"
        hint = f'{has}: for example "connection[1].gain".'
        yield Problem(where, "the gain of a connection", quoted(key), hint)
        return
    connection = draft.connections[place]
    source = draft.variable(connection.source) if connection else None
    if source and source.kind != "real":
        got = f"one between {source.type} variables"
        yield Problem(where, "the gain of a connection of real numbers", got)


def _contact_key_problems(key: str, where: str, draft: GeneralDraft) -> Iterator[Problem]:
    named, count = contact_key(key), len(draft.contacts)
    if named is None or named[0] >= count:
        hint = f"Indices start at 1 and this scene has {count} [[contact]]."
        yield Problem(where, "a number of a contact", quoted(key), hint)
        return
    place, name = named
    table = draft.contacts[place]
    if table is not None and name not in (known := list(numeric_keys(type(table)))):
        near = partial(nearest, name, known, f"contact[{place + 1}].")
        yield Problem(where, "a number of this contact", quoted(key), near)


def _start_value_problems(key: str, where: str, draft: GeneralDraft) -> Iterator[Problem]:
    problem = reference_problem(draft, where, key)
    facts, variable = draft.facts(key), draft.variable(key)
    if problem:
        component, name = component_variable(key)
        near = (
            partial(nearest, name, settable_names(facts), f"{component}.") if facts and name else problem.hint
        )
        yield Problem(where, problem.expected, problem.got, near)
    elif variable:
        found = list(start_problems(variable, where))
        yield from found
        if not found and (variable.kind in ("boolean", "text") or not variable.scalar):
            yield Problem(where, "a number", f"the {variable.shape} {key}", "Run a scene for each value.")
        elif not found and is_structural(variable):
            yield from _size_problems(key, where, draft)


def _size_problems(key: str, where: str, draft: GeneralDraft) -> Iterator[Problem]:
    """Yield the problem of a swept size of an array that the scene uses: all points have one dataset."""
    component, size = component_variable(key)
    ends = [end for table in draft.connections if table for end in (table.source, table.target)]
    recorded = draft.record.variables if draft.record else ()
    given = draft.components[component].parameters or {}
    for reference in (*recorded, *ends, *(f"{component}.{name}" for name in given)):
        variable = draft.variable(reference)
        if (
            variable
            and component_variable(reference)[0] == component
            and size in structural_dimensions(variable)
        ):
            hint = "Run a scene for each value."
            yield Problem(where, "a size of no array that this scene uses", f"that of {reference}", hint)
            return


def _axis_problems(axis: SweepAxis, draft: GeneralDraft) -> Iterator[Problem]:
    if axis.continuation:
        where = key_path(("sweep", axis.key, "path"))
        hint = "What a general scene carries from point to point is not known: every point starts anew."
        yield Problem(where, '"independent" in a general scene', quoted(axis.path), hint)
        return
    if draft.names_step(axis.key):
        yield from _number_problems(axis, field_of(Execution, "macro_step"))
        return
    variable = draft.variable(axis.key)
    if variable is None:
        yield from _contact_values(axis, draft)
        return
    for value in axis.values:
        fitted = swept_value(variable, value)
        if isinstance(fitted, Misfit):
            yield Problem(key_path(("sweep", axis.key)), fitted.expected, quoted(value), fitted.hint)
            return


def _contact_values(axis: SweepAxis, draft: GeneralDraft) -> Iterator[Problem]:
    named = contact_key(axis.key)
    table = None if named is None else draft.contacts[named[0]]
    if named is None or table is None or named[1] not in type(table).model_fields:
        return
    yield from _number_problems(axis, field_of(type(table), named[1]))


def _number_problems(axis: SweepAxis, field: FieldInfo) -> Iterator[Problem]:
    rule, (low, high, is_open) = rule_of(field), bounds_of(field)
    for value in axis.bounding:
        if not low <= value <= high or (is_open and value == low):
            yield Problem(key_path(("sweep", axis.key)), rule.expected, quoted(value), rule.hint)
            return


def _names_differ(axes: tuple[SweepAxis, ...]) -> Iterator[Problem]:
    keys = [axis.key for axis in axes]
    named: dict[str, str] = {}
    for key in keys:
        name = coordinate_name(key, keys)
        other = named.setdefault(name, key)
        if other != key:
            hint = f"Both would be the coordinate {name} of the dataset: rename a component."
            yield Problem(key_path(("sweep", key)), f"a name of its own beside {other}", quoted(key), hint)

"""Rules of a general scene against the model descriptions of its FMUs.

Each rule yields its problems and checks only parts that are valid by themselves. The variables of an unreadable FMU
are therefore not checked.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial

from vibroimpact.fmus.units import (
    Unit,
    agree,
    conversion,
    converts,
    gain_unit_between,
    parse_unit,
    product_agrees,
)
from vibroimpact.orchestrator.scene.array_values import MOST_ELEMENTS, shape_words
from vibroimpact.orchestrator.scene.component_facts import (
    MODEL_EXCHANGE,
    NUMERIC_KINDS,
    VariableFacts,
)
from vibroimpact.orchestrator.scene.component_models import (
    ConnectionTable,
)
from vibroimpact.orchestrator.scene.component_numbers import (
    STEP_KEY,
    component_variable,
)
from vibroimpact.orchestrator.scene.components import GeneralDraft, not_restorable
from vibroimpact.orchestrator.scene.keys import dataset_name
from vibroimpact.orchestrator.scene.problems import Problem, key_path, nearest, quoted
from vibroimpact.orchestrator.scene.rules.mappings import mapping_problems
from vibroimpact.orchestrator.scene.rules.scene import sample_problems

MOST_STEPS_PER_RUN = 10**10
#: Inputs of a body's contact port through which another component answers its contact.
ANSWERS = ("applied_restitution", "applied_force")
PORT = "contact["
"""Beginning of the variables of a contact: its energy is computed without offsets."""
SOURCES = ("output", "local", "parameter", "calculatedParameter")
RECORDED_KINDS = (*NUMERIC_KINDS, "text")
_NUMBERED = {"integer", "enumeration"}
"""Kinds that feed one another: an item of an enumeration is passed on as its number."""


def general_problems(draft: GeneralDraft) -> list[Problem]:
    """Return all problems between the tables of a general scene and its FMUs."""
    rules = (
        _connections_join_what_there_is,
        _inputs_have_one_source,
        _events_watch_what_there_is,
        _records_what_there_is,
        _samples_fit,
        _runs_coupled,
        _exchange_has_a_step,
    )
    return [problem for rule in rules for problem in rule(draft)]


def reference_problem(draft: GeneralDraft, where: str, reference: str) -> Problem | None:
    """Return the problem of `COMPONENT.VARIABLE` if it names nothing in this scene; else None."""
    component, variable = component_variable(reference)
    if not draft.components:
        return None  # a scene without components has only that problem
    if not variable:
        hint = 'For example "ball.h"; the component ends at the first dot.'
        return Problem(where, "a variable COMPONENT.VARIABLE", quoted(reference), hint)
    if component not in draft.components:
        near = partial(nearest, component, draft.components)
        return Problem(where, "a component of this scene before the first dot", quoted(reference), near)
    facts = draft.facts(reference)
    if facts is None or variable in facts.variables:
        return None
    near = partial(nearest, variable, facts.variables, f"{component}.")
    return Problem(where, f"a variable of {facts.file} after {component}.", quoted(reference), near)


def _connections_join_what_there_is(draft: GeneralDraft) -> Iterator[Problem]:
    for place, connection in enumerate(draft.connections):
        if connection is None:
            continue
        ends = {"from": connection.source, "to": connection.target}
        wrong = [_end_problem(draft, place, end, reference) for end, reference in ends.items()]
        yield from (problem for problem in wrong if problem)
        gain, gain_problem = _gain_unit(connection, place)
        yield from gain_problem
        source, target = draft.variable(connection.source), draft.variable(connection.target)
        if source and target and not any(wrong):
            yield from _shape_problems(draft, connection, place)
            yield from _type_problems(connection, place, source, target)
            if not gain_problem and not _is_without_units(draft, source, target):
                yield from _unit_problems(connection, place, gain, source, target)


def _is_without_units(draft: GeneralDraft, source: VariableFacts, target: VariableFacts) -> bool:
    """Return whether both ends are plain numbers: in a nondimensional scene, except two scales of a unit (m, mm)."""
    if not draft.is_nondimensional:
        return False
    return source.unit is None or target.unit is None or source.unit.exponents != target.unit.exponents


def _end_problem(draft: GeneralDraft, place: int, end: str, reference: str) -> Problem | None:
    where = key_path(("connection", place, end))
    problem = reference_problem(draft, where, reference)
    variable = draft.variable(reference)
    if problem or variable is None:
        return problem
    got = f"the {variable.causality} {reference}"
    if end == "to" and not variable.fed:
        hint = "Start values go into the parameters of the component."
        expected = "an input or a tunable parameter"
        return Problem(where, expected, got, hint if variable.causality == "parameter" else "")
    if end == "from" and variable.causality not in SOURCES:
        is_input = variable.causality == "input"
        hint = "Connect the output that feeds it." if is_input else ""
        return Problem(where, "an output, a local variable or a parameter", got, hint)
    if variable.kind == "clock":
        return _clock_problem(draft, where, end, reference)
    if variable.kind not in NUMERIC_KINDS:
        return Problem(where, "numbers, or true or false", f"the {variable.shape} {reference}")
    return _size_problem(draft, where, reference)


def _size_problem(draft: GeneralDraft, where: str, reference: str) -> Problem | None:
    """Return the problem of an array of too many elements, or of none."""
    shape = draft.shape(reference)
    if 0 < math.prod(shape) <= MOST_ELEMENTS:
        return None
    return Problem(
        where, f"an array of 1 to {MOST_ELEMENTS} elements", f"{reference} of {shape_words(shape)}"
    )


def _clock_problem(draft: GeneralDraft, where: str, end: str, reference: str) -> Problem | None:
    """Return the problem of a clock in a connection: an output clock triggers input clocks that no time triggers."""
    facts = draft.facts(reference)
    clocks = facts.capabilities.clocks if facts else ()
    found = next((clock for clock in clocks if clock.name == component_variable(reference)[1]), None)
    if found is None or (not found.is_timed and found.is_input == (end == "to")):
        return None  # a clock without ticks is a problem of its FMU
    expected = "an output clock" if end == "from" else "a triggered input clock"
    return Problem(where, expected, f"the {found.variability} clock {reference}")


def _gain_unit(connection: ConnectionTable, place: int) -> tuple[Unit | None, list[Problem]]:
    if connection.gain_unit is None:
        return None, []
    unit = parse_unit(connection.gain_unit)
    if unit:
        return unit, []
    where = key_path(("connection", place, "gain_unit"))
    hint = "Join symbols by dots, write exponents directly behind them, divide by one symbol or parenthesis."
    expected = 'a product of SI units such as "N.s/m", "kg.m2/s2" or "1"'
    return None, [Problem(where, expected, quoted(connection.gain_unit), hint)]


def _shape_problems(draft: GeneralDraft, connection: ConnectionTable, place: int) -> Iterator[Problem]:
    ends = connection.source, connection.target
    shapes = [draft.shape(end) for end in ends]
    if shapes[0] != shapes[1]:
        got = " to ".join(f"{shape_words(shape)} ({end})" for shape, end in zip(shapes, ends, strict=True))
        yield Problem(key_path(("connection", place)), "two variables of one shape", got)


def _type_problems(
    connection: ConnectionTable, place: int, source: VariableFacts, target: VariableFacts
) -> Iterator[Problem]:
    where = key_path(("connection", place))
    if connection.mapping:
        yield from mapping_problems(connection, f"{where}.mapping", source, target)
        return
    if source.kind != target.kind and not {source.kind, target.kind} <= _NUMBERED:
        got = f"{source.type} ({connection.source}) to {target.type} ({connection.target})"
        yield Problem(where, "two variables of one type", got)
    elif source.kind != "real" and connection.gain != 1.0:
        got = f"{quoted(connection.gain)} between {source.type} variables"
        yield Problem(f"{where}.gain", "a gain between real numbers only", got, "Remove gain.")
    if connection.offset == 0.0:
        return
    if source.kind != "real" or target.kind != "real":
        got = f"{quoted(connection.offset)} between {source.type} variables"
        yield Problem(f"{where}.offset", "an offset between real numbers only", got, "Remove offset.")
    ends = (connection.source, connection.target)
    ports = [end for end in ends if component_variable(end)[1].startswith(PORT)]
    if ports:
        hint = "Give the position of the contact instead."
        yield Problem(f"{where}.offset", "none at a contact", f"one at {ports[0]}", hint)


def _unit_problems(
    connection: ConnectionTable, place: int, gain: Unit | None, source: VariableFacts, target: VariableFacts
) -> Iterator[Problem]:
    if source.unit is None or target.unit is None:
        return
    ends = f"{source.unit_name} ({connection.source})", f"{target.unit_name} ({connection.target})"
    suggested = gain_unit_between(source.unit, target.unit)
    hint = f'Give the gain with its unit: gain_unit = "{suggested}".' if suggested else ""
    where = key_path(("connection", place))
    if gain is None:
        same = agree(source.unit, target.unit)
        if not same and not converts(connection.gain, connection.offset, source.unit, target.unit):
            got = f"{ends[0]} to {ends[1]}"
            yield Problem(
                where, "the same unit at both ends", got, hint or _conversion_hint(source.unit, target.unit)
            )
    elif not _is_product(connection, source.unit, gain, target.unit):
        expected = f"a unit that turns {ends[0]} into {ends[1]}"
        yield Problem(f"{where}.gain_unit", expected, quoted(connection.gain_unit), hint)


def _is_product(connection: ConnectionTable, source: Unit, gain: Unit, target: Unit) -> bool:
    """Return whether source times gain is target; a unit with a shifted zero counts as that of its differences.

    It has products only beside an offset, which says that the zeros were thought of.
    """
    if (source.offset or target.offset) and connection.offset == 0.0:
        return False
    return product_agrees(source.difference, gain, target.difference)


def _conversion_hint(source: Unit, target: Unit) -> str:
    if source.exponents != target.exponents:
        return ""
    factor, offset = conversion(source, target)
    return f"Convert it: gain = {factor!r}, offset = {offset!r}."


def _inputs_have_one_source(draft: GeneralDraft) -> Iterator[Problem]:
    first: dict[tuple[str, int], int] = {}
    for place, connection in enumerate(draft.connections):
        variable = draft.variable(connection.target) if connection else None
        if connection is None or variable is None or not variable.fed:
            continue
        # aliases of one variable are one input
        other = first.setdefault((component_variable(connection.target)[0], variable.reference), place)
        if other != place:
            where = key_path(("connection", place, "to"))
            got = f"{quoted(connection.target)}, which connection[{other + 1}] feeds already"
            yield Problem(where, "an input of its own for each connection", got, "Remove one of them.")


def _events_watch_what_there_is(draft: GeneralDraft) -> Iterator[Problem]:
    for place, event in enumerate(draft.events):
        if event is None:
            continue
        where = key_path(("event", place, "watch"))
        problem = reference_problem(draft, where, event.watch)
        variable, facts = draft.variable(event.watch), draft.facts(event.watch)
        if problem:
            yield problem
        if variable is None or facts is None:
            continue
        if variable.kind != "real" or variable.variability != "continuous" or not variable.scalar:
            got = f"the {variable.variability} {variable.type} {event.watch}"
            yield Problem(where, "a continuous real number", got, "A crossing needs values on both sides.")
        if not facts.restorable and facts.kind != MODEL_EXCHANGE:
            hint = "A crossing is found by going back to the state before the step."
            yield not_restorable(facts, where, hint)
        force = _contact_answer(draft, component_variable(event.watch)[0])
        if facts.event_mode and force is not None:
            hint = (
                "A watched component runs without event mode and early return, which a contact with another "
                "component needs. Watch a component that takes no part in a contact."
            )
            yield Problem(where, "a component without a contact", f"one that {force} answers", hint)


def _contact_answer(draft: GeneralDraft, component: str) -> str | None:
    """Return the output that answers a contact of this component; None without one."""
    for connection in draft.connections:
        if connection is None or component_variable(connection.target)[0] != component:
            continue
        port, _, answer = component_variable(connection.target)[1].rpartition(".")
        facts = draft.facts(connection.target)
        if answer in ANSWERS and facts is not None and f"{port}.law" in facts.variables:
            return connection.source
    return None


def _records_what_there_is(draft: GeneralDraft) -> Iterator[Problem]:
    record = draft.record
    if record is None:
        return
    for place, reference in enumerate(record.variables):
        where = key_path(("record", "variables", place))
        problem = reference_problem(draft, where, reference)
        variable = draft.variable(reference)
        if problem:
            yield problem
        elif dataset_name(reference) in map(dataset_name, record.variables[:place]):
            hint = f"It would be a second {dataset_name(reference)} in the dataset."
            yield Problem(where, "each variable once", quoted(reference), hint)
        elif variable and variable.kind not in RECORDED_KINDS:
            hint = "It is passed to no dataset in this version: take it out."
            yield Problem(
                where, "numbers, true or false, or texts", f"the {variable.shape} {reference}", hint
            )
        elif variable and (problem := _size_problem(draft, where, reference)):
            yield problem
    if record.variables and record.rate is None:
        hint = "Add rate = ... to [record]: samples per unit of time."
        yield Problem("record.rate", "a number > 0 beside variables", "nothing", hint)
    if record.rate is not None and not record.variables:
        hint = 'Add variables = ["COMPONENT.VARIABLE"] to [record], or remove rate.'
        yield Problem("record.variables", "variables beside a rate", "none", hint)


def _samples_fit(draft: GeneralDraft) -> Iterator[Problem]:
    if draft.record and draft.record.rate is not None:
        known = [name for name in draft.record.variables if draft.variable(name)]
        elements = max((math.prod(draft.shape(name)) for name in known), default=1)
        samples = draft.record.rate * draft.record.recorded_time * elements
        yield from sample_problems("record.rate", samples, "time")


def _runs_coupled(draft: GeneralDraft) -> Iterator[Problem]:
    if draft.execution and draft.execution.contact_tolerance is not None:
        hint = "Give it to the component: parameters = { contact_tolerance = 1e-8 }."
        got = quoted(draft.execution.contact_tolerance)
        yield Problem("execution.contact_tolerance", "no contact_tolerance in a general scene", got, hint)
    if draft.execution and draft.execution.how == "fused":
        hint = "Only the short form ([body] and [[stop]]) runs fused."
        yield Problem("execution.how", '"auto" or "coupled" in a general scene', '"fused"', hint)


def _exchange_has_a_step(draft: GeneralDraft) -> Iterator[Problem]:
    if draft.execution is None:
        return
    swept = draft.swept_steps()
    if draft.execution.adapts:
        if swept:
            yield Problem(STEP_KEY, "a number where it is swept", '"auto"', "Remove it, or its sweep.")
        return
    if draft.execution.coupling_tolerance is not None:
        got = quoted(draft.execution.coupling_tolerance)
        yield Problem("execution.coupling_tolerance", 'macro_step = "auto" beside it', got)
    step = min(swept) if swept else draft.execution.fixed_step
    if step is None:
        if draft.connections or draft.contacts:
            hint = "Add macro_step = ... to [execution]: the time between two exchanges of values."
            expected = "a number > 0 where components are connected"
            yield Problem("execution.macro_step", expected, "nothing", hint)
    elif draft.record:
        steps = (draft.record.transient_time + draft.record.recorded_time) / step
        if steps > MOST_STEPS_PER_RUN:
            expected = f"at most {MOST_STEPS_PER_RUN} steps per run"
            yield Problem("execution.macro_step", expected, f"{steps:.3g}", "Make it longer.")

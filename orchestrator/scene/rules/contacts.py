"""Rules of the contacts of a general scene: `[[contact]]` tables against the model descriptions of their components."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from vibroimpact.fmus.core.contact_laws import contact_law, rigid_law_numbers
from vibroimpact.fmus.units import Unit, agree, parse_unit
from vibroimpact.orchestrator.scene.component_facts import (
    CO_SIMULATION,
    MODEL_EXCHANGE,
    ComponentFacts,
    VariableFacts,
)
from vibroimpact.orchestrator.scene.component_models import StopContactTable
from vibroimpact.orchestrator.scene.component_numbers import component_variable, contact_key
from vibroimpact.orchestrator.scene.components import GeneralDraft, not_restorable
from vibroimpact.orchestrator.scene.problems import Problem, key_path, nearest, quoted

#: Variables of a stop for its law and its side.
LAW, SIDE = "law", "side"
VELOCITY = "velocity"
SIDES = {"upper": 1, "lower": 2}


def contact_problems(draft: GeneralDraft) -> list[Problem]:
    """Return all problems of the contacts of a general scene."""
    exchanged = [*_laws_are_co_simulation(draft)]
    if exchanged:
        return exchanged
    rules = (
        *(_variables_are_there, _stops_answer_with_a_force, _bodies_take_impacts),
        *(_bodies_say_their_mass, _inputs_are_free),
    )
    return [
        problem
        for place, table in enumerate(draft.contacts)
        if isinstance(table, StopContactTable)
        for rule in rules
        for problem in rule(draft, place, table)
    ]


def _laws_are_co_simulation(draft: GeneralDraft) -> Iterator[Problem]:
    """Yield a problem for each stop, and each contact port, that runs as model exchange."""
    for place, table in enumerate(draft.contacts):
        if table is None:
            continue
        if isinstance(table, StopContactTable):
            named = [("stop", table.stop)]
        else:
            named = [("between", name) for name in table.between if name not in table.bodies]
        for key, name in named:
            facts = _facts(draft, component_variable(name)[0])
            if facts is not None and facts.kind == MODEL_EXCHANGE:
                hint = (
                    'Write run_as = "co_simulation".'
                    if CO_SIMULATION in facts.kinds
                    else "A body of another tool is named in bodies; a stop is an FMU for co-simulation."
                )
                where = key_path(("contact", place, key))
                yield Problem(
                    where, "a component that runs as co-simulation", f"{name} in model exchange", hint
                )


def velocity_input(draft: GeneralDraft, table: StopContactTable) -> str | None:
    """Return the stop's input for the velocity; None where it has no such input."""
    if table.stop_velocity is not None:
        return table.stop_velocity
    facts = _facts(draft, table.stop)
    return VELOCITY if facts is not None and VELOCITY in facts.variables else None


def _facts(draft: GeneralDraft, component: str) -> ComponentFacts | None:
    found = draft.components.get(component)
    return found.facts if found else None


def _variables_are_there(draft: GeneralDraft, place: int, table: StopContactTable) -> Iterator[Problem]:
    for key in ("body", "stop"):
        yield from _component_problems(draft, place, key, getattr(table, key))
    if table.body == table.stop:
        yield Problem(
            key_path(("contact", place, "stop")), "a component other than the body", quoted(table.stop)
        )
        return
    metre, speed, newton = map(parse_unit, ("m", "m/s", "N"))
    named = (
        ("body", "displacement", table.displacement, "output", metre),
        ("body", VELOCITY, table.velocity, "output", speed),
        ("body", "force", table.force, "input", newton),
        ("stop", "stop_displacement", table.stop_displacement, "input", metre),
        ("stop", "stop_velocity", velocity_input(draft, table), "input", speed),
        ("stop", "stop_force", table.stop_force, "output", newton),
    )
    for owner, key, name, causality, unit in named:
        component = getattr(table, owner)
        facts = _facts(draft, component)
        if facts is not None and name is not None:
            where = key_path(("contact", place, key))
            yield from variable_problems(
                where, component, facts, name, causality, None if draft.is_nondimensional else unit
            )


def _component_problems(draft: GeneralDraft, place: int, key: str, name: str) -> Iterator[Problem]:
    if draft.components and name not in draft.components:
        where = key_path(("contact", place, key))
        near = partial(nearest, name, draft.components)
        yield Problem(where, "a component of this scene", quoted(name), near)


def variable_problems(
    where: str, component: str, facts: ComponentFacts, name: str, causality: str, unit: Unit | None
) -> Iterator[Problem]:
    """Yield the problem of a variable that is missing, has another causality, or has another unit."""
    variable = facts.variables.get(name)
    article = f"{'an' if causality[0] in 'io' else 'a'} {causality}"
    if variable is None:
        near = partial(nearest, name, _of_causality(facts, causality))
        yield Problem(where, f"{article} of {facts.file}", quoted(name), near)
    elif not _fits(variable, causality):
        got = f"the {variable.causality} {component}.{name} ({variable.shape})"
        yield Problem(where, f"{article} that is one real number", got)
    elif unit is not None and variable.unit is not None and not agree(variable.unit, unit):
        got = f"{variable.unit_name} ({component}.{name})"
        yield Problem(where, f"a variable in {unit.name}", got, "Contacts take SI units only.")


def _of_causality(facts: ComponentFacts, causality: str) -> list[str]:
    return [name for name, variable in facts.variables.items() if _fits(variable, causality)]


def _fits(variable: VariableFacts, causality: str) -> bool:
    allowed = ("output", "local") if causality == "output" else (causality,)
    return variable.causality in allowed and variable.type in ("Real", "Float64") and variable.scalar


def _stops_answer_with_a_force(draft: GeneralDraft, place: int, table: StopContactTable) -> Iterator[Problem]:
    facts = _facts(draft, table.stop)
    if facts is None:
        return
    where = key_path(("contact", place, "stop"))
    if not facts.restorable:
        hint = (
            "A stop is asked for its force along the way of the body. Use an ImpactStop, or connect this one by "
            "[[connection]] with a small macro_step."
        )
        yield not_restorable(facts, where, hint)
    body = _facts(draft, table.body)
    limited = body is not None and not body.restorable and body.kind != MODEL_EXCHANGE
    if body is not None and limited and _is_rigid(draft, table, facts):
        hint = (
            f"{body.file} does not have canGetAndSetFMUState, which rigid impacts need: parameters = "
            '{ law = "kelvin_voigt", stiffness = ..., damping = ... }, hertz or hunt_crossley.'
        )
        yield Problem(where, "a stop that yields", f"{table.stop} with the law restitution", hint)
    own = _says_its_side(facts)
    if own and table.side is not None:
        hint = f"Give it to the component: parameters = {{ side = {quoted(table.side)} }}."
        where = key_path(("contact", place, SIDE))
        yield Problem(where, "no side beside a stop that has a parameter side", quoted(table.side), hint)
    elif not own and table.side is None:
        hint = 'Use "upper" for a stop above the body, "lower" for one below it.'
        yield Problem(key_path(("contact", place, SIDE)), '"upper" or "lower"', "nothing", hint)


def _bodies_take_impacts(draft: GeneralDraft, place: int, table: StopContactTable) -> Iterator[Problem]:
    """A body in model exchange takes rigid impacts without a force input or a state that can be kept, others none."""
    body, stop = _facts(draft, table.body), _facts(draft, table.stop)
    if body is None or stop is None:
        return
    if body.kind != MODEL_EXCHANGE:
        if table.force is None:
            hint = "Only a body in model exchange does without: its velocity is a continuous state."
            where = key_path(("contact", place, "force"))
            yield Problem(where, "the name of an input of the body: the force on that point", "nothing", hint)
        return
    lacks = "force" if table.force is None else "" if body.restorable else "canGetAndSetFMUState"
    gives_law = table.force is not None and LAW in stop.variables and "applied_restitution" in stop.variables
    if lacks and not gives_law and not _is_rigid(draft, table, stop) and not _sweeps_law(draft, table):
        got = f"{table.stop}, which yields, for {table.body} in model exchange without {lacks}"
        hint = 'Give the stop parameters = { law = "restitution", restitution = ... }.'
        yield Problem(key_path(("contact", place, "stop")), "a rigid stop", got, hint)


def _says_its_side(facts: ComponentFacts) -> bool:
    """Return whether a stop has a parameter `side` like an ImpactStop (upper 1, lower 2), also in a lean export."""
    side = facts.variables.get(SIDE)
    if side is None or side.causality != "parameter":
        return False
    return side.items == SIDES if side.items else (side.kind, side.minimum, side.maximum) == ("integer", 1, 2)


def _is_rigid(draft: GeneralDraft, table: StopContactTable, facts: ComponentFacts) -> bool:
    """Return whether a stop of the package answers with a coefficient of restitution, its default law."""
    law = facts.variables.get(LAW)
    if law is None or "applied_restitution" not in facts.variables:
        return False
    if _sweeps_law(draft, table):
        return False  # each point has its own law
    default = contact_law("restitution").number
    return (draft.components[table.stop].parameters or {}).get(LAW, default) in rigid_law_numbers()


def _sweeps_law(draft: GeneralDraft, table: StopContactTable) -> bool:
    swept = draft.document.get("sweep")
    return isinstance(swept, dict) and f"{table.stop}.{LAW}" in swept


def _bodies_say_their_mass(draft: GeneralDraft, place: int, table: StopContactTable) -> Iterator[Problem]:
    facts = _facts(draft, table.body)
    if facts is None or facts.restorable or table.mass is not None or _sweeps_mass(draft, place):
        return
    if facts.kind == MODEL_EXCHANGE:
        return  # its states give the mass
    hint = f"{facts.file} does not have canGetAndSetFMUState, and no trial step can find it."
    yield Problem(key_path(("contact", place, "mass")), "the effective mass, a number > 0", "nothing", hint)


def _sweeps_mass(draft: GeneralDraft, place: int) -> bool:
    swept = draft.document.get("sweep")
    return isinstance(swept, dict) and any(contact_key(key) == (place, "mass") for key in swept)


def _inputs_are_free(draft: GeneralDraft, place: int, table: StopContactTable) -> Iterator[Problem]:
    """Contacts alone feed the inputs of their bodies and stops, and a stop belongs to one contact."""
    for number, connection in enumerate(draft.connections, start=1):
        if connection is None:
            continue
        target = component_variable(connection.target)
        if target == (table.body, table.force) or target in _stop_inputs(draft, table):
            key = "force" if target[0] == table.body else "stop"
            got = f"{quoted(connection.target)}, which connection[{number}] feeds already"
            where = key_path(("contact", place, key))
            yield Problem(where, "an input that the contact alone feeds", got, "Remove the connection.")
    for number, other in enumerate(draft.contacts[:place], start=1):
        if isinstance(other, StopContactTable) and other.stop == table.stop:
            got = f"{quoted(table.stop)}, which contact[{number}] has already"
            hint = "Make a component for each contact."
            yield Problem(key_path(("contact", place, "stop")), "a stop of its own", got, hint)


def _stop_inputs(draft: GeneralDraft, table: StopContactTable) -> set[tuple[str, str]]:
    names = (table.stop_displacement, velocity_input(draft, table))
    return {(table.stop, name) for name in names if name is not None}

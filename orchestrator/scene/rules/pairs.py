"""Rules of pairs of bodies that hit each other (`[[contact]]` with `between`), and the contact port of each body."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

from vibroimpact.fmus.core.contact_laws import contact_law
from vibroimpact.fmus.units import parse_unit
from vibroimpact.orchestrator.importer.specification import BodyPoint, PairSpec
from vibroimpact.orchestrator.scene.component_facts import MODEL_EXCHANGE, ComponentFacts, StartValue
from vibroimpact.orchestrator.scene.component_models import (
    BodyPair,
    BodyPointTable,
    PairTable,
    RestitutionPair,
)
from vibroimpact.orchestrator.scene.component_numbers import component_variable
from vibroimpact.orchestrator.scene.components import DraftComponent, GeneralDraft, not_restorable
from vibroimpact.orchestrator.scene.problems import Problem, key_path, nearest, quoted
from vibroimpact.orchestrator.scene.rules.contacts import variable_problems

#: The law of a port without a stop of its own, for contacts with other bodies.
PAIR_LAW = "pair"
_PORT = re.compile(r"contact\[([1-9][0-9]?)\]")
_MASS = re.compile(r"mass\[([1-9][0-9]?)\]")
#: Variables for the place of a port on a chain and on a beam; then the values for the last mass and the tip.
_MASS_NUMBER, _LOCATION = "mass_number", "location"
_LAST, _TIP = 0, 1.0


@dataclass
class PortPlan:
    """The contact port, or point, of each end of each pair, and the start values of components for these ports.

    Keys of `ends` are the 0-based places of the `[[contact]]` and of the point in its `between`. `parameters` has start
    values by component.
    """

    ends: dict[tuple[int, int], tuple[str, str] | BodyPoint] = field(default_factory=dict)
    parameters: dict[str, dict[str, StartValue]] = field(default_factory=dict)
    problems: list[Problem] = field(default_factory=list)

    def pair(self, place: int, table: BodyPair) -> PairSpec:
        """Return the pair of a `[[contact]]` without problems."""
        numbers = table.model_dump(exclude={"between", "bodies"})
        return PairSpec(self.ends[place, 0], self.ends[place, 1], **numbers)


def plan_ports(draft: GeneralDraft) -> PortPlan:
    """Return a plan with a contact port for each point of a pair."""
    plan = PortPlan()
    taken: dict[tuple[str, str], str] = {}
    for place, table in enumerate(draft.contacts):
        if not isinstance(table, PairTable):
            continue
        names = [component_variable(point)[0] for point in table.between]
        where = key_path(("contact", place, "between"))
        if names[0] == names[1]:
            hint = "The points of one body are held together by its own springs: give it stops instead."
            plan.problems.append(Problem(where, "points of two bodies", f"{quoted(names[0])} twice", hint))
            continue
        points = table.bodies
        plan.problems += _unused_points(points, table.between, place)
        for end, point in enumerate(table.between):
            if point in points:
                is_rigid = isinstance(table, RestitutionPair)
                plan.problems += _foreign_point_problems(
                    draft, place, point, points[point], is_rigid=is_rigid
                )
                plan.ends[place, end] = BodyPoint(component=point, **points[point].model_dump())
                continue
            found = _port_of(draft, point, key_path(("contact", place, "between", end)), taken, plan)
            if found is not None:
                plan.ends[place, end] = found
    return plan


def _unused_points(
    points: Mapping[str, BodyPointTable], between: Sequence[str], place: int
) -> Iterator[Problem]:
    for name in points:
        if name not in between:
            where = key_path(("contact", place, "bodies", name))
            yield Problem(where, f"one of {' and '.join(map(quoted, between))}", "another name")


def _foreign_point_problems(
    draft: GeneralDraft, place: int, name: str, point: BodyPointTable, *, is_rigid: bool
) -> Iterator[Problem]:
    """Yield the problems of a point on a body of another tool."""
    component = draft.components.get(name)
    if component is None:
        if draft.components:
            near = partial(nearest, name, draft.components)
            where = key_path(("contact", place, "bodies", name))
            yield Problem(where, "a component of this scene", quoted(name), near)
        return
    facts = component.facts
    if facts is None:
        return
    metre, speed, newton = map(parse_unit, ("m", "m/s", "N"))
    for key, causality, unit in (
        ("displacement", "output", metre),
        ("velocity", "output", speed),
        ("force", "input", newton),
    ):
        where = key_path(("contact", place, "bodies", name, key))
        compared = None if draft.is_nondimensional else unit
        yield from variable_problems(where, name, facts, getattr(point, key), causality, compared)
    if point.mass is None and not (facts.kind == MODEL_EXCHANGE and is_rigid):
        hint = "Only a body in model exchange gives it by its states, for the law restitution."
        where = key_path(("contact", place, "bodies", name, "mass"))
        yield Problem(where, "the effective mass, a number > 0", "nothing", hint)
    if not facts.restorable:
        hint = "The instant at which two bodies meet is found by going back."
        yield not_restorable(facts, key_path(("contact", place, "bodies", name)), hint)
    for number, connection in enumerate(draft.connections, start=1):
        if connection is not None and component_variable(connection.target) == (name, point.force):
            where = key_path(("contact", place, "bodies", name, "force"))
            got = f"{quoted(connection.target)}, which connection[{number}] feeds already"
            yield Problem(where, "an input that contacts alone feed", got, "Remove the connection.")


def _port_of(
    draft: GeneralDraft, point: str, where: str, taken: dict[tuple[str, str], str], plan: PortPlan
) -> tuple[str, str] | None:
    """Return the component and the port of a point; None without a port, with a problem added to the plan."""
    name, rest = component_variable(point)
    component = draft.components.get(name)
    if component is None:
        if draft.components:
            near = partial(nearest, name, draft.components)
            plan.problems.append(Problem(where, "a point of a component of this scene", quoted(point), near))
        return None
    if component.facts is None:
        return None
    problem = _body_problem(component.facts, name, where) or _point_problem(component, rest, where, point)
    if problem is not None:
        plan.problems.append(problem)
        return None
    if (name, rest) not in taken:
        port = rest if _PORT.fullmatch(rest) else _free_port(draft, component, rest, plan)
        if port is None:
            plan.problems.append(_no_port(component.facts, name, where))
            return None
        taken[name, rest] = port
        given = plan.parameters.setdefault(name, {})
        given.update(_start_values(component.facts, port, rest))
    return name, taken[name, rest]


def _body_problem(facts: ComponentFacts, name: str, where: str) -> Problem | None:
    if "contact[1].applied_impulse" in facts.variables and facts.restorable:
        return None
    lean = "contact[1].law" in facts.variables
    hint = (
        "Export it with --ports external."
        if lean
        else "Of a body of another tool give its variables in bodies."
    )
    got = f"{name}, whose {facts.file} has no contact[1].applied_impulse"
    return Problem(where, "a body of this package: Oscillator, Chain or Beam", got, hint)


def _kind(facts: ComponentFacts) -> str:
    if "mode.contact_shape" in facts.variables:
        return "Structure"
    if f"contact[1].{_MASS_NUMBER}" in facts.variables:
        return "Chain"
    return "Beam" if f"contact[1].{_LOCATION}" in facts.variables else "Oscillator"


def _point_problem(component: DraftComponent, rest: str, where: str, point: str) -> Problem | None:
    facts, name = component.facts, component.name
    assert facts is not None
    if _PORT.fullmatch(rest):
        return _given_port_problem(component, rest, where, point)
    kind = _kind(facts)
    words = {
        "Oscillator": f'"{name}", "{name}.mass"',
        "Chain": f'"{name}.mass[1]", "{name}.mass[2]", ..., or "{name}" for the last mass',
        "Beam": f'"{name}.tip"',
        "Structure": "the ports of its modes",
    }[kind]
    expected = f'one of {words}, or "{name}.contact[1]"'
    mass = _MASS.fullmatch(rest)
    if kind == "Chain" and mass:
        count = _masses(component)
        return None if int(mass[1]) <= count else Problem(where, f"a mass from 1 to {count}", quoted(point))
    known = {"Oscillator": ("", "mass"), "Chain": ("",), "Beam": ("tip",), "Structure": ()}[kind]
    return None if rest in known else Problem(where, expected, quoted(point))


def _masses(component: DraftComponent) -> int:
    assert component.facts is not None
    given = (component.parameters or {}).get("masses")
    if isinstance(given, int):
        return given
    return sum(name.startswith("mass[") for name in component.facts.variables)


def _given_port_problem(component: DraftComponent, port: str, where: str, point: str) -> Problem | None:
    assert component.facts is not None
    law = component.facts.variables.get(f"{port}.law")
    if law is None:
        return Problem(where, f"a contact port of {component.facts.file}", quoted(point))
    given = (component.parameters or {}).get(f"{port}.law", 0)
    # lean descriptions have only numbers
    if given in (contact_law("none").number, contact_law(PAIR_LAW).number):
        return None
    assert isinstance(given, int)
    names = {number: name for name, number in law.items.items()}
    hint = f'Remove {port}.law from its parameters: a pair sets it to "{PAIR_LAW}".'
    return Problem(
        where, "a port without a stop", f"{quoted(point)} with the law {names.get(given, given)}", hint
    )


def _free_port(draft: GeneralDraft, component: DraftComponent, rest: str, plan: PortPlan) -> str | None:
    """Return the first port that already has this place, or else the first port that is not in use."""
    assert component.facts is not None
    parameters = component.parameters or {}
    ports = [name.removesuffix(".law") for name in component.facts.variables if name.endswith("].law")]
    for port in ports:
        needed = _start_values(component.facts, port, rest)
        if all(parameters.get(name) == value for name, value in needed.items()):
            return port
    swept = draft.written("sweep")
    named = [point for table in draft.contacts if isinstance(table, PairTable) for point in table.between]
    used = {
        *parameters,
        *plan.parameters.get(component.name, {}),
        *(component_variable(key)[1] for key in swept if component_variable(key)[0] == component.name),
        *(f"{component_variable(p)[1]}.law" for p in named if component_variable(p)[0] == component.name),
        *(
            component_variable(c.target)[1]
            for c in draft.connections
            if c and component_variable(c.target)[0] == component.name
        ),
    }
    return next((port for port in ports if not any(key.startswith(f"{port}.") for key in used)), None)


def _no_port(facts: ComponentFacts, name: str, where: str) -> Problem:
    count = sum(name.endswith("].law") for name in facts.variables)
    hint = "Every stop and every point that is hit takes one: remove a stop, or export a body with more contacts."
    return Problem(where, "a body with a free contact port", f"{quoted(name)}, whose {count} are taken", hint)


def _start_values(facts: ComponentFacts, port: str, rest: str) -> Mapping[str, StartValue]:
    """Return the start values of a component that put a port at this point."""
    values: dict[str, StartValue] = {f"{port}.law": contact_law(PAIR_LAW).number}
    if _PORT.fullmatch(rest):
        return values
    mass = _MASS.fullmatch(rest)
    if _kind(facts) == "Chain":
        values[f"{port}.{_MASS_NUMBER}"] = int(mass[1]) if mass else _LAST
    elif rest == "tip":
        values[f"{port}.{_LOCATION}"] = _TIP
    return values

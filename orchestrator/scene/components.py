"""The components of a general scene: from `[component.NAME]` to an FMU file and its facts."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache, partial
from pathlib import Path
from typing import Any

from vibroimpact.fmus import components, fmu_path
from vibroimpact.fmus.errors import ComponentFileError
from vibroimpact.fmus.packaging.archive import content_hash
from vibroimpact.fmus.shipped import letters_of
from vibroimpact.orchestrator.fmi.capabilities import NEEDED_OF_CLOCKS, ONLY_ONCE
from vibroimpact.orchestrator.fmi.shapes import Shape
from vibroimpact.orchestrator.importer.specification import RunAs, StartValue
from vibroimpact.orchestrator.remote.address import FmuServer
from vibroimpact.orchestrator.scene.array_values import array_shape, given_value
from vibroimpact.orchestrator.scene.component_facts import (
    MODEL_EXCHANGE,
    ComponentFacts,
    Misfit,
    VariableFacts,
    component_facts,
)
from vibroimpact.orchestrator.scene.component_models import (
    PAIR_MODELS,
    BodyPair,
    ComponentTable,
    ConnectionTable,
    EventTable,
    GeneralRecord,
    PairTable,
    StopContactTable,
)
from vibroimpact.orchestrator.scene.component_numbers import (
    STEP_KEY,
    component_variable,
    contact_key,
    gain_place,
)
from vibroimpact.orchestrator.scene.draft import DraftTables
from vibroimpact.orchestrator.scene.execution_model import Execution
from vibroimpact.orchestrator.scene.fields import rule_of
from vibroimpact.orchestrator.scene.problems import KeyPath, Problem, key_path, nearest, quoted, read_table
from vibroimpact.orchestrator.scene.served_components import is_served, refuse_version, served_component

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*", re.ASCII)


@dataclass(frozen=True, slots=True)
class DraftComponent:
    """A component during the checks, with its valid start values; without facts if its FMU cannot be read."""

    name: str
    fmu: Path | None = None
    shipped: bool = False
    facts: ComponentFacts | None = None
    parameters: Mapping[str, StartValue] | None = None
    tolerance: float | None = None
    run_as: RunAs = "auto"
    server: FmuServer | None = None


def components_of(raw: object, folder: Path, problems: list[Problem]) -> dict[str, DraftComponent]:
    """Return the components of a document by name, and add their problems to `problems`."""
    if not isinstance(raw, dict) or not raw:
        got = "nothing" if raw in (None, {}) else quoted(raw)
        hint = 'Write [component.ball] and below it fmu = "ball.fmu".'
        problems.append(Problem("component", "one [component.NAME] table for each FMU", got, hint))
        return {}
    shipped = _Shipped()
    found = {name: _read_component(name, table, folder, shipped, problems) for name, table in raw.items()}
    problems += _only_instances(found)
    return found


def _only_instances(components: Mapping[str, DraftComponent]) -> Iterator[Problem]:
    """Yield a problem for each further component of an FMU that allows only one instance in a process."""
    first: dict[str, str] = {}
    for name, component in components.items():
        facts = component.facts
        if component.fmu is None or facts is None or not facts.capabilities.only_once or component.server:
            continue
        other = first.setdefault(content_hash(component.fmu), name)
        if other != name:
            got = f"{facts.file}, of which {other} is one ({ONLY_ONCE})"
            yield Problem(key_path(("component", name, "fmu")), "another FMU", got)


class _Shipped:
    """The components of the package for one scene: its folder is listed only once for all tables."""

    def __init__(self) -> None:
        self.names = components()
        self._letters = frozenset(map(letters_of, self.names))
        self.path = cache(fmu_path)

    def __contains__(self, name: str) -> bool:
        return letters_of(name) in self._letters


def _read_component(
    name: str, raw: object, folder: Path, package: _Shipped, problems: list[Problem]
) -> DraftComponent:
    path = ("component", name)
    if not _NAME.fullmatch(name):
        hint = "A component is named in keys such as ball.h, where a dot ends its name."
        problems.append(Problem(key_path(path), "a name of letters, digits and _", quoted(name), hint))
    table = read_table(ComponentTable, raw, path, problems)
    if table is None:
        return DraftComponent(name)
    shipped, server = not (_is_file_name(table.fmu) or is_served(table.fmu)), None
    if is_served(table.fmu):
        fmu, server = served_component(table, path, folder, problems)
    elif shipped:
        fmu = _shipped_fmu(table, path, package, problems)
    else:
        fmu = _fmu_file(table, path, folder, problems)
    if table.certificate is not None and not is_served(table.fmu):
        where, expected = (
            key_path((*path, "certificate")),
            "certificate beside a server grpc://HOST:PORT only",
        )
        problems.append(Problem(where, expected, f"certificate beside {quoted(table.fmu)}"))
    facts = _facts(fmu, table.run_as, path, problems) if fmu else None
    if facts and server and facts.kind == MODEL_EXCHANGE:
        where, got = key_path((*path, "run_as")), "model exchange, which is integrated where the scene runs"
        problems.append(Problem(where, '"auto" or "co_simulation" for a served FMU', got))
    parameters = _parameters(table.parameters, path, facts, problems) if facts else None
    return DraftComponent(name, fmu, shipped, facts, parameters, table.tolerance, table.run_as, server)


def _is_file_name(text: str) -> bool:
    return text.lower().endswith(".fmu")


def _shipped_fmu(
    table: ComponentTable, path: tuple[str, ...], package: _Shipped, problems: list[Problem]
) -> Path | None:
    where = key_path((*path, "fmu"))
    if table.fmu not in package:
        expected = "a path that ends in .fmu, grpc://HOST:PORT, or the name of a shipped component"
        problems.append(
            Problem(where, expected, quoted(table.fmu), partial(nearest, table.fmu, package.names))
        )
        return None
    if table.tolerance is not None and table.run_as != MODEL_EXCHANGE:
        hint = "It is exact, or has a parameter contact_tolerance: remove tolerance."
        got = f"tolerance = {table.tolerance:g} beside {quoted(table.fmu)}"
        problems.append(
            Problem(key_path((*path, "tolerance")), "tolerance beside an FMU file only", got, hint)
        )
    fmi = table.fmi or "3.0"
    try:
        return package.path(table.fmu, fmi)
    except ComponentFileError:
        hint = "Run `python -m vibroimpact.fmus.packaging.build`."
        expected = f"{table.fmu} built for FMI {fmi}"
        problems.append(Problem(where, expected, "no FMU", hint))
        return None


def _fmu_file(
    table: ComponentTable, path: tuple[str, ...], folder: Path, problems: list[Problem]
) -> Path | None:
    refuse_version(table, path, "a file", problems)
    file = (folder / table.fmu).absolute()
    where = key_path((*path, "fmu"))
    try:
        if file.is_file():
            return file
    except OSError as error:  # a name too long, a folder without rights
        problems.append(Problem(where, "a readable FMU file", f"an error: {error.strerror}"))
        return None
    found = (f"the folder {file}", "") if file.is_dir() else (f"no file {file}", _file_hint(file))
    problems.append(Problem(where, "an FMU file", *found))
    return None


def _file_hint(file: Path) -> str:
    """Return a hint with the nearest FMU file in the folder."""
    folder = file.parent
    if not folder.is_dir():
        return f"There is no folder {folder}."
    near = get_close_matches(file.name, sorted(entry.name for entry in folder.glob("*.fmu")), n=1)
    return f"Did you mean {near[0]}?" if near else "Paths count from the folder of the scene file."


def _facts(fmu: Path, run_as: RunAs, path: tuple[str, ...], problems: list[Problem]) -> ComponentFacts | None:
    where = key_path((*path, "fmu"))
    try:
        facts = component_facts(fmu, run_as)
    except ComponentFileError as error:
        message = " ".join(str(error).split()).rstrip(".")
        problems.append(Problem(where, "an intact FMU", f"an error: {message}"))
        return None
    if not facts.kinds:
        hint = "Export it for co-simulation or model exchange: scheduled execution is not available in this version."
        got = f"{facts.file} for scheduled execution only"
        problems.append(Problem(where, "an FMU for co-simulation or model exchange", got, hint))
        return None  # problems of its variables do not matter then
    if not facts.kind:
        got = f"{quoted(run_as)} for {facts.file}, which has {facts.kinds[0].replace('_', ' ')} only"
        problems.append(Problem(key_path((*path, "run_as")), "a kind that the FMU has", got))
        return None
    for needed in facts.capabilities.refusals:
        problems.append(Problem(where, NEEDED_OF_CLOCKS, f"{needed} of {facts.file}"))
    return facts


def _parameters(
    raw: Mapping[str, object], path: tuple[str, ...], facts: ComponentFacts, problems: list[Problem]
) -> dict[str, StartValue]:
    typed: dict[str, StartValue] = {}
    # the sizes of arrays come first
    for name, value in sorted(raw.items(), key=lambda item: item[0] not in facts.sizes):
        place = (*path, "parameters", name)
        found = list(_start_problems(name, value, key_path(place), facts))
        if not found:
            variable = facts.variables[name]
            fitted = given_value(variable, value, array_shape(facts, variable, typed))
            if isinstance(fitted, Misfit):
                found = [Problem(key_path(place), fitted.expected, quoted(value), fitted.hint)]
            else:
                typed[name] = fitted
        problems += found
    return {name: typed[name] for name in raw if name in typed}


def _start_problems(name: str, value: object, where: str, facts: ComponentFacts) -> Iterator[Problem]:
    variable = facts.variables.get(name)
    if variable is None:
        hint = _quotes_hint(name, value) or partial(nearest, name, settable_names(facts))
        yield Problem(where, f"a variable of {facts.file}", quoted(name), hint)
    else:
        yield from start_problems(variable, where)


def _quotes_hint(name: str, value: Any) -> str:
    """Return the advice for a dotted name without quotes, which TOML reads as a table."""
    words = [name]
    while isinstance(value, dict) and value:
        word, value = next(iter(value.items()))
        words.append(word)
    return f"Put the whole name in quotes: {quoted('.'.join(words))}." if len(words) > 1 else ""


def start_problems(variable: VariableFacts, where: str) -> Iterator[Problem]:
    """Yield the problem of a variable that cannot have a start value."""
    if not variable.settable:
        hint = "Parameters, inputs and start states have one."
        yield Problem(where, "a variable with a start value", _described(variable), hint)
    elif variable.kind in ("binary", "clock"):
        yield Problem(where, "a number, true or false, text, or an array of them", _described(variable))


def not_restorable(facts: ComponentFacts, where: str, hint: str) -> Problem:
    """Return the problem of an FMU that must restore its state, and cannot."""
    got = f"{facts.file}, which does not have canGetAndSetFMUState"
    return Problem(where, "an FMU whose state can be kept and restored", got, hint)


def settable_names(facts: ComponentFacts) -> list[str]:
    """Return the names of the variables of an FMU that have a start value."""
    return [name for name, variable in facts.variables.items() if variable.settable]


def _described(variable: VariableFacts) -> str:
    constant = "constant " if variable.variability == "constant" else ""
    return f"the {constant}{variable.causality} {variable.name} ({variable.shape})"


#: Keys of a contact with a stop that a contact between two bodies does not have.
_STOP_CONTACT_KEYS = frozenset(StopContactTable.model_fields) - frozenset(PairTable.model_fields)


class GeneralDraft(DraftTables):
    """A general scene during the checks."""

    def __init__(self, document: Mapping[str, Any], folder: Path) -> None:
        super().__init__(document)
        self.components = components_of(document.get("component"), folder, self.problems)
        self.connections = tuple(self.read(ConnectionTable, *entry) for entry in self.entries("connection"))
        self.events = tuple(self.read(EventTable, *entry) for entry in self.entries("event"))
        self.contacts = tuple(self._contact(*entry) for entry in self.entries("contact"))
        self.record = self.table(GeneralRecord, "record", {})
        self.execution = self.table(Execution, "execution", {})

    def _contact(self, raw: object, path: KeyPath) -> StopContactTable | BodyPair | None:
        """Read a contact of either form; a mixture of both is a single problem."""
        keys = set(raw) if isinstance(raw, dict) else {"stop"}
        one, other = "between" in keys, keys & _STOP_CONTACT_KEYS
        if one == bool(other):
            expected = (
                "either between = [...], two bodies that hit each other, or body, stop and their variables"
            )
            got = f"between beside {', '.join(sorted(other))}" if one else "neither"
            self.problems.append(Problem(key_path(path), expected, got, "Write one [[contact]] for each."))
            return None
        if one:
            return self.variant(PAIR_MODELS, "law", "restitution", raw, path)
        return self.read(StopContactTable, raw, path)

    @property
    def is_nondimensional(self) -> bool:
        """Whether all numbers of the scene are without units, regardless of its FMUs."""
        return self.header is not None and self.header.units == "nondimensional"

    def facts(self, reference: str) -> ComponentFacts | None:
        """Return the facts of the component in a reference; None where they are not known."""
        component = self.components.get(component_variable(reference)[0])
        return component.facts if component else None

    def variable(self, reference: str) -> VariableFacts | None:
        """Return the variable of `COMPONENT.VARIABLE`; None where it is not known."""
        facts = self.facts(reference)
        return facts.variables.get(component_variable(reference)[1]) if facts else None

    def shape(self, reference: str) -> Shape:
        """Return the shape of `COMPONENT.VARIABLE`, which is known; empty for a single value."""
        component, facts = self.components[component_variable(reference)[0]], self.facts(reference)
        variable = self.variable(reference)
        assert facts is not None
        assert variable is not None
        return array_shape(facts, variable, component.parameters or {})

    def unit(self, key: str) -> str:
        """Return the declared unit of a variable, a gain or a number of a contact, as written there; else `1`."""
        if self.names_step(key):
            return "s"
        named = contact_key(key)
        if named is not None and "contact" not in self.components:
            return self._contact_unit(*named)
        variable, place = self.variable(key), gain_place(key)
        connection = self.connections[place] if place is not None and variable is None else None
        return (variable.unit_name if variable else connection and connection.gain_unit) or "1"

    def names_step(self, key: str) -> bool:
        """Return whether a key is the step of the exchange, not a variable of a component named `execution`."""
        return key == STEP_KEY and "execution" not in self.components

    def swept_steps(self) -> tuple[float, ...]:
        """Return the swept values of the step of the exchange that are numbers > 0."""
        entry = self.written("sweep").get(STEP_KEY) if self.names_step(STEP_KEY) else None
        given = entry if isinstance(entry, dict) else {}
        values = given.get("values", [given.get("start"), given.get("stop")])
        numbers = values if isinstance(values, list) else []
        return tuple(v for v in numbers if isinstance(v, int | float) and v > 0.0)

    def _contact_unit(self, place: int, name: str) -> str:
        """Return the unit of a number of a contact, with dots between its factors, as in FMU descriptions."""
        table = self.contacts[place] if place < len(self.contacts) else None
        known = {} if table is None else type(table).model_fields
        return (rule_of(known[name]).unit if name in known else "").replace(" ", ".") or "1"

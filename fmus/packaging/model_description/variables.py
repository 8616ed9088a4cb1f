"""Variables of a description: violations of FMI's rules are graded, and read in their only sensible meaning."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from vibroimpact.fmus.packaging.description.model import DEFAULT_INITIAL
from vibroimpact.fmus.packaging.model_description.findings import LONGEST_NAME, Findings, Grade

REAL_TYPES = {"Real", "Float32", "Float64"}
_PARAMETERS = ("parameter", "calculatedParameter", "structuralParameter")
#: FMI's default of `initial` by causality and variability; a structural parameter is a parameter.
_INITIAL = DEFAULT_INITIAL | {("structuralParameter", v): "exact" for v in ("fixed", "tunable")}
#: Values that `initial` may have in a description, by its default.
_CHOICES = {"calculated": {"calculated", "approx"}, "exact": {"exact"}, None: {"exact"}}
#: Units that many tools write for a number without a unit, and never define.
_NO_UNITS = {"", "-", "1"}

_NONDIGIT = r"[A-Za-z_]"
_QUOTED = r"'(?:[A-Za-z0-9_!#$%&()*+,\-./:;<>=?@\[\]^{}|~ ]|\\['\"?\\abfnrtv])+'"
_PART = rf"(?:{_NONDIGIT}[A-Za-z_0-9]*|{_QUOTED})(?:\[[0-9]+(?:,[0-9]+)*\])?"
_IDENTIFIER = rf"{_PART}(?:\.{_PART})*"
#: Names of the naming convention `structured`: `contact[1].law`, `der(x,2)`, `'any text'`.
STRUCTURED_NAME = re.compile(rf"{_IDENTIFIER}|der\({_IDENTIFIER}(?:,[0-9]+)?\)")


@dataclass(slots=True)
class Variable:
    """A variable by its elements: `element` holds its name, `value` its type and its start value.

    In FMI 3.0 both are the same element. `variability` and `initial` hold FMI's default where the description has none.
    """

    element: Any
    value: Any
    major: int
    name: str
    type: str
    causality: str
    variability: str
    initial: str | None

    @property
    def reference(self) -> str:
        """Value reference of the variable."""
        return str(self.element.get("valueReference", ""))


def variables_of(root: Any, major: int) -> list[Variable]:
    """Return the variables of a schema-valid description."""
    return [
        _variable(element, major) for element in root.iterfind("ModelVariables/*") if "name" in element.attrib
    ]


def _variable(element: Any, major: int) -> Variable:
    value = element
    if major == 2:
        kinds = {"Real", "Integer", "Boolean", "String", "Enumeration"}
        value = next(child for child in element if child.tag in kinds)
    causality = element.get("causality", "local")
    variability = element.get("variability") or _default_variability(major, causality, value.tag)
    initial = element.get("initial") or _INITIAL.get((causality, variability))
    return Variable(element, value, major, element.get("name"), value.tag, causality, variability, initial)


def _default_variability(major: int, causality: str, kind: str) -> str:
    if major == 2:
        return "continuous"
    if causality in _PARAMETERS:
        return "fixed"
    return "continuous" if kind in REAL_TYPES else "discrete"


def amend_variables(root: Any, variables: list[Variable], findings: Findings) -> None:
    """Amend, in place, the variables of a schema-valid description."""
    types = _types(root)
    for variable in variables:
        _amend_type(variable, types, findings)
        _amend_variability(variable, findings)
        _amend_initial(variable, findings)
        _amend_start(variable, findings)
    _amend_units(root, variables, types, findings)
    _look_at_names(root, variables, findings)
    if variables and variables[0].major == 3:
        _look_at_references(variables, findings)


def _types(root: Any) -> dict[str, Any]:
    """Return the elements with the attributes of each declared type."""
    found = {}
    for element in root.iterfind("TypeDefinitions/*"):
        found[element.get("name")] = element[0] if element.tag == "SimpleType" and len(element) else element
    return found


def _amend_type(variable: Variable, types: dict[str, Any], findings: Findings) -> None:
    declared = variable.value.get("declaredType")
    if declared is not None and declared not in types:
        del variable.value.attrib["declaredType"]
        got = f"expected a declared type that is defined, got {declared[:LONGEST_NAME]}."
        findings.add(Grade.doubt, f"{got} Its unit and limits are unknown.", variable.name)


def _amend_variability(variable: Variable, findings: Findings) -> None:
    causality, got = variable.causality, variable.variability
    fits = variable.type in REAL_TYPES or got != "continuous"
    if (causality, got) in _INITIAL and fits:
        return
    written = variable.element.get("variability")
    if got == "constant" and causality in ("parameter", "input"):
        variable.causality, variable.initial = "local", "exact"
        variable.element.set("causality", "local")
        variable.element.attrib.pop("initial", None)
        text = f"expected a variability of a {causality}, got constant. No value can be given to it."
        findings.add(Grade.remark, text, variable.name)
        return
    variable.variability = _possible_variability(variable)
    variable.element.set("variability", variable.variability)
    if "initial" not in variable.element.attrib:
        variable.initial = _INITIAL[causality, variable.variability]
    # an FMU may ignore values set during a run for an input that it declares fixed
    grade = Grade.doubt if causality == "input" and written and got != "continuous" else Grade.remark
    text = (
        f"expected a variability that FMI allows of a {causality} of type {variable.type}, got "
        f"{written or 'none'}. Read as {variable.variability}."
    )
    findings.add(grade, text, variable.name)


def _possible_variability(variable: Variable) -> str:
    if variable.causality in _PARAMETERS:
        return "fixed"
    real = variable.type in REAL_TYPES or variable.causality == "independent"
    return "continuous" if real else "discrete"


def _amend_initial(variable: Variable, findings: Findings) -> None:
    written = variable.element.get("initial")
    default = _INITIAL[variable.causality, variable.variability]
    varies = variable.causality in ("output", "local") and variable.variability in ("discrete", "continuous")
    allowed = {"calculated", "approx", "exact"} if varies else _CHOICES[default]
    if written is None or (written in allowed and variable.causality != "independent"):
        return
    del variable.element.attrib["initial"]
    variable.initial = default
    settable = variable.causality in ("parameter", "structuralParameter")
    meant = "Read as exact: a value that is given to it may be lost." if settable else "It is not looked at."
    properties = f"causality {variable.causality} and variability {variable.variability}"
    text = f"expected no initial = {written} beside {properties}."
    findings.add(Grade.doubt if settable else Grade.remark, f"{text} {meant}", variable.name)


def _start(variable: Variable) -> tuple[Any, str | None]:
    """Return the element with the start value, and the value; text has an element of its own in FMI 3.0."""
    if variable.major == 3 and variable.type in ("Binary", "String"):
        element = variable.element.find("Start")
        return element, None if element is None else element.get("value")
    return variable.value, variable.value.get("start")


def _amend_start(variable: Variable, findings: Findings) -> None:
    place, start = _start(variable)
    calculated = variable.initial == "calculated" or variable.causality == "independent"
    needed = variable.initial in ("exact", "approx") or variable.causality == "input"
    if start and calculated:
        if place is variable.value:
            del place.attrib["start"]
        else:
            variable.element.remove(place)
        findings.add(
            Grade.remark,
            "expected no start value of what is calculated, got one. It is not used.",
            variable.name,
        )
    elif start is None and needed and not calculated and variable.type != "Clock":
        findings.add(Grade.remark, "expected a start value, got none. The FMU's own is used.", variable.name)


def _amend_units(root: Any, variables: list[Variable], types: dict[str, Any], findings: Findings) -> None:
    shown = {
        unit.get("name"): {e.get("name") for e in unit.iterfind("DisplayUnit")}
        for unit in root.iterfind("UnitDefinitions/Unit")
    }
    unknown: list[str] = []
    for variable in variables:
        holder = variable.value
        if variable.type not in REAL_TYPES or holder.get("unit") is None:
            holder = types.get(variable.value.get("declaredType"), holder)
        unit = holder.get("unit")
        if unit is not None and unit not in shown:
            _amend_unit(variable, holder, unknown, findings)
        if variable.type in REAL_TYPES:
            _amend_display_unit(variable, shown.get(unit, set()), findings)
    for unit in dict.fromkeys(unknown):
        _define(root, unit)


def _amend_unit(variable: Variable, holder: Any, unknown: list[str], findings: Findings) -> None:
    """Remove a unit that means no unit; treat another undefined unit as a mere name."""
    unit = holder.get("unit")
    got = f"expected a unit that is defined, got {unit[:LONGEST_NAME]!r}."
    if unit.strip() in _NO_UNITS:
        del holder.attrib["unit"]
        findings.add(Grade.remark, f"{got} Read as a number without a unit.", variable.name)
    else:
        unknown.append(unit)
        findings.add(Grade.doubt, f"{got} Its values are passed on unchanged.", variable.name)


def _define(root: Any, unit: str) -> None:
    definitions = root.find("UnitDefinitions")
    if definitions is None:
        definitions = root.makeelement("UnitDefinitions")
        root.append(definitions)
    definitions.append(root.makeelement("Unit", {"name": unit}))


def _amend_display_unit(variable: Variable, shown: set[str | None], findings: Findings) -> None:
    holders = [variable.value, *variable.element.iterfind("Alias")]
    for holder in holders:
        if holder.get("displayUnit") is not None and holder.get("displayUnit") not in shown:
            del holder.attrib["displayUnit"]
            text = "expected a display unit that its unit has, got another. It is not looked at."
            findings.add(Grade.remark, text, variable.name)


def _all_names(variables: list[Variable]) -> Iterator[str]:
    for variable in variables:
        yield variable.name
        yield from (alias.get("name", "") for alias in variable.element.iterfind("Alias"))


def _look_at_names(root: Any, variables: list[Variable], findings: Findings) -> None:
    seen: set[str] = set()
    structured = root.get("variableNamingConvention", "flat") == "structured"
    for name in _all_names(variables):
        if name in seen:
            findings.add(Grade.refused, "expected names of one variable each, got them twice.", name)
        seen.add(name)
        if structured and not STRUCTURED_NAME.fullmatch(name):
            text = "expected a name as body.x[1], der(x) or 'any text' (naming convention structured), got another."
            findings.add(Grade.remark, text, name)
        elif not structured and any(c in name for c in "\r\n\t"):
            findings.add(
                Grade.remark, "expected a name without line breaks and tabs, got one with them.", name
            )


def _look_at_references(variables: list[Variable], findings: Findings) -> None:
    """Add findings for value references shared in FMI 3.0, and for a number of times other than one."""
    seen: set[str] = set()
    for variable in variables:
        if variable.reference in seen:
            text = f"expected value references of their own, got that of another variable ({variable.reference[:20]})."
            findings.add(Grade.doubt, text, variable.name)
        seen.add(variable.reference)
    times = sum(variable.causality == "independent" for variable in variables)
    if times != 1:
        findings.add(Grade.remark, f"ModelVariables: expected one independent variable, got {times}.")

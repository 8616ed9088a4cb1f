"""Parameter values (SSV) and their mappings (SSM): read, renamed and turned into start values of variables."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from xml.etree.ElementTree import Element

from vibroimpact.fmus.units import BASE_UNITS, Unit, agree, declared_unit
from vibroimpact.orchestrator.scene.component_facts import (
    Misfit,
    StartValue,
    VariableFacts,
    typed_value,
)
from vibroimpact.orchestrator.scene.problems import quoted
from vibroimpact.orchestrator.ssp.names import INTEGER_TYPES, REAL_TYPES, VERSIONS, tag
from vibroimpact.orchestrator.ssp.refusal import RefusalError

Units = Mapping[str, Unit]

LONGEST_NAME = 2000
MOST_ENTRIES = 10_000
"""Most entries of a mapping of values."""
_MOST_NAMED = 5
"""Most elements that a message lists."""
_NUMBER = re.compile(r"\s*[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]+)?\s*", re.ASCII)
_WHOLE = re.compile(r"\s*[+-]?0{0,100}[0-9]{1,20}\s*", re.ASCII)
_VERSION = re.compile(r"1\.[0-9]{1,3}(-.*)?|2\.[0-9]{1,3}")


@dataclass(frozen=True, slots=True)
class Parameter:
    """A value with its name; `unit` is None if it is not given."""

    name: str
    value: StartValue
    unit: Unit | None = None


Table = tuple[tuple[StartValue, StartValue], ...]
"""Values of a source, each with the value of the target."""


@dataclass(frozen=True, slots=True)
class Transformation:
    """A change of values: factor times the value plus offset, or the table of a mapping."""

    factor: float = 1.0
    offset: float = 0.0
    table: Table | None = None

    def of(self, value: StartValue, where: str) -> StartValue:
        """Return the changed value; RefusalError for a value that the transformation does not take."""
        if self.table is not None:
            return mapped_value(self.table, value, where)
        if (self.factor, self.offset) == (1.0, 0.0):
            return value
        if isinstance(value, str | bool):
            raise RefusalError(where, "a number where there is a linear transformation", quoted(value))
        return self.factor * value + self.offset


def mapped_value(table: Table, value: StartValue, where: str) -> StartValue:
    """Return the value that a table gives for another one; RefusalError if it has none."""
    found = next(
        (target for source, target in table if type(source) is type(value) and source == value), None
    )
    if found is None:
        known = ", ".join(quoted(source) for source, _ in table[:_MOST_NAMED])
        raise RefusalError(where, f"a value of its mapping ({known})", quoted(value))
    return found


@dataclass(frozen=True, slots=True)
class Mapped:
    """An entry of a mapping: `target` has the changed value of `source`."""

    source: str
    target: str
    change: Transformation = Transformation()
    suppressed: bool = False


@dataclass(frozen=True, slots=True)
class Binding:
    """Parameters of an element, by their names in it."""

    parameters: tuple[Parameter, ...]
    mapping: tuple[Mapped, ...] | None = None
    """The mapping of their names; None without a mapping."""
    prefix: str = ""
    """Prefix of their names before the mapping."""
    unmatched: tuple[str, ...] = ()
    """Parameters that the mapping names, but that do not exist."""

    def renamed(self, parameter: Parameter) -> tuple[Parameter, ...]:
        """Return another set's parameter after this mapping; empty if the mapping does not name it."""
        if self.mapping is None:
            return ()
        return binding((parameter,), self.mapping, self.prefix).parameters


def binding(parameters: tuple[Parameter, ...], mapping: tuple[Mapped, ...] | None, prefix: str) -> Binding:
    """Return the parameters of a binding as applied: only mapped ones if there is a mapping."""
    named = {prefix + parameter.name: parameter for parameter in parameters}
    if mapping is None:
        return Binding(tuple(replace(parameter, name=name) for name, parameter in named.items()))
    applied = (_mapped(named[entry.source], entry) for entry in mapping if entry.source in named)
    unmatched = tuple(entry.source for entry in mapping if entry.source not in named)
    return Binding(tuple(applied), mapping, prefix, unmatched)


def _mapped(parameter: Parameter, entry: Mapped) -> Parameter:
    unit = None if entry.suppressed else parameter.unit
    value = entry.change.of(parameter.value, f"parameter mapping of {parameter.name[:60]}")
    return Parameter(entry.target, value, unit)


def read_units(root: Element, where: str) -> dict[str, Unit]:
    """Return the units that a file defines, by name."""
    for parent in root:
        if parent.tag.endswith("}Units"):
            return dict(_unit(element, where) for element in parent.findall(tag("ssc:Unit")))
    return {}


def _unit(element: Element, where: str) -> tuple[str, Unit]:
    name, base = element.get("name", ""), element.find(tag("ssc:BaseUnit"))
    where = f"{where}: unit {name[:60]}"
    attributes = {} if base is None else base.attrib
    exponents = {key: whole(attributes.get(key, "0"), f"{where}: {key}") for key in BASE_UNITS}
    factor = number(attributes.get("factor", "1"), f"{where}: factor")
    offset = number(attributes.get("offset", "0"), f"{where}: offset")
    if factor == 0.0 or any(abs(power) > 99 for power in exponents.values()):
        raise RefusalError(where, "exponents of at most 99 and a factor other than 0", "others")
    return name, declared_unit(name, exponents, factor, offset)


def read_parameter_set(
    root: Element, where: str, units: Units | None = None, remarks: list[str] | None = None
) -> tuple[Parameter, ...]:
    """Return the parameters of `ssv:ParameterSet`, with units of the enclosing file; messages begin with `where`.

    A parameter with several values has the last one, as in other tools, if there is a list for the remark.
    """
    expect(root, "ssv:ParameterSet", where)
    refuse_version(root, where)
    known = {**(units or {}), **read_units(root, where)}
    found: dict[str, Parameter] = {}
    again: dict[str, None] = {}
    for element in root.iterfind(f"{tag('ssv:Parameters')}/{tag('ssv:Parameter')}"):
        parameter = _parameter(element, where, known)
        if found.setdefault(parameter.name, parameter) != parameter:
            if remarks is None:
                raise RefusalError(where, "one value of each parameter", f"two of {quoted(parameter.name)}")
            again[parameter.name] = None
            found[parameter.name] = parameter
    if again and remarks is not None:
        remarks.append(f"{where}: the last of several values was taken: {named_few(again)}")
    return tuple(found.values())


def named_few(names: Collection[str]) -> str:
    """Return the first names of a list, shortened, and the number of the others."""
    named = ", ".join(name[:100] or '""' for name in list(names)[:_MOST_NAMED])
    return f"{named} and {len(names) - _MOST_NAMED} more" if len(names) > _MOST_NAMED else named


def _parameter(element: Element, where: str, units: Units) -> Parameter:
    name = element.get("name", "")
    where = f"{where}: {name[:100]}"
    if len(name) > LONGEST_NAME:
        raise RefusalError(where, f"a name of at most {LONGEST_NAME} characters", f"{len(name)}")
    for child in element if _values_in(element) == 1 else ():
        kind, text = child.tag.rpartition("}")[2], child.get("value", "")
        if kind in _READ or kind in REAL_TYPES or kind in INTEGER_TYPES:
            read = _READ.get(kind, number if kind in REAL_TYPES else whole)
            return Parameter(name, read(text, where), units.get(child.get("unit", "")))
        if kind in ("Binary", "Dimension"):
            break
    kinds = [child.tag.rpartition("}")[2][:60] for child in element]
    more = f" and {len(kinds) - _MOST_NAMED} more" if len(kinds) > _MOST_NAMED else ""
    got = f"{', '.join(kinds[:_MOST_NAMED])}{more}" or "none"
    raise RefusalError(where, "one number, truth value, text or enumeration item", got)


def _values_in(element: Element) -> int:
    """Return the number of values of a parameter; annotations do not count."""
    kinds = (child.tag.rpartition("}")[2] for child in element)
    return sum(kind in _READ or kind in REAL_TYPES or kind in INTEGER_TYPES for kind in kinds)


def read_mapping(root: Element, where: str) -> tuple[Mapped, ...]:
    """Return the entries of a parameter mapping, `ssm:ParameterMapping`."""
    expect(root, "ssm:ParameterMapping", where)
    refuse_version(root, where)
    return tuple(_entry(element, where) for element in root.iterfind(tag("ssm:MappingEntry")))


def _entry(element: Element, where: str) -> Mapped:
    source, target = element.get("source", ""), element.get("target", "")
    where = f"{where}: {source[:60]} -> {target[:60]}"
    change = read_transformation(element, where) or Transformation()
    suppressed = truth(element.get("suppressUnitConversion", "false"), where)
    return Mapped(source, target, change, suppressed)


def read_transformation(element: Element, where: str) -> Transformation | None:
    """Return the transformation of an element; None without one."""
    for child in element:
        kind = child.tag.rpartition("}")[2]
        if kind in TRANSFORMATIONS:
            return Transformation(table=_table(child, TRANSFORMATIONS[kind], f"{where}: {kind}"))
        if kind == "LinearTransformation":
            return Transformation(
                number(child.get("factor", "1"), where), number(child.get("offset", "0"), where)
            )
    return None


def _table(element: Element, read: Callable[[str, str], StartValue], where: str) -> Table:
    entries = [child for child in element if child.tag.rpartition("}")[2] == "MapEntry"]
    if not 0 < len(entries) <= MOST_ENTRIES:
        raise RefusalError(where, f"1 to {MOST_ENTRIES} entries", str(len(entries)))
    table = tuple((read(one.get("source", ""), where), read(one.get("target", ""), where)) for one in entries)
    if len({source for source, _ in table}) != len(table):
        raise RefusalError(where, "each source once", "one twice")
    return table


def start_value(variable: VariableFacts, parameter: Parameter, where: str) -> StartValue:
    """Return the value of a parameter in the type and unit of its variable.

    RefusalError: the type is another one, or the value is out of range.
    """
    value = parameter.value
    if variable.kind == "real" and not isinstance(value, bool | str):
        value = converted(float(value), parameter.unit, variable.unit, where)
    if variable.kind in ("integer", "enumeration") and isinstance(value, float) and value.is_integer():
        value = int(value)
    if variable.kind in ("integer", "enumeration") and isinstance(value, str) and value.isdecimal():
        value = int(value)
    fitted = typed_value(variable, value)
    if isinstance(fitted, Misfit):
        raise RefusalError(where, fitted.expected, quoted(value), fitted.hint)
    if variable.kind == "enumeration":
        return next((name for name, item in variable.items.items() if item == fitted), fitted)
    return fitted


def converted(value: float, given: Unit | None, taken: Unit | None, where: str) -> float:
    """Return a number in another unit; unchanged if a unit is unknown, or both are equal."""
    if given is None or taken is None or agree(given, taken):
        return value
    if given.exponents != taken.exponents:
        raise RefusalError(where, f"a value in {taken.name or '1'}", f"one in {given.name or '1'}")
    return (value * given.factor + given.offset - taken.offset) / taken.factor


def expect(root: Element, name: str, where: str) -> None:
    """Raise RefusalError unless an element has this name."""
    if root.tag != tag(name):
        raise RefusalError(where, f"<{name}>", f"<{root.tag.rpartition('}')[2][:60]}>")


def refuse_version(root: Element, where: str) -> None:
    """Raise RefusalError for a file of an unknown version."""
    version = root.get("version", "")
    if not _VERSION.fullmatch(version):
        raise RefusalError(f"{where}: version", " or ".join(VERSIONS), quoted(version))


def number(text: str, where: str) -> float:
    """Return a finite number in the notation of XML: in ASCII, without the underscores of Python."""
    value = float(text) if _NUMBER.fullmatch(text) else math.nan
    if not math.isfinite(value):
        raise RefusalError(where, "a finite number", quoted(text))
    return value


def whole(text: str, where: str) -> int:
    """Return a whole number of an SSP type, at most 64 bits."""
    if not _WHOLE.fullmatch(text) or not -(2**63) <= int(text) < 2**64:
        raise RefusalError(where, "a whole number of 64 bits", quoted(text))
    return int(text)


def truth(text: str, where: str) -> bool:
    """Return a truth value in the notation of XML."""
    if text.strip() not in ("true", "1", "false", "0"):
        raise RefusalError(where, "true or false", quoted(text))
    return text.strip() in ("true", "1")


def _text(text: str, _: str) -> str:
    return text


_READ: Mapping[str, Callable[[str, str], StartValue]] = {
    "Boolean": truth,
    "String": _text,
    "Enumeration": _text,
}
TRANSFORMATIONS: Mapping[str, Callable[[str, str], StartValue]] = {
    "BooleanMappingTransformation": truth,
    "IntegerMappingTransformation": whole,
    "EnumerationMappingTransformation": _text,
}
"""Mappings of values, each with the reader of its values."""

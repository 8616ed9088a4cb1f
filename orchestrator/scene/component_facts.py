"""The facts of an FMU for a scene: its variables with types, units and causalities, and the values that they accept.

Facts come only from the model description; no code of the FMU runs.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple

from vibroimpact.fmus.packaging.archive import content_hash, unpack
from vibroimpact.fmus.packaging.fmpy_door import ModelDescription, reading_of
from vibroimpact.fmus.packaging.model_description import Grade
from vibroimpact.fmus.safe_xml import root_of
from vibroimpact.fmus.units import BASE_UNITS, Unit, declared_unit
from vibroimpact.orchestrator.fmi.capabilities import Capabilities, capabilities_of
from vibroimpact.orchestrator.fmi.shapes import Dimensions, default_sizes, dimensions_of
from vibroimpact.orchestrator.importer.specification import RunAs
from vibroimpact.orchestrator.scene.problems import nearest

StartValue = float | int | bool | str
VariableKind = Literal["real", "integer", "enumeration", "boolean", "text", "binary", "clock"]
#: Kinds that are numbers in a dataset.
NUMERIC_KINDS: tuple[VariableKind, ...] = ("real", "integer", "enumeration", "boolean")

#: The kinds of FMU that run in a scene.
CO_SIMULATION: Final = "co_simulation"
MODEL_EXCHANGE: Final = "model_exchange"

_KINDS: dict[str, VariableKind] = {
    "Enumeration": "enumeration",
    "Boolean": "boolean",
    "String": "text",
    "Binary": "binary",
    "Clock": "clock",
}
_MOST_CACHED = 64
_INTEGER_TYPE = re.compile(r"(U?)Int([0-9]+)")


@dataclass(frozen=True, slots=True)
class VariableFacts:
    """One variable of an FMU.

    Attributes
    ----------
    name, reference, kind, type
        Name, value reference, kind of value, and FMI's word for the type.
    causality, variability, initial : str
        FMI's words.
    unit : Unit or None
        Declared unit; None without a definition in the description.
    unit_name : str
        The unit in the words of the description; may be empty.
    minimum, maximum : float or None
        Limits in the description.
    items : mapping of str to int
        Names and numbers of an enumeration.
    dimensions : tuple of int or str
        Dimensions of an array: sizes, or names of the structural parameters that give them.
    """

    name: str
    reference: int
    kind: VariableKind
    type: str
    causality: str
    variability: str
    initial: str
    unit: Unit | None
    unit_name: str
    minimum: float | None
    maximum: float | None
    items: Mapping[str, int]
    dimensions: Dimensions

    @property
    def scalar(self) -> bool:
        """Whether the variable is one value, not an array."""
        return not self.dimensions

    @property
    def settable(self) -> bool:
        """Whether FMI allows an importer to set the start value."""
        if self.variability == "constant" or self.causality == "independent":
            return False
        return self.causality == "input" or self.initial in ("exact", "approx")

    @property
    def fed(self) -> bool:
        """Whether a connection may feed the variable: an input at any time, a tunable parameter at events."""
        return self.causality == "input" or (self.causality == "parameter" and self.variability == "tunable")

    @property
    def shape(self) -> str:
        """Type of the variable in words, including arrays."""
        return self.type if self.scalar else f"array of {self.type}"


@dataclass(frozen=True, slots=True)
class ComponentFacts:
    """An FMU: its file, its variables by name, and the kind that runs as declared.

    Attributes
    ----------
    kinds : tuple of str
        The kinds of FMU that can run, the usual kind first.
    kind : str
        The kind that runs; empty if the FMU does not have it.
    scheduled : bool
        Whether the FMU supports scheduled execution.
    step : float or None
        Proposed communication step, s.
    capabilities : Capabilities
        Declared capabilities of the kind that runs.
    sizes : mapping of str to int
        Start values of the structural parameters, and of constants that are sizes.
    doubts : tuple of str
        Open points of the description, each with the assumption.
    remarks : int
        Number of other oddities in the description, which change no number.
    """

    file: str
    variables: Mapping[str, VariableFacts]
    kinds: tuple[str, ...]
    kind: str
    scheduled: bool
    step: float | None
    capabilities: Capabilities
    sizes: Mapping[str, int]
    doubts: tuple[str, ...] = ()
    remarks: int = 0

    @property
    def restorable(self) -> bool:
        """Whether the state of the FMU can be kept and restored."""
        return self.capabilities.restorable

    @property
    def event_mode(self) -> bool:
        """Whether the FMU handles events in event mode."""
        return self.capabilities.event_mode


def component_facts(path: Path, run_as: RunAs = "auto") -> ComponentFacts:
    """Return the facts of an FMU that runs as a kind, from the cache if a file of the same content was read before.

    Raises
    ------
    ComponentFileError
        The file is missing, unsafe, or its description breaks FMI's rules.
    """
    return _facts(content_hash(path), path, run_as)


@lru_cache(maxsize=_MOST_CACHED)
def _facts(sha256: str, path: Path, run_as: RunAs) -> ComponentFacts:
    reading = reading_of(path)
    description = reading.description
    units = {unit.name: _unit(unit) for unit in description.unitDefinitions}
    folder = unpack(path).folder
    named = {variable.name: variable for variable in description.modelVariables}
    _take_limits(named, folder)
    dimensions = dimensions_of(named)
    variables = {name: _variable(one, units, dimensions.get(name, ())) for name, one in named.items()}
    interfaces = {CO_SIMULATION: description.coSimulation, MODEL_EXCHANGE: description.modelExchange}
    kinds = tuple(kind for kind, interface in interfaces.items() if interface is not None)
    kind = next((kind for kind in kinds if run_as in ("auto", kind)), "")
    return ComponentFacts(
        path.name,
        variables,
        kinds=kinds,
        kind=kind,
        scheduled=description.scheduledExecution is not None,
        step=_proposed_step(description),
        capabilities=capabilities_of(description, folder, model_exchange=kind == MODEL_EXCHANGE),
        sizes=default_sizes(named),
        doubts=tuple(finding.text for finding in reading.findings if finding.grade is Grade.doubt),
        remarks=sum(finding.grade is Grade.remark for finding in reading.findings),
    )


def _take_limits(variables: Mapping[str, Any], folder: Path) -> None:
    """Complete the limits of unsigned integers, which FMPy does not read."""
    if not any(variable.type.startswith("UInt") for variable in variables.values()):
        return
    root = root_of((folder / "modelDescription.xml").read_bytes(), "modelDescription.xml")
    for element in root.iterfind("ModelVariables/*"):
        if element.tag.startswith("UInt") and element.get("name") in variables:
            variable = variables[element.get("name", "")]
            variable.min, variable.max = element.get("min"), element.get("max")


def _proposed_step(description: ModelDescription) -> float | None:
    experiment = description.defaultExperiment
    text = None if experiment is None else experiment.stepSize
    step = None if text is None else float(text)
    return step if step is not None and math.isfinite(step) and step > 0.0 else None


def _unit(definition: Any) -> Unit | None:
    """Return a defined unit; None for a definition with only a name, without base units."""
    base = definition.baseUnit
    if base is None:
        return None
    return declared_unit(
        definition.name, {name: getattr(base, name) for name in BASE_UNITS}, base.factor, base.offset
    )


def _variable(variable: Any, units: Mapping[str, Unit | None], dimensions: Dimensions) -> VariableFacts:
    declared = variable.declaredType
    unit_name = variable.unit or (declared.unit if declared else None) or ""
    items = declared.items if declared and variable.type == "Enumeration" else ()
    return VariableFacts(
        name=variable.name,
        reference=variable.valueReference,
        kind=_kind(variable.type),
        type=variable.type,
        causality=variable.causality,
        variability=variable.variability,
        initial=variable.initial or "",
        unit=units.get(unit_name),
        unit_name=unit_name,
        minimum=_limit(variable.min, declared.min if declared else None),
        maximum=_limit(variable.max, declared.max if declared else None),
        items={item.name: int(item.value) for item in items},
        dimensions=dimensions,
    )


def _kind(fmi_type: str) -> VariableKind:
    if fmi_type in _KINDS:
        return _KINDS[fmi_type]
    return "real" if fmi_type.startswith(("Real", "Float")) else "integer"


def _limit(own: str | None, declared: str | None) -> float | None:
    text = declared if own is None else own
    return None if text is None else float(text)


class Misfit(NamedTuple):
    """The expected value of a variable in place of a wrong one, with a hint."""

    expected: str
    hint: str = ""


def typed_value(variable: VariableFacts, value: object) -> StartValue | Misfit:
    """Return a value in the type of its variable: float, int (also for enumerations), bool or str.

    Parameters
    ----------
    variable : VariableFacts
        A scalar variable.
    value : object
        A value of a TOML document; an enumeration takes the name or the number of one of its items.
    """
    if variable.kind == "boolean":
        return value if isinstance(value, bool) else Misfit("true or false")
    if variable.kind == "text":
        if not isinstance(value, str):
            return Misfit("text")
        return Misfit("text without null characters") if "\0" in value else value
    if variable.kind == "enumeration":
        return _item(variable, value)
    return _real(variable, value) if variable.kind == "real" else _integer(variable, value)


def swept_value(variable: VariableFacts, value: float) -> StartValue | Misfit:
    """Return a swept number in the type of its variable."""
    whole = variable.kind != "real" and value.is_integer()
    return typed_value(variable, int(value) if whole else value)


def _real(variable: VariableFacts, value: object) -> StartValue | Misfit:
    expected = Misfit(f"a finite number{_limits(variable)}")
    if isinstance(value, bool) or not isinstance(value, int | float):
        return expected
    try:
        number = float(value)
    except OverflowError:  # TOML's whole numbers have no limit
        return expected
    return number if math.isfinite(number) and _is_within(variable, number) else expected


def _integer(variable: VariableFacts, value: object) -> StartValue | Misfit:
    if isinstance(value, bool) or not isinstance(value, int) or not _is_within(variable, value):
        return Misfit(f"a whole number{_limits(variable)}")
    match = _INTEGER_TYPE.fullmatch(variable.type)
    signed, bits = (not match[1], int(match[2])) if match else (True, 32)  # FMI 2.0 Integer
    lowest, highest = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if signed else (0, 2**bits - 1)
    return value if lowest <= value <= highest else Misfit(f"a whole number from {lowest} to {highest}")


def _item(variable: VariableFacts, value: object) -> StartValue | Misfit:
    names = {number: name for name, number in variable.items.items()}
    if isinstance(value, str) and value in variable.items:
        return variable.items[value]
    if isinstance(value, int) and not isinstance(value, bool) and value in names:
        return value
    choices = ", ".join(f'"{name}" ({number})' for number, name in names.items())
    hint = nearest(value, variable.items) if isinstance(value, str) else ""
    return Misfit(f"one of {choices}", hint if hint.startswith("Did") else "")


def _is_within(variable: VariableFacts, value: float) -> bool:
    low, high = variable.minimum, variable.maximum
    return (low is None or value >= low) and (high is None or value <= high)


def _limits(variable: VariableFacts) -> str:
    low, high = variable.minimum, variable.maximum
    if low is not None and high is not None:
        return f" from {low:g} to {high:g}"
    if low is not None:
        return f" >= {low:g}"
    return f" <= {high:g}" if high is not None else ""

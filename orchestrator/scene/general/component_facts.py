"""What a scene needs to know of an FMU: its variables, their types, units and causalities.

Facts come from the model description alone; no code of the FMU runs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

from vibroimpact.fmus.packaging.archive import content_hash
from vibroimpact.fmus.packaging.fmpy_door import ModelDescription, read_description
from vibroimpact.fmus.units import BASE_UNITS, Unit, declared_unit

VariableKind = Literal["real", "integer", "enumeration", "boolean", "text", "binary", "clock"]
#: Kinds that are numbers in a dataset.
NUMERIC_KINDS: tuple[VariableKind, ...] = ("real", "integer", "enumeration", "boolean")

_KINDS: dict[str, VariableKind] = {
    "Enumeration": "enumeration",
    "Boolean": "boolean",
    "String": "text",
    "Binary": "binary",
    "Clock": "clock",
}
_MOST_CACHED = 64


@dataclass(frozen=True, slots=True)
class VariableFacts:
    """One variable of an FMU.

    Attributes
    ----------
    name, reference, kind, type
        Its name, value reference, what it holds, and FMI's word for its type.
    causality, variability, initial : str
        FMI's words.
    unit : Unit or None
        None when the description does not say.
    unit_name : str
        The unit as the description writes it; may be empty.
    minimum, maximum : float or None
        What the description allows.
    items : mapping of str to int
        Names of an enumeration.
    scalar : bool
        Whether it is one number and not an array.
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
    scalar: bool

    @property
    def settable(self) -> bool:
        """Whether FMI lets an importer give its start value."""
        if self.variability == "constant" or self.causality in ("structuralParameter", "independent"):
            return False
        return self.causality == "input" or self.initial in ("exact", "approx")


@dataclass(frozen=True, slots=True)
class ComponentFacts:
    """An FMU: its file, its variables by name, whether it steps itself, whether its state can be kept.

    Attributes
    ----------
    scheduled : bool
        It can be run by scheduled execution.
    event_mode : bool
        It handles events in event mode when it steps itself.
    """

    file: str
    variables: Mapping[str, VariableFacts]
    co_simulation: bool
    restorable: bool
    scheduled: bool
    event_mode: bool


def component_facts(path: Path) -> ComponentFacts:
    """Read the facts of an FMU, or take them from the cache if a file of the same contents was read before.

    Raises
    ------
    ComponentFileError
        The file is missing, unsafe, or its description breaks FMI's rules.
    """
    return _facts(content_hash(path), path)


@lru_cache(maxsize=_MOST_CACHED)
def _facts(sha256: str, path: Path) -> ComponentFacts:
    description: ModelDescription = read_description(path)
    units = {unit.name: _unit(unit) for unit in description.unitDefinitions}
    variables = {variable.name: _variable(variable, units) for variable in description.modelVariables}
    stepped = description.coSimulation
    return ComponentFacts(
        path.name,
        variables,
        co_simulation=stepped is not None,
        restorable=stepped is not None and stepped.canGetAndSetFMUstate,
        scheduled=description.scheduledExecution is not None,
        event_mode=stepped is not None and bool(getattr(stepped, "hasEventMode", False)),
    )


def _unit(definition: Any) -> Unit | None:
    """Return a defined unit; a definition may be a name alone, which says nothing of its meaning."""
    base = definition.baseUnit
    if base is None:
        return None
    return declared_unit(
        definition.name, {name: getattr(base, name) for name in BASE_UNITS}, base.factor, base.offset
    )


def _variable(variable: Any, units: Mapping[str, Unit | None]) -> VariableFacts:
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
        scalar=not variable.dimensions,
    )


def _kind(fmi_type: str) -> VariableKind:
    if fmi_type in _KINDS:
        return _KINDS[fmi_type]
    return "real" if fmi_type.startswith(("Real", "Float")) else "integer"


def _limit(own: str | None, declared: str | None) -> float | None:
    text = declared if own is None else own
    return None if text is None else float(text)

"""Facts that an importer reads in the description of an FMU."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from vibroimpact.fmus.errors import ComponentError, ComponentFileError
from vibroimpact.fmus.packaging.archive import shown_name
from vibroimpact.orchestrator.fmi.exchange import ExchangeFacts
from vibroimpact.orchestrator.fmi.shapes import Shape, default_sizes, dimensions_of, shape_of
from vibroimpact.orchestrator.importer.specification import ComponentSpec, StartValue

if TYPE_CHECKING:
    from vibroimpact.fmus.packaging.fmpy_door import ModelDescription, ModelVariable

#: FMI types by the kind of call that moves them in FMI 3.0; FMI 2.0's names are translated.
KINDS = {"Real": "Float64", "Integer": "Int64", "Enumeration": "Int64"}

Kind = Literal["co_simulation", "model_exchange"]


@lru_cache(maxsize=64)
def description_of(fmu: Path) -> ModelDescription:
    """Return the description of an FMU file, read once for each process."""
    # a run of our bodies alone needs neither a description nor FMPy
    from vibroimpact.fmus.packaging.fmpy_door import read_description

    return read_description(fmu)


def kind_of(variable: ModelVariable) -> str:
    """Return the kind of a variable: the FMI 3.0 name of the calls that move it."""
    name: str = variable.type
    return KINDS.get(name, name)


def kind_that_runs(spec: ComponentSpec, description: ModelDescription) -> Kind:
    """Return the kind of an FMU that runs; ComponentFileError if the FMU lacks the requested kind."""
    offered: dict[Kind, object] = {
        "co_simulation": description.coSimulation,
        "model_exchange": description.modelExchange,
    }
    kinds = [kind for kind, interface in offered.items() if interface is not None]
    if spec.run_as in kinds or (spec.run_as == "auto" and kinds):
        return kinds[0] if spec.run_as == "auto" else spec.run_as
    wanted = "co-simulation or model exchange" if spec.run_as == "auto" else spec.run_as.replace("_", "-")
    got = "scheduled execution" if not kinds else kinds[0].replace("_", "-")
    raise ComponentFileError(f"{shown_name(spec.fmu)}: expected an FMU with {wanted}, got {got} only.")


def exchange_facts(
    description: ModelDescription, tolerance: float, *, gives_derivatives: bool = False
) -> ExchangeFacts:
    """Return the facts of an FMU for model exchange, with the relative tolerance of its solver."""
    interface = description.modelExchange
    inputs = [v for v in description.modelVariables if v.causality == "input"]
    return ExchangeFacts(
        states=int(description.numberOfContinuousStates or 0),
        indicators=int(description.numberOfEventIndicators or 0),
        tolerance=tolerance,
        needs_completed=bool(interface.needsCompletedIntegratorStep),
        restorable=bool(interface.canGetAndSetFMUstate),
        discrete=frozenset((kind_of(v), v.valueReference) for v in inputs if v.variability != "continuous"),
        derivatives=tuple(
            u.variable.valueReference for u in description.derivatives if u.variable is not None
        ),
        gives_derivatives=gives_derivatives,
    )


def loses_memory(description: ModelDescription) -> bool:
    """Does each instance leak memory? The binary of PythonFMU 0.7 leaks 18 kB and an entry of sys.path."""
    return str(description.generationTool or "").startswith("PythonFMU")


def shapes_of(
    variables: Mapping[str, ModelVariable], parameters: Mapping[str, StartValue]
) -> dict[str, Shape]:
    """Return the shape of each array where some structural parameters have start values."""
    sizes = default_sizes(variables)
    sizes |= {name: value for name, value in parameters.items() if name in sizes and isinstance(value, int)}
    return {name: shape_of(dimensions, sizes) for name, dimensions in dimensions_of(variables).items()}


def item_value(component: str, variable: ModelVariable, name: str) -> int:
    """Value of an enumeration's item."""
    items = variable.declaredType.items if variable.declaredType is not None else []
    for item in items:
        if item.name == name:
            return int(item.value)
    known = ", ".join(str(item.name) for item in items) or "none: it is no enumeration"
    raise ComponentError(
        f"{component}.{variable.name}: expected one of {known}, got {name!r}.", instance=component
    )


def dependencies_of(description: ModelDescription) -> dict[str, frozenset[str]]:
    """Return the inputs that each output depends on directly, as declared; an output that declares nothing has none.

    An absent list means "perhaps all" in FMI. Importers that iterate on it find no real loop; all known importers
    treat it as none.
    """
    return {
        unknown.variable.name: frozenset(v.name for v in unknown.dependencies or () if v.causality == "input")
        for unknown in description.outputs
        if unknown.variable is not None
    }

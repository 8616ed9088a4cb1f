"""A component for other tools, without the variables that only this package's importer uses.

OMSimulator writes no result if an output is NaN before its first event, or if there is an array. libcosim and Ecos
cannot set an enumeration. The binary is the same: variables outside of the description keep their values.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.packaging.description.model import (
    ComponentDescription,
    Enumeration,
    Number,
    UnitDefinition,
    Variable,
)

#: Ports of the clock of the strobes and of its variables.
STROBES = "strobes"


@dataclass(frozen=True, slots=True)
class Experiment:
    """Default experiment of a description: start and stop time and step, s, and a relative tolerance."""

    stop_time: float = 10.0
    step_size: float = 0.01
    start_time: float = 0.0
    tolerance: float = 1e-6


@dataclass(frozen=True, slots=True)
class Edition:
    """Version of the package that wrote a description, time of writing (may be empty), and the default experiment."""

    version: str
    date_and_time: str
    experiment: Experiment


def lean(
    component: ComponentDescription,
    *,
    external: bool = False,
    enumerations: bool = False,
    model_exchange: bool = False,
) -> ComponentDescription:
    """Return a component without the variables that few tools can handle.

    `external` keeps the variables of tools that answer contacts themselves: applied forces, contact masses, instants of
    contacts. Without `enumerations`, enumerations become integers, with the names in their descriptions.
    `model_exchange` keeps the states of given modes: without them such a component is for co-simulation alone.
    """
    if component.has_given_modes and not model_exchange:
        component = _without_states(component)
    left_out = {"importer"} if external else {"importer", "external"}
    types = {e.name: _without(e, left_out) for e in component.enumerations}
    kept = [v for v in component.variables if v.ports not in left_out and not v.dimensions]
    if not enumerations:
        kept = [_as_integer(v, types[v.enumeration]) if v.enumeration else v for v in kept]
    units = {v.unit for v in kept}
    return replace(
        component,
        units=tuple(unit for unit in component.units if unit.name in units),
        enumerations=tuple(types.values()) if enumerations else (),
        variables=tuple(kept),
    )


def with_structural(component: ComponentDescription) -> ComponentDescription:
    """Return a component with its numbers of modes, masses and contacts as structural parameters (FMI 3.0).

    Raises
    ------
    UsageError
        The component has no such number.
    """
    _expect_option(component, "structural", any(v.counts for v in component.variables))
    counted = (
        replace(v, causality="structuralParameter", versions=(3,)) if v.counts else v
        for v in component.variables
    )
    return replace(component, variables=tuple(counted))


def with_strobes(component: ComponentDescription) -> ComponentDescription:
    """Return a component with the clock of the strobes and its variables (FMI 3.0).

    Raises
    ------
    UsageError
        The component has no forcing.
    """
    _expect_option(component, STROBES, any(v.ports == STROBES for v in component.variables))
    shown = (replace(v, versions=(3,)) if v.ports == STROBES else v for v in component.variables)
    return replace(component, variables=tuple(shown))


def _expect_option(component: ComponentDescription, option: str, there: bool) -> None:
    if not there:
        raise UsageError(
            f"{component.name}: {option}: expected a body with it (Oscillator, Chain, Beam, Structure), got another "
            "component. Leave the option out."
        )


def with_starts(component: ComponentDescription, starts: Mapping[str, Number]) -> ComponentDescription:
    """Return a component with other start values, by variable name."""
    changed = (replace(v, start=starts[v.name]) if v.name in starts else v for v in component.variables)
    return replace(component, variables=tuple(changed))


def with_units(component: ComponentDescription, units: Mapping[str, UnitDefinition]) -> ComponentDescription:
    """Return a component with units, by name, for variables that have no unit of their own."""
    known = {unit.name: unit for unit in (*component.units, *units.values())}
    named = (replace(v, unit=units[v.name].name) if v.name in units else v for v in component.variables)
    return replace(component, units=tuple(known.values()), variables=tuple(named))


def _without_states(component: ComponentDescription) -> ComponentDescription:
    """Return a component for co-simulation alone: without states, their derivatives and event indicators."""
    states = set(component.states())
    kept = (v for v in component.variables if not (v.name in states or v.derivative or v.event_indicator))
    return replace(component, model_exchange=False, variables=tuple(kept))


def _without(enumeration: Enumeration, left_out: set[str]) -> Enumeration:
    return replace(enumeration, items=tuple(item for item in enumeration.items if item.ports not in left_out))


def _as_integer(variable: Variable, enumeration: Enumeration) -> Variable:
    values = [item.value for item in enumeration.items]
    names = ", ".join(f"{item.value} {item.name}" for item in enumeration.items)
    return replace(
        variable,
        type="Int64",
        enumeration="",
        minimum=min(values),
        maximum=max(values),
        description=f"{variable.description}: {names}",
    )

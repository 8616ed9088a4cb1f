"""The C header of a component: value references, token and the table by which the adapters read and write."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Set as AbstractSet

from vibroimpact.fmus.packaging.description.model import ComponentDescription, Variable

C_TYPES = {
    **{"Float64": "VI_FLOAT64", "Int64": "VI_INT64", "Boolean": "VI_BOOLEAN"},
    **{"Enumeration": "VI_INT64", "Clock": "VI_CLOCK"},
}


def header_name(component: ComponentDescription) -> str:
    """Return the file name of the generated header."""
    return f"{component.folder}_variables.h"


def c_header(component: ComponentDescription) -> str:
    """Return the text of `<folder>_variables.h`; the index into the table is the value reference."""
    return "\n".join(_lines(component)) + "\n"


def _lines(component: ComponentDescription) -> Iterator[str]:
    prefix = component.folder.upper()
    guard = f"{prefix}_VARIABLES_H"
    yield f"/* Generated from {component.folder}/variables.toml; edit that file and build again. */"
    yield from (f"#ifndef {guard}", f"#define {guard}", "")
    yield from (
        "#include <stddef.h>",
        '#include "component.h"',
        f'#include "{component.header}"',
        "",
        "enum {",
    )
    yield from (f"    {prefix}_{v.code} = {v.value_reference}," for v in component.variables)
    yield from ("};", "", f"static const vi_variable {component.folder}_variables[] = {{")
    states = frozenset(component.states())
    yield from (_row(component, v, states) for v in component.variables)
    yield from ("};", *_states(component, prefix), *_description(component), "", "#endif")


def _states(component: ComponentDescription, prefix: str) -> Iterator[str]:
    """Yield the table of the continuous states, in their order; yield nothing if there are none."""
    codes = {v.name: v.code for v in component.variables}
    states = component.states()
    if states:
        yield from ("", f"static const uint32_t {component.folder}_states[] = {{")
        yield from (f"    {prefix}_{codes[name]}," for name in states)
        yield "};"


def _description(component: ComponentDescription) -> Iterator[str]:
    """Yield the description that the adapters link; only one C file includes the header."""
    (time,) = (v.field for v in component.variables if v.causality == "independent")
    yield from ("", "const vi_description vi_this_description = {", f'    .token = "{component.token}",')
    yield f"    .struct_size = sizeof({component.struct}),"
    yield f"    .time = offsetof({component.struct}, {time}),"
    yield f"    .variables = {component.folder}_variables,"
    yield f"    .variable_count = {len(component.variables)},"
    if states := component.states():
        yield f"    .states = {component.folder}_states,"
        yield f"    .state_count = {len(states)},"
    yield "};"


def _row(component: ComponentDescription, variable: Variable, states: AbstractSet[str]) -> str:
    offset = f"offsetof({component.struct}, {variable.field})"
    kind = f"{C_TYPES[variable.type]}, {_access(variable, states)}, {variable.count}u"
    return f"    {{{kind}, {offset}}}, /* {variable.name} */"


def _access(variable: Variable, states: AbstractSet[str]) -> str:
    if variable.name in states:
        return "VI_SET_STATE"
    if variable.counts:
        return "VI_SET_STRUCTURAL"
    if variable.causality == "input":
        return "VI_SET_INPUT"
    if variable.causality == "parameter" and variable.variability == "tunable":
        return "VI_SET_TUNABLE"
    return "VI_SET_INITIAL" if variable.initial in {"exact", "approx"} else "VI_READ_ONLY"

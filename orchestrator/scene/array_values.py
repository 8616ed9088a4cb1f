"""Arrays and texts of FMUs in a scene: their shapes, start values, and forms in a dataset."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from vibroimpact.analysis.dataset.sample_forms import TEXT, SampleForm
from vibroimpact.orchestrator.fmi.shapes import STRUCTURAL, Shape, shape_of
from vibroimpact.orchestrator.importer.specification import StartValue
from vibroimpact.orchestrator.scene.component_facts import (
    ComponentFacts,
    Misfit,
    VariableFacts,
    typed_value,
)

MOST_ELEMENTS = 10**6
"""Largest number of elements of an array in a scene."""
#: Types whose values float64 does not hold exactly.
_LONG = {"Int64": "int64", "UInt64": "uint64", "Enumeration": "int64"}


def array_shape(
    facts: ComponentFacts, variable: VariableFacts, parameters: Mapping[str, StartValue]
) -> Shape:
    """Return the shape of a variable where structural parameters have start values; empty for a single value."""
    given = {name: value for name, value in parameters.items() if name in facts.sizes}
    return shape_of(variable.dimensions, {**facts.sizes, **given})  # type: ignore[dict-item]  # sizes are whole numbers


def given_value(variable: VariableFacts, value: object, shape: Shape) -> StartValue | Misfit:
    """Return a start value in the type of its variable: an array as a tuple of its elements, in rows.

    Parameters
    ----------
    variable : VariableFacts
    value : object
        A value of a TOML document: an array is lists in lists, as deep as its dimensions.
    shape : tuple of int
        Shape of the variable; empty for a single value.
    """
    if variable.scalar:
        return typed_value(variable, value)
    expected = Misfit(f"an array of the shape {shape_words(shape)}")
    if math.prod(shape) > MOST_ELEMENTS:
        return Misfit(f"an array of at most {MOST_ELEMENTS} elements")
    elements = list(_elements(value, shape))
    if None in elements:
        return expected
    typed = [typed_value(variable, element) for element in elements]
    wrong = next((one for one in typed if isinstance(one, Misfit)), None)
    if wrong is not None:
        return Misfit(f"elements that are each {wrong.expected}", wrong.hint)
    return tuple(one for one in typed if not isinstance(one, Misfit))


def shape_words(shape: Shape) -> str:
    """Return a shape in words: `3`, `2 x 3`."""
    return " x ".join(map(str, shape)) or "a single value"


def _elements(value: object, shape: Shape) -> Iterator[object]:
    """Yield the elements of lists in lists of a shape; None where the lists have another shape."""
    if not shape:
        yield None if isinstance(value, list) else value
    elif not isinstance(value, list) or len(value) != shape[0]:
        yield None
    else:
        for part in value:
            yield from _elements(part, shape[1:])


def sample_form(variable: VariableFacts, shape: Shape) -> SampleForm | None:
    """Return the form of a variable in a dataset; None for a plain number, which is a float64."""
    if variable.kind == "text":
        return SampleForm(TEXT, shape)
    dtype = _LONG.get(variable.type, "float64")
    if dtype == "float64" and variable.scalar:
        return None
    return SampleForm(dtype, shape, variable.items)


def structural_dimensions(variable: VariableFacts) -> tuple[str, ...]:
    """Return the structural parameters that give the size of a variable."""
    return tuple(one for one in variable.dimensions if isinstance(one, str))


def is_structural(variable: VariableFacts) -> bool:
    """Return whether a variable is a structural parameter."""
    return variable.causality == STRUCTURAL

"""The shapes of the arrays of an FMU: fixed sizes, or sizes that structural parameters give (FMI 3.0, 2.4.7.6)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from vibroimpact.fmus.packaging.fmpy_door import ModelVariable

#: Causality of parameters that are sizes; they are set in configuration mode.
STRUCTURAL = "structuralParameter"
Shape = tuple[int, ...]
Dimensions = tuple[int | str, ...]
"""Dimensions of an array: a size, or the name of the structural parameter that gives it."""


def dimensions_of(variables: Mapping[str, ModelVariable]) -> dict[str, Dimensions]:
    """Return the dimensions of each array, by the name of the variable."""
    names = {variable.valueReference: name for name, variable in variables.items()}
    return {
        name: tuple(
            names[one.valueReference] if one.start is None else int(one.start) for one in variable.dimensions
        )
        for name, variable in variables.items()
        if variable.dimensions
    }


def default_sizes(variables: Mapping[str, ModelVariable]) -> dict[str, int]:
    """Return the start values of structural parameters that are whole numbers, and of sizes that are constants.

    Only UInt64 gives a size: a structural parameter of another type, such as a truth value, is none.
    """
    sizes = {name for each in dimensions_of(variables).values() for name in each if isinstance(name, str)}
    return {
        name: int(variable.start)
        for name, variable in variables.items()
        if variable.start is not None
        and (name in sizes or (variable.causality == STRUCTURAL and variable.type == "UInt64"))
    }


def shape_of(dimensions: Dimensions, sizes: Mapping[str, int]) -> Shape:
    """Return the shape of an array where structural parameters have these values.

    >>> shape_of((3, "n"), {"n": 2})
    (3, 2)
    """
    return tuple(sizes[one] if isinstance(one, str) else one for one in dimensions)

"""The functions of the Python door have the arguments of the declared operations, with their defaults."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from dataclasses import MISSING

import pytest
from support import public_names
from support.operations import OPERATIONS

import vibroimpact as vi
from vibroimpact.fmus.operations import Operation
from vibroimpact.fmus.operations.declaring import Field
from vibroimpact.orchestrator.commands import table

IN_PYTHON = {words: one for words, one in OPERATIONS.items() if one.door is not None}


def form(field: Field) -> str:
    """Return an argument in the form of a Python signature; empty if the function does not have it."""
    if field.words.python is not None:
        return field.words.python
    kind = field.type.__name__ if inspect.isclass(field.type) else str(field.type)
    default = "" if field.default is MISSING else f" = {field.default!r}"
    return f"{field.name}: {kind.replace('pathlib.', '')}{default}"


def forms(operation: type[Operation]) -> Iterator[str]:
    assert operation.door is not None
    yield from operation.door.also
    for field in operation.fields():
        if field.name not in operation.door.without and form(field):
            yield form(field)


def parameter(one: inspect.Parameter) -> str:
    default = "" if one.default is inspect.Parameter.empty else f" = {one.default!r}"
    return f"{one.name}: {one.annotation}{default}"


@pytest.mark.parametrize("words", IN_PYTHON)
def test_a_function_of_the_door_has_the_arguments_of_its_operation(words: str) -> None:
    operation = IN_PYTHON[words]
    assert operation.door is not None
    function = getattr(vi, operation.door.name)
    found = [parameter(one) for one in inspect.signature(function).parameters.values()]
    assert sorted(found) == sorted(forms(operation))


def test_the_list_of_commands_has_the_first_lines_of_their_help() -> None:
    assert public_names.first_lines() == table.FIRST_LINES.read_text(encoding="utf-8"), (
        "run python -P tests/support/public_names.py"
    )

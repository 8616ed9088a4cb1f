"""The declared operations of each package."""

from __future__ import annotations

import inspect
import pkgutil

from vibroimpact.analysis.study import Study
from vibroimpact.fmus.operations import Operation
from vibroimpact.orchestrator.commands import table


def declared(place: str) -> type[Operation]:
    """Return the operation that is declared at `module:class`."""
    found: type[Operation] = pkgutil.resolve_name(f"vibroimpact.{place}")
    return found


OPERATIONS = {words: declared(place) for words, place in table.paths().items()}


def of_package(package: str) -> dict[str, type[Operation]]:
    """Return the operations that a package declares, by the words of their commands."""
    return {
        words: declared(place) for words, place in table.paths().items() if place.startswith(f"{package}.")
    }


def assert_sound(operation: type[Operation]) -> None:
    """Assert that each argument has a help text, and that the function takes the operation and optional keywords."""
    assert all(field.words.help for field in operation.fields())
    if operation.study:
        assert issubclass(pkgutil.resolve_name(f"vibroimpact.{operation.study}"), Study)
        return
    parameters = inspect.signature(pkgutil.resolve_name(f"vibroimpact.{operation.runs}")).parameters
    first, *others = parameters.values()
    assert first.annotation == operation.__name__
    assert all(one.default is not one.empty for one in others)

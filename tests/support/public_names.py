"""The public interface as text: `python -P tests/support/public_names.py` writes all of it anew.

Names have their signature and the first line of their description. Commands have the options known to typer: the
boxes around them change with the versions of typer and rich. The service has its OpenAPI document, a scene its keys,
a dataset its variables and attributes.
"""

from __future__ import annotations

import enum
import inspect
import json
import pkgutil
import re
import sys
import typing
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import typer

import vibroimpact as vi
from vibroimpact.orchestrator.commands import table
from vibroimpact.orchestrator.commands.cli import app, load_commands

TESTS = Path(__file__).resolve().parents[1]
NAMES, COMMANDS = TESTS / "unit" / "door" / "names.txt", TESTS / "unit" / "door" / "commands.txt"
OPENAPI = TESTS / "unit" / "service" / "openapi.json"
SCENE_KEYS = TESTS / "unit" / "orchestrator" / "scene" / "keys.txt"
DATASETS = TESTS / "end_to_end" / "datasets.txt"


def names() -> str:
    """Return each name of `vibroimpact` with signature and first line, and the names in its classes and modules."""
    return "".join(f"{line}\n" for name in dir(vi) for line in _lines_of(name, getattr(vi, name)))


def _lines_of(name: str, value: object) -> Iterator[str]:
    if isinstance(value, str):
        yield f"{name}: str"
        return
    yield f"{name}{_signature(value)}: {_first_line(value)}"
    for inner in _inner_names(value):
        yield f"    {name}.{inner}{_inner_signature(value, inner)}"


def _inner_names(value: object) -> list[str]:
    """Return the names in a module, or the members that a class of this package defines itself."""
    if isinstance(value, ModuleType):
        return sorted(value.__all__)
    if not inspect.isclass(value):
        return []
    found = {name for one in _own_classes(value) for name in (*vars(one), *inspect.get_annotations(one))}
    return sorted(name for name in found if not name.startswith(("_", "model_")))


def _own_classes(value: type) -> list[type]:
    return [one for one in value.__mro__ if one.__module__.startswith("vibroimpact")]


def _inner_signature(owner: Any, name: str) -> str:
    if inspect.isclass(owner):
        for one in _own_classes(owner):
            if name in inspect.get_annotations(one):
                return f": {inspect.get_annotations(one)[name]}"
        if not callable(getattr(owner, name)):
            return f": {_first_line(getattr(owner, name))}"
    return _signature(getattr(owner, name))


def _signature(value: Any) -> str:
    """Return the arguments of a callable.

    Exceptions and enumerations have the arguments that Python gives them; a model of pydantic has its fields.
    """
    if not callable(value) or (inspect.isclass(value) and issubclass(value, BaseException | enum.Enum)):
        return ""
    if hasattr(value, "model_fields"):
        return f"(*, {', '.join(value.model_fields)})"
    return re.sub(" at 0x[0-9a-f]+", "", str(inspect.signature(value)))


def _first_line(value: object) -> str:
    return (inspect.getdoc(value) or "").partition("\n")[0]


def commands() -> str:
    """Return each command of `vibroimpact` with its help, its arguments and its options."""
    load_commands()
    return "".join(f"{line}\n" for line in _lines_of_command(typer.main.get_command(app), "vibroimpact"))


def _lines_of_command(command: Any, name: str) -> Iterator[str]:
    yield name
    yield from (f"    {line}".rstrip() for line in (command.help or "").splitlines())
    annotations = (
        inspect.get_annotations(inspect.unwrap(command.callback), eval_str=True) if command.callback else {}
    )
    for parameter in command.params:
        if parameter.name in annotations:
            yield f"  {_parameter(parameter, annotations[parameter.name])}"
    for word, inner in sorted(getattr(command, "commands", {}).items()):
        if not inner.hidden:
            yield from _lines_of_command(inner, f"{name} {word}")


def _parameter(given: Any, annotation: Any) -> str:
    """Return an argument or option as text: its names, type, limits, default and help."""
    kind, declared = typing.get_args(annotation)
    said = [
        getattr(kind, "__name__", "")
        if inspect.isclass(kind)
        else str(kind).replace("pathlib._local.", "").replace("pathlib.", "")
    ]
    said += [
        f"{word} {value}"
        for word in ("min", "max", "metavar")
        if (value := getattr(declared, word)) is not None
    ]
    said += ["required" if given.required else f"default {given.default!s}"]
    return f"{' '.join((*given.opts, *given.secondary_opts))} ({', '.join(said)}): {declared.help or ''}"


def first_lines() -> str:
    """Return the first lines of the commands' help, as in a list of commands."""
    lines = {words: _first_paragraph(_declared(place)) for words, place in table.paths().items()}
    return json.dumps(lines, indent=1) + "\n"


def _declared(place: str) -> type:
    found: type = pkgutil.resolve_name(f"vibroimpact.{place}")
    return found


def _first_paragraph(declared: type) -> str:
    return " ".join((inspect.getdoc(declared) or "").partition("\n\n")[0].split())


def main() -> None:
    """Write each text to its file."""
    sys.path.insert(0, str(TESTS))
    from support.dataset_kinds import datasets
    from support.openapi import openapi
    from support.scene_keys import scene_keys

    texts = {
        table.FIRST_LINES: first_lines,
        NAMES: names,
        COMMANDS: commands,
        OPENAPI: openapi,
        SCENE_KEYS: scene_keys,
        DATASETS: datasets,
    }
    for path, text in texts.items():
        path.write_text(text(), encoding="utf-8")


if __name__ == "__main__":
    main()

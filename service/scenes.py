"""Scenes that come over the network: what of them the service takes, and where their problems are."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from vibroimpact.fmus.errors import SceneError
from vibroimpact.fmus.safe_toml import parse_toml
from vibroimpact.fmus.shipped import components
from vibroimpact.orchestrator.scene import Scene, parse_scene
from vibroimpact.orchestrator.scene.file import parse_scene_toml

SOURCE = "scene"
"""What messages about a submitted scene begin with."""
_SYNTAX = re.compile(r"line (\d+), column (\d+)")
_KEY = re.compile(rf"^{SOURCE}: ([A-Za-z_][\w\-]*(?:\[\d+\])?(?:\.[\w\-\"]+(?:\[\d+\])?)*): ")
_HEADER = re.compile(r"^\s*(\[\[?)\s*([^\[\]]+?)\s*\]\]?\s*(?:#.*)?$")
_ENTRY = re.compile(r"^(\s*)([\w\-\".]+)\s*=")


def taken_scene(text: str) -> Scene:
    """Return a scene that was submitted.

    Parameters
    ----------
    text : str
        TOML.

    Raises
    ------
    SceneError
        With all of its problems; among them components that are files, and recordings: a stranger names no paths here.
    """
    document = parse_scene_toml(text, SOURCE)
    problems = [*_foreign_components(document), *_recordings(document)]
    if problems:
        raise SceneError(problems)
    return parse_scene(text, SOURCE)


def _foreign_components(document: Mapping[str, Any]) -> list[str]:
    tables = document.get("component", {})
    if not isinstance(tables, Mapping):
        return []
    named = {name: table.get("fmu") for name, table in tables.items() if isinstance(table, Mapping)}
    shipped = components()
    known = ", ".join(sorted(shipped))
    return [
        f"{SOURCE}: component.{name}.fmu: expected one of {known}, got {fmu!r}. "
        "This service loads no FMU but those of the package."
        for name, fmu in named.items()
        if fmu is not None and fmu not in shipped
    ]


def _recordings(document: Mapping[str, Any]) -> list[str]:
    if "replay" not in document:
        return []
    return [
        f"{SOURCE}: replay: expected a scene without recordings, got [replay]. Use the command line for it."
    ]


def located(problem: str, text: str) -> dict[str, Any]:
    """Return a problem with its line and column in the text, both from 1; those of its table where its key is absent.

    Examples
    --------
    >>> located("scene: body.mass: expected a number > 0, got -1.", "# a mass\\n[body]\\n  mass = -1")
    {'message': 'body.mass: expected a number > 0, got -1.', 'line': 3, 'column': 3}
    """
    message = problem.removeprefix(f"{SOURCE}: ")
    syntax = _SYNTAX.search(problem)
    if syntax:
        return {"message": message, "line": int(syntax[1]), "column": int(syntax[2])}
    key = _KEY.match(problem)
    line, column = _place(key[1], text) if key else (1, 1)
    return {"message": message, "line": line, "column": column}


def _place(key: str, text: str) -> tuple[int, int]:
    """Return where a key such as `stop[2].position` is written; else its nearest table; else the beginning."""
    wanted = re.sub(r"\[(\d+)\]$", "", key)
    table, best, counts = "", (1, 1, 0), dict[str, int]()
    for number, line in enumerate(text.splitlines(), 1):
        header, entry = _HEADER.match(line), _ENTRY.match(line)
        column = 1
        if header:
            table = header[2].replace('"', "")
            if header[1] == "[[":
                counts[table] = counts.get(table, 0) + 1
                table = f"{table}[{counts[table]}]"
            full = table
        elif entry:
            full = f"{table}.{entry[2]}".lstrip(".").replace('"', "")
            column = len(entry[1]) + 1
        else:
            continue
        shared = len(full) if wanted == full or wanted.startswith((f"{full}.", f"{full}[")) else 0
        if shared > best[2]:
            best = (number, column, shared)
    return best[:2]


def title_of(text: str) -> str:
    """Return the title that a scene gives itself; empty without one."""
    header = parse_toml(text).get("scene", {})
    return str(header.get("title", "")) if isinstance(header, Mapping) else ""

"""Scenes that come over the network: what of them the service takes, and where their problems are."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vibroimpact.fmus.errors import SceneError, UsageError
from vibroimpact.fmus.safe_toml import parse_toml
from vibroimpact.fmus.shipped import components
from vibroimpact.orchestrator.scene import Scene, parse_scene
from vibroimpact.orchestrator.scene.file import parse_scene_toml
from vibroimpact.orchestrator.scene.replay_models import RECORDING_KEY
from vibroimpact.orchestrator.scene.text import text_with_values
from vibroimpact.service.fmus import FmuStore
from vibroimpact.service.recordings import RecordingStore
from vibroimpact.service.store import Kind

SOURCE = "scene"
"""What messages about a submitted scene begin with."""
_SYNTAX = re.compile(r"line (\d+), column (\d+)")
_KEY = re.compile(rf"^{SOURCE}: ([A-Za-z_][\w\-]*(?:\[\d+\])?(?:\.[\w\-\"]+(?:\[\d+\])?)*): ")
_HEADER = re.compile(r"^\s*(\[\[?)\s*([^\[\]]+?)\s*\]\]?\s*(?:#.*)?$")
_TEXT = re.compile(
    r'''"""(?:\\.|[^\\])*?"""|\'{3}.*?\'{3}|"(?:\\.|[^"\\\n])*"|\'[^\'\n]*\'|#[^\n]*''', re.DOTALL
)
"""Texts and comments of TOML, of which those of several lines are looked for."""
BOM = "\ufeff"
_ENTRY = re.compile(r"^(\s*)([\w\-\".]+)\s*=")


@dataclass(frozen=True, slots=True)
class Shelf:
    """What a scene that was submitted may name: recordings and FMUs of the service."""

    recordings: RecordingStore
    fmus: FmuStore


@dataclass(frozen=True, slots=True)
class Taken:
    """A scene that was submitted.

    Attributes
    ----------
    scene : Scene
    text : str
        TOML, with the recordings that were named beside it.
    files : dict of str to Path
        The files of the service that it reads, by the names it has for them.
    """

    scene: Scene
    text: str
    files: dict[str, Path]

    @property
    def kind(self) -> Kind:
        """What running it makes: recordings alone are no sweep, since one replay compares them all."""
        if self.scene.replay is not None and all(axis.key == RECORDING_KEY for axis in self.scene.sweep):
            return Kind.replay
        return Kind.campaign if self.scene.sweep else Kind.run


def taken_scene(text: str, shelf: Shelf, recordings: Sequence[str] = ()) -> Taken:
    """Return a scene that was submitted.

    Parameters
    ----------
    text : str
        TOML.
    shelf : Shelf
    recordings : sequence of str
        Names or ids of recordings that the scene replays, where it names none itself.

    Raises
    ------
    SceneError
        With all of its problems; among them files that the service does not have: a stranger names no paths here.
    """
    document = parse_scene_toml(text, SOURCE)
    files, problems = _files(document, shelf)
    for place, name in enumerate(recordings, 1):
        problems += linked(f"recordings[{place}]", name, shelf, files)
    if problems:
        raise SceneError(problems)
    # files count from the folder of the scene
    source = str(shelf.fmus.folder / SOURCE)
    try:
        scene = parse_scene(text, source)
        if recordings and not (scene.replay is not None and not scene.replay.recordings):
            raise SceneError(
                [f"{SOURCE}: replay.recordings: expected [replay] without recordings beside others."]
            )
        if recordings:
            text = text_with_values(text, {}, recordings)
            scene = parse_scene(text, source)
    except SceneError as error:
        raise SceneError([problem.replace(source, SOURCE) for problem in error.problems]) from None
    if scene.replay is not None and not scene.replay.recordings:
        raise SceneError(
            [f"{SOURCE}: replay.recordings: expected a recording to replay, got none. Name one."]
        )
    return Taken(scene, text, files)


def _files(document: Mapping[str, Any], shelf: Shelf) -> tuple[dict[str, Path], list[str]]:
    """Return the files that a scene names, each found in the service, and what is wrong with the names."""
    files, problems = dict[str, Path](), list[str]()
    tables = document.get("component", {})
    for name, table in tables.items() if isinstance(tables, Mapping) else ():
        fmu = table.get("fmu") if isinstance(table, Mapping) else None
        if fmu is None or fmu in components():
            continue
        file = shelf.fmus.find(fmu) if isinstance(fmu, str) else None
        if file is not None:
            files[fmu] = file
        else:
            problems.append(
                f"{SOURCE}: component.{name}.fmu: expected one of {', '.join(known_fmus(shelf))}, got {fmu!r}. "
                "This service loads no FMU but those of the package and its own."
            )
    replay = document.get("replay")
    named = replay.get("recordings") if isinstance(replay, Mapping) else None
    for place, name in enumerate(named if isinstance(named, list) else (), 1):
        problems += linked(f"replay.recordings[{place}]", name, shelf, files)
    return files, problems


def known_fmus(shelf: Shelf) -> list[str]:
    """Return all FMUs that a scene may name."""
    return [*sorted(components()), *shelf.fmus.names()]


def linked(key: str, name: Any, shelf: Shelf, files: dict[str, Path]) -> list[str]:
    """Note the file of a recording; return what is wrong with its name."""
    try:
        files[name] = shelf.recordings.file(shelf.recordings.find(str(name)))
    except UsageError as error:
        return [f"{SOURCE}: {key}: {error}"]
    except KeyError:
        return [
            f"{SOURCE}: {key}: expected the name of a recording of this service, got {str(name)[:200]!r}. "
            "Upload it first."
        ]
    return []


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
    # TOML ends lines at these alone; and what a text of several lines holds is no key
    for number, line in enumerate(_TEXT.sub(_blank, text.removeprefix(BOM)).split("\n"), 1):
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
            best = (number, _within(line, column, wanted[len(full) :]) if entry else column, shared)
    return best[:2]


def _within(line: str, column: int, rest: str) -> int:
    """Return the column of what is left of a key in the inline tables of a line; else that of the line's own key."""
    index = re.match(r"\[(\d+)\]", rest)
    name = re.escape(rest.rpartition(".")[2])
    found = [one.start(1) + 1 for one in re.finditer(rf"[{{,\s](\"?{name}\"?)\s*=", line)] if name else []
    place = int(index[1]) - 1 if index else 0
    return found[place] if place < len(found) else column


def _blank(text: re.Match[str]) -> str:
    return "\n" * text[0].count("\n") or text[0]


def title_of(text: str) -> str:
    """Return the title that a scene gives itself; empty without one."""
    header = parse_toml(text).get("scene", {})
    return str(header.get("title", "")) if isinstance(header, Mapping) else ""

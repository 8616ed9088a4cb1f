"""Scenes from the network: their allowed content, and the places of their problems."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vibroimpact.fmus.errors import SceneError, UsageError
from vibroimpact.fmus.safe_toml import parse_toml
from vibroimpact.fmus.shipped import components, letters_of
from vibroimpact.orchestrator.scene import Scene, parse_scene
from vibroimpact.orchestrator.scene.changes import text_with_values
from vibroimpact.orchestrator.scene.file import parse_scene_toml
from vibroimpact.orchestrator.scene.forcing_models import forcing_keys
from vibroimpact.orchestrator.scene.own_structures import files_named
from vibroimpact.orchestrator.scene.replay_models import RECORDING_KEY
from vibroimpact.service.fmus import FmuStore
from vibroimpact.service.places import Places
from vibroimpact.service.problems import MOST_PROBLEMS, shortened
from vibroimpact.service.recordings import RecordingStore
from vibroimpact.service.store import Kind

SOURCE = "scene"
"""Beginning of messages about a submitted scene."""
_SYNTAX = re.compile(rf"{SOURCE}: line (\d{{1,9}})(?:, column (\d{{1,9}}))?: ")
_KEY = re.compile(rf"{SOURCE}: ([A-Za-z_][\w\-]*(?:\[\d+\])?(?:\.[\w\-\"]+(?:\[\d+\])?)*): ")


@dataclass(frozen=True, slots=True)
class Shelf:
    """The files that a submitted scene may name: recordings and FMUs of the service."""

    recordings: RecordingStore
    fmus: FmuStore


@dataclass(frozen=True, slots=True)
class Taken:
    """A submitted scene that was accepted."""

    scene: Scene
    text: str
    """TOML, with the recordings that were named separately."""
    files: dict[str, Path]
    """Files of the service that the scene reads, by their names in the scene."""

    @property
    def kind(self) -> Kind:
        """Kind of the job: recordings alone make no sweep, since one replay compares them all."""
        if self.scene.replay is not None and all(axis.key == RECORDING_KEY for axis in self.scene.sweep):
            return Kind.replay
        return Kind.campaign if self.scene.sweep else Kind.run


def taken_scene(text: str, shelf: Shelf, recordings: Sequence[str] = ()) -> Taken:
    """Return the accepted scene of a submitted TOML text.

    Recordings are given by name or id, if the scene names none itself. Raise SceneError with all problems of the scene,
    such as files that the service does not have: a submitted scene cannot name paths.
    """
    document = parse_scene_toml(text, SOURCE)
    files, problems = _files(document, shelf)
    for place, name in enumerate(recordings, 1):
        problems += linked(f"recordings[{place}]", name, shelf, files)
    if problems:
        raise SceneError(problems)
    # paths of files are relative to the folder of the scene
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
    """Return the files that a scene names, each found in the service, and the problems of the names."""
    files, problems = dict[str, Path](), list[str]()
    package, known = frozenset(map(letters_of, components())), ", ".join(known_fmus(shelf))
    own = frozenset(shelf.fmus.names())
    tables = document.get("component", {})
    for name, table in tables.items() if isinstance(tables, Mapping) else ():
        fmu = table.get("fmu") if isinstance(table, Mapping) else None
        if fmu is None or (isinstance(fmu, str) and letters_of(fmu) in package):
            continue
        if isinstance(fmu, str) and fmu in own:
            files[fmu] = shelf.fmus.folder / fmu
        else:
            problems.append(
                f"{SOURCE}: component.{name}.fmu: expected one of {known}, got {fmu!r}. "
                "This service loads no FMU but those of the package and its own."
            )
    for key in files_named(document):
        problems.append(
            f"{SOURCE}: {key}: expected the modes in the scene, got a file. This service reads no files of its machine."
        )
    written = document.get("forcing", [])
    forces = written if isinstance(written, list) else [written]
    for key, force in zip(forcing_keys(forces), forces, strict=True):
        if isinstance(force, Mapping) and "file" in force:
            problems.append(
                f"{SOURCE}: {key}.file: expected times and values in the scene, got a file. "
                "This service reads no files of its machine."
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
    """Add the file of a recording to `files`; return the problems of its name."""
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


def located(problems: Sequence[str], text: str) -> list[dict[str, Any]]:
    """Return problems with their lines and columns in the text, from 1; beyond `MOST_PROBLEMS` only their number.

    An absent key has the place of its table.

    >>> located(["scene: body.mass: expected a number > 0, got -1."], "# a mass\\n[body]\\n  mass = -1")
    [{'message': 'body.mass: expected a number > 0, got -1.', 'line': 3, 'column': 3}]
    """
    places, more = Places(text), len(problems) - MOST_PROBLEMS
    if more > 1:  # a single one more is already the count of problems that the scene reader omitted
        problems = [*problems[:MOST_PROBLEMS], f"{SOURCE}: and {more} more problems."]
    return [_located(problem, places) for problem in problems]


def _located(problem: str, places: Places) -> dict[str, Any]:
    message = shortened(problem.removeprefix(f"{SOURCE}: "))
    syntax, key = _SYNTAX.match(problem), _KEY.match(problem)
    if syntax:
        line, column = int(syntax[1]), int(syntax[2] or 1)
    else:
        line, column = places.of(key[1]) if key else (1, 1)
    return {"message": message, "line": line, "column": column}


def title_of(text: str) -> str:
    """Return the title of a scene; empty without one."""
    header = parse_toml(text).get("scene", {})
    return str(header.get("title", "")) if isinstance(header, Mapping) else ""

"""Arguments of callers: a scene in any of its forms, names of files."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from vibroimpact.analysis.dataset.outputs import refuse_outputs
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.scene import Scene, parse_scene
from vibroimpact.orchestrator.scene.file import text_of_tables
from vibroimpact.orchestrator.ssp import opened_scene

SceneLike = Scene | str | os.PathLike[str] | Mapping[str, Any]
PathLike = str | os.PathLike[str]


def given_scene(given: SceneLike, *, for_orbits: bool = False) -> Scene:
    """Return the scene of a caller's argument, or raise UsageError; for orbits a default start may be on a stop."""
    if isinstance(given, Scene):
        return given
    if isinstance(given, Mapping):
        if not for_orbits:
            return Scene.from_dict(given)
        return parse_scene(text_of_tables(given, "scene"), "scene", for_orbits=True)
    if isinstance(given, str) and "\n" in given:
        raise UsageError(
            "scene: expected the path of a file, got text of several lines. Scene.from_text reads it."
        )
    if isinstance(given, str | os.PathLike):
        return opened_scene(given, for_orbits=for_orbits)
    raise UsageError(
        f"scene: expected a Scene, the path of one or its tables, got {type(given).__name__}. "
        "Scene.from_text reads TOML text."
    )


def prepared_scene(given: SceneLike) -> Scene:
    """Return the scene of a caller's argument, ready to run: see `study.preparation.prepared_scene`.

    The studies are loaded only for a scene with a tolerance: loading them takes longer than most scenes run.
    """
    scene = given_scene(given)
    if scene.execution.tolerance is None:
        return scene
    from vibroimpact.orchestrator.study.preparation import prepared_scene as prepared

    return prepared(scene)


def scene_with_modes(given: SceneLike) -> Scene:
    """Return a caller's scene with its number of modes determined: see `study.preparation.with_found_modes`."""
    scene = given_scene(given)
    if scene.execution.tolerance is None:
        return scene
    from vibroimpact.orchestrator.study.preparation import with_found_modes

    return with_found_modes(scene)


def given_path(given: object) -> Path:
    """Return the path of a file or folder that a caller names; raise UsageError for anything else."""
    if not isinstance(given, str | os.PathLike) or "\0" in os.fspath(given):
        raise UsageError(f"path: expected the name of a file or folder, got {given!r}.")
    return Path(given)


def given_output(given: object, read: Iterable[object]) -> Path:
    """Return the output path of a caller, checked before anything runs.

    Raise UsageError for anything but a name, for a place that cannot be written, and for a file that the call reads.
    These files are the paths in `read`, and the files of its scenes.
    """
    path = given_path(given)
    files: list[Path] = []
    for each in read:
        if isinstance(each, Scene):
            files += [Path(each.source), *each.files]
        elif isinstance(each, str | os.PathLike):
            files.append(Path(each))
    refuse_outputs(files, path, ending=path.suffix)
    return path


def given_result(given: PathLike | None, read: Iterable[object]) -> Path | None:
    """Return the path of the dataset to write as well, None without one: see `given_output`."""
    return None if given is None else given_output(given, read)


def given_paths(given: PathLike | Sequence[PathLike]) -> list[Path]:
    """Return the paths of one or several files that a caller names: see `given_path`."""
    if isinstance(given, str | os.PathLike) or not isinstance(given, Iterable):
        return [given_path(given)]
    return [given_path(one) for one in given]

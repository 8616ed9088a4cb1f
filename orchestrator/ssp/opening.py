"""A scene from a file of either kind: a scene file (TOML) or a system (SSP)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from os import PathLike
from pathlib import Path

from vibroimpact.fmus.errors import SceneError, UsageError
from vibroimpact.fmus.messages import Argument, counted, message
from vibroimpact.orchestrator.scene import Scene, load_scene

ENDING = ".ssp"


def opened_scene(
    path: str | PathLike[str], changes: Sequence[str] = (), *, for_orbits: bool = False, strict: bool = False
) -> Scene:
    """Return the scene of a file; notes on values that a system or its FMUs leave open go to standard error.

    The FMUs of a system lie unpacked until this process ends.

    Parameters
    ----------
    path : path
        A scene file (TOML), or a system, whose name ends in `.ssp`.
    changes : sequence of str
        `KEY=VALUE`, made before anything is checked.
    Whether an unset start may be on a stop: see `scene.parse_scene`.
        Whether a start that is not written may be on a stop: see `scene.parse_scene`.
    strict : bool
        Refuse FMUs that may run wrong.

    Raises
    ------
    SceneError
        With all problems of the file, each on one line; with `strict` also doubts about its FMUs.
    ComponentFileError
        The archive, or an FMU in it, is unsafe or damaged.
    """
    if not is_system(path):
        scene = load_scene(path, changes, for_orbits=for_orbits)
    else:
        from vibroimpact.orchestrator.ssp.importing import load_system

        imported = load_system(path, changes)
        say_notes(imported.notes)
        scene = imported.scene
    _say_findings(path, scene, strict)
    return scene


def _say_findings(path: str | PathLike[str], scene: Scene, strict: bool) -> None:
    """Print doubts about the FMUs of a scene, or raise SceneError; count harmless remarks."""
    if scene.is_one_body:
        return
    if strict and scene.doubts:
        raise SceneError([f"{path}: {doubt}" for doubt in scene.doubts])
    say_notes(f"may run wrong: {doubt}" for doubt in scene.doubts)
    say_notes(
        f"{file}: {counted(count, 'remark')} on its description; no number depends on them. "
        f"`vibroimpact fmu check` shows them."
        for file, count in scene.remarks.items()
    )


def say_notes(notes: Iterable[str]) -> None:
    """Print choices for values that a system leaves open, on standard error."""
    from vibroimpact.fmus.terminal import say

    for line in notes:
        say(f"note: {line}", err=True)


def is_system(path: str | PathLike[str]) -> bool:
    """Return whether a file has the name of a system."""
    return Path(path).suffix.lower() == ENDING


def refuse_system_elsewhere(path: str | PathLike[str], scheduler: object) -> None:
    """Raise UsageError for a system with workers on other machines, which do not have its FMUs.

    Raises
    ------
    UsageError
    """
    if scheduler is not None and is_system(path):
        raise UsageError(
            message(
                Argument("scheduler"),
                f": expected a scene file with its FMUs where all workers see them, got {path}. "
                "Import the system first: vibroimpact ssp import.",
            )
        )

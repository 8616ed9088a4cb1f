"""What callers give: a scene in any of its forms, names of files."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.ssp import opened_scene

SceneLike = Scene | str | os.PathLike[str] | Mapping[str, Any]
PathLike = str | os.PathLike[str]


def given_scene(given: SceneLike) -> Scene:
    """Return the scene that a caller means.

    Raises
    ------
    UsageError
        It is none.
    """
    if isinstance(given, Scene):
        return given
    if isinstance(given, Mapping):
        return Scene.from_dict(given)
    if isinstance(given, str) and "\n" in given:
        raise UsageError(
            "scene: expected the path of a file, got text of several lines. Scene.from_text reads it."
        )
    if isinstance(given, str | os.PathLike):
        return opened_scene(given)
    raise UsageError(
        f"scene: expected a Scene, the path of one or its tables, got {type(given).__name__}. "
        "Scene.from_text reads TOML text."
    )

"""Scenes that stay open, with their runners and the forms of their datasets, for the next run of the same scene.

Only scenes of the package's own bodies in this process are kept: each run begins with a reset and does not depend on
other state. A scene in use has one user; a forked process keeps no scenes.
"""

from __future__ import annotations

import atexit
import os
import pickle
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache, cached_property
from pathlib import Path
from typing import Any

from vibroimpact.fmus import fmu_path
from vibroimpact.fmus.errors import ComponentFileError
from vibroimpact.fmus.file_state import file_state
from vibroimpact.orchestrator.run import Runner, named_runner
from vibroimpact.orchestrator.run.dataset import DatasetForm
from vibroimpact.orchestrator.run.provenance import provenance
from vibroimpact.orchestrator.running.opening import DEFAULT_RUNNER
from vibroimpact.orchestrator.scene import Scene

MOST_KEPT = 8
"""Largest number of scenes kept open; an opened oscillator takes 50 kB, with the loop over its points 2 MB."""


class OpenedScene:
    """A scene with its runner, and the form and attributes of its dataset.

    Attributes
    ----------
    scene : Scene
    runner : Runner
    failed : bool
        Whether a point ended in an error, so that the components are not used again.
    """

    def __init__(self, scene: Scene, runner: Runner) -> None:
        self.scene, self.runner, self.failed = scene, runner, False

    @cached_property
    def form(self) -> DatasetForm:
        """Form of the scene's dataset; DatasetError before the first run, if the dataset is impossible."""
        form = DatasetForm(self.scene)
        form.refuse_impossible()
        return form

    @cached_property
    def attributes(self) -> dict[str, Any]:
        """Attributes of the dataset with its origin."""
        return provenance(self.scene, self.runner.identity)


class _Kept:
    """The scenes that are open and not in use, by key; the last used comes last."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._opened: dict[tuple[Any, ...], OpenedScene] = {}

    def take(self, key: tuple[Any, ...]) -> OpenedScene | None:
        """Return an opened scene and hand it over to the caller; None if it is not kept."""
        with self._lock:
            return self._opened.pop(key, None)

    def give_back(self, key: tuple[Any, ...], opened: OpenedScene) -> None:
        """Keep a scene, and close the oldest scene if there are too many."""
        with self._lock:
            surplus = [self._opened.pop(key, None)]
            self._opened[key] = opened
            if len(self._opened) > MOST_KEPT:
                surplus.append(self._opened.pop(next(iter(self._opened))))
        for one in surplus:
            if one is not None:
                one.runner.close()

    def close(self) -> None:
        """Close all scenes."""
        with self._lock:
            opened, self._opened = list(self._opened.values()), {}
        for one in opened:
            one.runner.close()

    def forget(self) -> None:
        """Begin anew in a fork: the open scenes belong to the parent, which may hold the lock."""
        self._others = self._opened  # kept referenced, since freeing would close the scenes
        self._lock, self._opened = threading.Lock(), {}


_kept = _Kept()
atexit.register(_kept.close)
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_kept.forget)


@contextmanager
def opened_scene(
    scene: Scene, execution: str | None = None, runner: str = DEFAULT_RUNNER
) -> Iterator[OpenedScene]:
    """Open a scene, or take it from the open scenes; a failed run closes it.

    Parameters
    ----------
    scene : Scene
    execution : str, optional
        Execution of the points; by default the scene's own.
    runner : str
        Function that opens the scene, as `module:name`; only scenes of the default function are kept.

    Raises
    ------
    SceneError, ComponentError
        The scene cannot run, or a component cannot be loaded.
    """
    key = _key(scene, execution) if runner == DEFAULT_RUNNER else None
    opened = None if key is None else _kept.take(key)
    if opened is None:
        opened = OpenedScene(scene, named_runner(scene, runner, execution))
    try:
        yield opened
    except BaseException:
        opened.runner.close()
        raise
    if key is None or opened.failed:
        opened.runner.close()
    else:
        _kept.give_back(key, opened)


def _key(scene: Scene, execution: str | None) -> tuple[Any, ...] | None:
    """Return the key of a scene with its components; None for a scene that is not kept."""
    if not scene.is_lone_body or scene.execution.guard:
        return None
    try:
        files = tuple(file_state(path.stat()) for path in _components(scene.body.FMU))
    except (OSError, ComponentFileError):
        return None  # the opening of the scene raises the error
    return pickle.dumps(scene), execution, files


@cache
def _components(body: str) -> tuple[Path, ...]:
    """Return the FMU files that a scene with this body may load."""
    return fmu_path(body), fmu_path("ImpactStop")

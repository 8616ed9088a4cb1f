"""Scenes that stay open: whoever runs one again finds its runner, and what its dataset says, as they were left.

Only bodies of ours in this process are kept: each run of theirs begins with a reset, and depends on nothing outside.
A scene in use is nobody else's; a process that is forked keeps none.
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
"""Scenes that stay open in a process; an opened oscillator takes 50 kB, with the loop over its points 2 MB."""


class OpenedScene:
    """A scene with its runner, and what its dataset says of it.

    Attributes
    ----------
    scene : Scene
    runner : Runner
    failed : bool
        Whether a point of it ended in an error: its components are not run again.
    """

    def __init__(self, scene: Scene, runner: Runner) -> None:
        self.scene, self.runner, self.failed = scene, runner, False

    @cached_property
    def form(self) -> DatasetForm:
        """What the scene says of its dataset; that it can be made is found out before an hour of work, not after it."""
        form = DatasetForm(self.scene)
        form.refuse_impossible()
        return form

    @cached_property
    def attributes(self) -> dict[str, Any]:
        """Where its dataset comes from."""
        return provenance(self.scene, self.runner.identity)


class _Kept:
    """The scenes that are open and not in use, by what they are; the last used comes last."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._opened: dict[tuple[Any, ...], OpenedScene] = {}

    def take(self, key: tuple[Any, ...]) -> OpenedScene | None:
        """Return an opened scene, which is then the caller's."""
        with self._lock:
            return self._opened.pop(key, None)

    def give_back(self, key: tuple[Any, ...], opened: OpenedScene) -> None:
        """Keep a scene; one that is too many is closed."""
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
        """Begin anew in a fork: what is open belongs to the other process, and the lock may be held there."""
        self._others = self._opened  # not freed: that would end what it holds
        self._lock, self._opened = threading.Lock(), {}


_kept = _Kept()
atexit.register(_kept.close)
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_kept.forget)


@contextmanager
def opened_scene(
    scene: Scene, execution: str | None = None, runner: str = DEFAULT_RUNNER
) -> Iterator[OpenedScene]:
    """Open a scene, or take it from those that are open; a run that fails closes it.

    Parameters
    ----------
    scene : Scene
    execution : str, optional
        How its points run; by default as the scene says.
    runner : str
        What opens it, as `module:name`; what others than the default one open is not kept.

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
    """Return what tells a scene and its components from others; None of a scene that is not kept."""
    if not scene.is_lone_body or scene.execution.guard:
        return None
    try:
        files = tuple(file_state(path.stat()) for path in _components(scene.body.FMU))
    except (OSError, ComponentFileError):
        return None  # who opens it says what is wrong
    return pickle.dumps(scene), execution, files


@cache
def _components(body: str) -> tuple[Path, ...]:
    """Return the files that a scene of a body may load."""
    return fmu_path(body), fmu_path("ImpactStop")

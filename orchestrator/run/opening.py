"""The choice of a scene's runner in this process: of one body, of any components, or of a replay."""

from __future__ import annotations

import importlib

from vibroimpact.orchestrator.fmi.instance import LogOf, WrapOf
from vibroimpact.orchestrator.run.point import PointRunner
from vibroimpact.orchestrator.run.runner import Runner
from vibroimpact.orchestrator.scene import Scene

REPLAY_RUNNER = "vibroimpact.orchestrator.replay.runner:ReplayRunner"
"""Runner of replays, by name: replays belong to a higher layer, which only scenes with a replay import."""


def open_runner(
    scene: Scene, execution: str, *, log: LogOf | None = None, wrap: WrapOf | None = None
) -> Runner:
    """Return the runner of a scene in this process.

    Raises
    ------
    SceneError, ComponentError
        The scene cannot run this way, or a component cannot be loaded.
    """
    if not scene.is_one_body:
        # imported only for scenes of components
        from vibroimpact.orchestrator.run.general import GeneralRunner

        return GeneralRunner(scene, execution=execution, log=log, wrap=wrap)
    if scene.replay is not None:
        return named_runner(scene, REPLAY_RUNNER, execution)
    return PointRunner(scene, execution=execution, wrap=wrap)


def named_runner(scene: Scene, dotted: str, execution: str | None = None) -> Runner:
    """Return the runner of a scene by its class as `module:name`, which a worker process can import."""
    module, _, name = dotted.partition(":")
    make = getattr(importlib.import_module(module), name)
    runner: Runner = make(scene, execution=execution or scene.execution.how)
    return runner

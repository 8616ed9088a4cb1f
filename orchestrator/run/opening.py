"""Which runner a scene gets in this process: of one body, of any components, or of a replay."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from typing import Any, Protocol, cast

from vibroimpact.analysis.dataset import RunRecord
from vibroimpact.orchestrator.fmi.instance import LogOf, WrapOf
from vibroimpact.orchestrator.run.general import GeneralRunner
from vibroimpact.orchestrator.run.point import PointRunner
from vibroimpact.orchestrator.scene import Scene

REPLAY_RUNNER = "vibroimpact.orchestrator.replay.runner:ReplayRunner"
"""Replays are a floor above: named here, loaded by those who replay."""


class Runner(Protocol):
    """Runs the points of one scene in this process."""

    execution: str
    instruction_set: str
    fmu_hashes: dict[str, str]

    def run(self, values: Mapping[str, float], start: tuple[float, ...] | None = None) -> RunRecord:
        """Run one point."""

    def close(self) -> None:
        """Free what it holds."""


def open_runner(
    scene: Scene, execution: str, *, log: LogOf | None = None, wrap: WrapOf | None = None
) -> Runner:
    """Return the runner of a scene in this process.

    Raises
    ------
    SceneError, ComponentError
        The scene cannot run this way, or a component cannot be loaded.
    """
    if scene.general is not None:
        return GeneralRunner(scene, execution=execution, log=log, wrap=wrap)
    if scene.replay is not None:
        return cast(Runner, named(REPLAY_RUNNER)(scene, execution=execution))
    return PointRunner(scene, execution=execution)


def named(dotted: str) -> Callable[..., Any]:
    """Return what `module:name` stands for."""
    module, _, name = dotted.partition(":")
    found: Callable[..., Any] = getattr(importlib.import_module(module), name)
    return found

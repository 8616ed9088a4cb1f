"""Which runner a scene gets: fused or coupled, of one body or of any components, guarded or not."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from vibroimpact.analysis.dataset import RunRecord
from vibroimpact.orchestrator.breadcrumbs import LogOf, WrapOf
from vibroimpact.orchestrator.general_runner import GeneralRunner
from vibroimpact.orchestrator.runner import PointRunner
from vibroimpact.orchestrator.scene import Scene


class Runner(Protocol):
    """Runs the points of one scene in this process."""

    execution: str
    instruction_set: str
    fmu_hashes: dict[str, str]

    def run(self, values: Mapping[str, float], start: tuple[float, ...] | None = None) -> RunRecord:
        """Run one point."""

    def close(self) -> None:
        """Free what it holds."""


def make_runner(scene: Scene, *, execution: str = "auto") -> Runner:
    """Return the runner of a scene, in a guarded child process where the scene asks for it.

    Raises
    ------
    SceneError, ComponentError
        The scene cannot run this way, or a component cannot be loaded.
    """
    guarded = scene.general.guard if scene.general is not None else scene.execution.guard
    if guarded:
        from vibroimpact.orchestrator.guard import GuardedRunner  # only those who ask for it pay for it

        return GuardedRunner(scene, execution=execution)
    return open_runner(scene, execution)


def open_runner(
    scene: Scene, execution: str, *, log: LogOf | None = None, wrap: WrapOf | None = None
) -> Runner:
    """Return the runner of a scene in this process."""
    if scene.general is not None:
        return GeneralRunner(scene, execution=execution, log=log, wrap=wrap)
    if scene.replay is not None:
        from vibroimpact.orchestrator.replay_runner import ReplayRunner  # scipy, for those who replay

        return ReplayRunner(scene, execution=execution)
    return PointRunner(scene, execution=execution)

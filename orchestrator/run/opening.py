"""Which runner a scene gets in this process: of one body, of any components, or of a replay."""

from __future__ import annotations

import importlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from vibroimpact.analysis.dataset import RunRecord
from vibroimpact.orchestrator.fmi.instance import LogOf, WrapOf
from vibroimpact.orchestrator.run.point import PointRunner
from vibroimpact.orchestrator.scene import Scene

OTHER_ENGINE = 1
"""Version of the engine of components that are not ours, and of bodies before there was a number."""

REPLAY_RUNNER = "vibroimpact.orchestrator.replay.runner:ReplayRunner"
"""Replays are a floor above: named here, loaded by those who replay."""


@dataclass(frozen=True, slots=True)
class RunnerIdentity:
    """What must be the same for all points of a campaign, or its rows could not be compared."""

    execution: str
    instruction_set: str
    fmu_hashes: Mapping[str, str]
    engine: int = OTHER_ENGINE


def identity_of(runner: Runner) -> RunnerIdentity:
    """Return what a runner is: its execution, instruction set, FMU hashes and version of the engine."""
    engine = getattr(runner, "engine", OTHER_ENGINE)
    return RunnerIdentity(runner.execution, runner.instruction_set, dict(runner.fmu_hashes), engine)


class Runner(Protocol):
    """Runs the points of one scene."""

    @property
    def execution(self) -> str:
        """Which way of running the scene it uses."""

    @property
    def instruction_set(self) -> str:
        """The instruction set of the machine code it runs."""

    @property
    def fmu_hashes(self) -> Mapping[str, str]:
        """Content hash of each FMU it loaded."""

    def run(self, values: Mapping[str, float], start: tuple[float, ...] | None = None) -> RunRecord:
        """Run one point from a carried state, or from the scene's own start state."""

    def close(self) -> None:
        """Free the components."""


@runtime_checkable
class AnnouncedRunner(Runner, Protocol):
    """A runner that is faster when it knows which points come next."""

    def announce(self, points: Sequence[tuple[Mapping[str, float], tuple[float, ...] | None]]) -> None:
        """Say what `run` will be given next: these objects, in this order; it may also be given others."""


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
        # loaded by those who couple components
        from vibroimpact.orchestrator.run.general import GeneralRunner

        return GeneralRunner(scene, execution=execution, log=log, wrap=wrap)
    if scene.replay is not None:
        return named_runner(scene, REPLAY_RUNNER, execution)
    return PointRunner(scene, execution=execution, wrap=wrap)


def named_runner(scene: Scene, dotted: str, execution: str | None = None) -> Runner:
    """Return the runner of a scene whose class is given as `module:name`, so that a worker can find it by itself."""
    module, _, name = dotted.partition(":")
    make = getattr(importlib.import_module(module), name)
    runner: Runner = make(scene, execution=execution or scene.execution.how)
    return runner

"""A substitute for the point runner: points of a stated duration, results that depend on every input.

With it the campaign engine is tested and timed without any component. `BusyRunner` is a map with carried state; each
point takes about `body.mass` milliseconds. Points sleep: a component, too, leaves the interpreter to others, and the
processors are for the code under test.
"""

from __future__ import annotations

import ctypes
import math
import os
import signal
import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from vibroimpact.analysis.dataset import Outcome, RunRecord, write_dataset
from vibroimpact.analysis.dataset.columns import RunColumns
from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.run.many_points import lanes_rows
from vibroimpact.orchestrator.run.many_points.loop import PointLoop
from vibroimpact.orchestrator.run.point import PointRunner
from vibroimpact.orchestrator.run.points import State
from vibroimpact.orchestrator.run.runner import Runner
from vibroimpact.orchestrator.running import open_scene
from vibroimpact.orchestrator.running.kept import OpenedScene
from vibroimpact.orchestrator.running.whole import run_whole
from vibroimpact.orchestrator.scene import Scene


class BusyRunner(Runner):
    """Takes `body.mass` milliseconds for a point and returns a record of three impacts."""

    execution = "busy"
    instruction_set = "none"

    def __init__(self, scene: Scene, *, execution: str = "auto") -> None:
        self.fmu_hashes = {"Busy": "0" * 64}
        self.scene = scene
        self.periods = scene.record.recorded_periods or 1

    def run(self, values: Mapping[str, float], start: State | None = None) -> RunRecord:
        """Run one point: a contraction towards a point that depends on the swept values."""
        began = time.perf_counter()
        scene = self.scene.at(values)
        time.sleep(scene.body.mass * 1e-3)
        displacement, velocity = start if start is not None else (scene.body.displacement_start, 0.0)
        target = self.target(scene, values)
        displacement = 0.9 * displacement + math.sin(target)
        velocity = 0.7 * velocity + displacement * 0.1
        periods = np.full((self.periods, 5), displacement)
        impacts = np.array([[k, 0.5, abs(velocity), abs(velocity), 1] for k in range(3)], dtype=float)
        return RunRecord(
            Outcome.ok,
            "",
            periods,
            impacts,
            np.empty((0, 3)),
            None,
            displacement,
            velocity,
            0.0,
            time.perf_counter() - began,
        )

    def target(self, scene: Scene, values: Mapping[str, float]) -> float:
        """Return a number that identifies the point."""
        return math.fsum(values.values())

    def close(self) -> None:
        """Do nothing: there is nothing to close."""


def run_busy(scene: Scene, path: Path) -> None:
    """Write the dataset of all points of a scene, run in this process."""
    write_dataset(run_whole(OpenedScene(scene, BusyRunner(scene))), path)


class SceneRunner(BusyRunner):
    """Depends only on its scene, like a real runner: swept and fixed values give the same result."""

    def target(self, scene: Scene, values: Mapping[str, float]) -> float:
        """Return a number that identifies the point."""
        keys = ("body.mass", "forcing.amplitude", "forcing.angular_frequency", "stop[1].restitution")
        return math.fsum(map(scene.value, keys))


class OtherBuildRunner(SceneRunner):
    """The same runner from another build."""

    def __init__(self, scene: Scene, *, execution: str = "auto") -> None:
        super().__init__(scene, execution=execution)
        self.fmu_hashes = {"Busy": "1" * 64}


class UnhurriedRunner(Runner):
    """The real runner of a scene, asleep for a while at each point: time to kill its process."""

    def __init__(self, scene: Scene, *, execution: str = "auto") -> None:
        self._runner, self.scene = open_scene(scene, execution=execution), scene
        self.execution = self._runner.execution
        self.instruction_set = self._runner.instruction_set
        self.fmu_hashes = self._runner.fmu_hashes

    def run(self, values: Mapping[str, float], start: State | None = None) -> RunRecord:
        """Run one point, after 5 ms."""
        time.sleep(0.005)
        return self._runner.run(values, start)

    def close(self) -> None:
        """End the real runner."""
        self._runner.close()


def unhurried_lanes(scene: Scene, *, execution: str = "auto") -> PointRunner:
    """Return the real runner of a scene in lanes, which sleep before each chunk for the time that points may take.

    Chunks are short then and often cut: the time of a chunk is over when its first points start.
    """
    runner = open_scene(scene, execution=execution)
    assert isinstance(runner, PointRunner)
    assert runner.execution == "lanes"
    at_once = lanes_rows.run_in_lanes

    def later(
        loop: PointLoop, points: lanes_rows.LaneValues, deadline: float, alone: lanes_rows.Alone
    ) -> tuple[RunColumns, tuple[float, ...] | None]:
        time.sleep(0.01 * len(points))
        return at_once(loop, points, deadline, alone)

    lanes_rows.run_in_lanes = later  # in this process, a worker
    return runner


class BrittleRunner(BusyRunner):
    """Fails, with a message, at every point whose forcing amplitude is negative."""

    def run(self, values: Mapping[str, float], start: State | None = None) -> RunRecord:
        """Run one point, or raise."""
        if self.scene.at(values).value("forcing.amplitude") < 0:
            raise ComponentError("oscillator: the step failed; expected a step that ends, got none.")
        return super().run(values, start)


class DeadlyRunner(BusyRunner):
    """Kills its own process at every point whose forcing amplitude is negative."""

    def run(self, values: Mapping[str, float], start: State | None = None) -> RunRecord:
        """Run one point, or die."""
        if self.scene.at(values).value("forcing.amplitude") < 0:
            os.kill(os.getpid(), signal.SIGKILL)
        return super().run(values, start)


class HuntedRunner(BusyRunner):
    """Is killed at every point whose forcing amplitude is negative, as long as it runs in a worker."""

    def run(self, values: Mapping[str, float], start: State | None = None) -> RunRecord:
        """Run one point, or die."""
        if self.scene.at(values).value("forcing.amplitude") < 0 and _is_worker():
            os.kill(os.getpid(), signal.SIGKILL)
        return super().run(values, start)


def _is_worker() -> bool:
    from distributed import get_worker

    try:
        return get_worker() is not None
    except ValueError:
        return False


class OtherMachineRunner(BusyRunner):
    """The same runner on another kind of processor."""

    instruction_set = "other"


class UnlikeRunner(BusyRunner):
    """Reports another instruction set in every process."""

    def __init__(self, scene: Scene, *, execution: str = "auto") -> None:
        super().__init__(scene, execution=execution)
        self.instruction_set = f"process {os.getpid()}"


class OnceDeadlyRunner(BusyRunner):
    """Kills its process once, at the first point after the file named by VIBROIMPACT_TEST_KILL appeared."""

    def run(self, values: Mapping[str, float], start: State | None = None) -> RunRecord:
        """Run one point, or die if the file exists and this process removes it first."""
        wish = Path(os.environ["VIBROIMPACT_TEST_KILL"])
        try:
            wish.unlink()
        except FileNotFoundError:
            return super().run(values, start)
        os.kill(os.getpid(), signal.SIGKILL)
        raise AssertionError("unreachable")


def die_while(folder: str) -> int:
    """Remove a file from a folder and kill this process; without a file return the process number."""
    for wish in Path(folder).iterdir():
        try:
            wish.unlink()
        except FileNotFoundError:
            continue  # another process removed it
        os.kill(os.getpid(), signal.SIGKILL)
    return os.getpid()


def freeze_once(wish: str) -> str:
    """Stop this process for good while the file exists, and remove the file first."""
    if Path(wish).exists():
        Path(wish).unlink()
        os.kill(os.getpid(), signal.SIGSTOP)
    return "thawed"


def keep_the_interpreter(seconds: int) -> int:
    """Block all other threads of this process for a time, as the import of a large library does."""
    ctypes.PyDLL(None).sleep(seconds)
    return seconds


def same(value: int) -> int:
    """Return the given number."""
    return value

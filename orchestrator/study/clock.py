"""The clock of a study: the cost of runs on this machine, in time, calls of FMUs and memory."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Any

from vibroimpact.orchestrator.run.record import runs_limited
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.study.memory import memory_of_ways
from vibroimpact.orchestrator.study.observation import Observation
from vibroimpact.orchestrator.study.processor import COUNTS_RUNNING, processor_time_of_all
from vibroimpact.orchestrator.study.ways.replays import ReplayTrial
from vibroimpact.orchestrator.study.ways.way import CallCounter, SceneTrial, Trial, Way


class Clock:
    """Measures the cost of runs, by further runs.

    Studies measure only by `CLOCK`. Errors, texts and files do not depend on the clock: tests of these replace it.
    """

    def wall(self) -> float:
        """Return the wall time since some instant, s."""
        return time.perf_counter()

    def spent(self) -> float:
        """Return the processor time of this process and of all processes that it started, s."""
        return processor_time_of_all()

    def limited(self, seconds: float) -> AbstractContextManager[None]:
        """Give up each run of the block that takes more processor time than `seconds`, s."""
        return runs_limited(seconds, time.process_time)

    def observed(self, trial: Trial) -> tuple[Observation, float, float]:
        """Run a trial; return its observation, its processor time and its wall time, s."""
        return _run(trial)

    def timed(self, trial: Trial) -> tuple[float, float]:
        """Run a trial; return its processor time and its wall time, s."""
        return _run(trial)[1:]

    def processor_time(self, trial: SceneTrial | ReplayTrial) -> float:
        """Run a trial; return its processor time, s."""
        return _run(trial)[1]

    def calls(self, way: Way) -> int:
        """Run a way; return its number of calls of FMU functions; -1 where the calls are not counted."""
        counter = CallCounter()
        trial = way.open(counter.wrap)
        try:
            trial.run()
            return sum(counter.calls.values()) or -1
        finally:
            trial.close()

    def memory(
        self, scene: Scene, given: Mapping[str, Any], parts: Sequence[tuple[int, float]], seconds: float
    ) -> dict[int, int]:
        """Run each way in its own process; return their memory by place, bytes: see `memory_of_ways`."""
        return memory_of_ways(scene, given, parts, seconds)


def _run(trial: Trial) -> tuple[Observation, float, float]:
    """Run a trial; return its observation, its processor time and its wall time, s.

    A guarded trial computes in another process: its wall time counts where the system has no processor time of it.
    """
    processor: Callable[[], float] = time.process_time
    if getattr(trial, "is_guarded", False):
        processor = processor_time_of_all if COUNTS_RUNNING else time.perf_counter
    began, before = time.perf_counter(), processor()
    found = trial.run()
    return found, processor() - before, time.perf_counter() - began


CLOCK = Clock()
"""The clock of all studies of this process."""

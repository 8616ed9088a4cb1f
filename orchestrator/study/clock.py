"""The clock of a study: what runs cost on this machine, in time, calls of FMUs and memory."""

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
    """Measures what runs cost, by further runs.

    Studies measure by `CLOCK` alone. Errors, texts and files do not depend on it: a test of these replaces it.
    """

    def wall(self) -> float:
        """Return the wall time since some instant, s."""
        return time.perf_counter()

    def spent(self) -> float:
        """Return the processor time of all processes of this one, s."""
        return processor_time_of_all()

    def limited(self, seconds: float) -> AbstractContextManager[None]:
        """Give up each run of the block that takes more processor time than so much, s."""
        return runs_limited(seconds, time.process_time)

    def observed(self, trial: Trial) -> tuple[Observation, float, float]:
        """Run a trial; return what it shows, its processor time and its wall time, s."""
        return _run(trial)

    def timed(self, trial: Trial) -> tuple[float, float]:
        """Run a trial; return its processor time and its wall time, s."""
        return _run(trial)[1:]

    def processor_time(self, trial: SceneTrial | ReplayTrial) -> float:
        """Run a trial; return its processor time, s."""
        return _run(trial)[1]

    def calls(self, way: Way) -> int:
        """Run a way; return how often it calls functions of FMUs; -1 where nobody counts them."""
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
        """Run ways in processes of their own; return their memory by place, bytes: see `memory_of_ways`."""
        return memory_of_ways(scene, given, parts, seconds)


def _run(trial: Trial) -> tuple[Observation, float, float]:
    """Run a trial; return what it shows, its processor time and its wall time, s.

    Another process that computes it counts by its wall time where the system does not tell its processor time.
    """
    processor: Callable[[], float] = time.process_time
    if getattr(trial, "is_guarded", False):
        processor = processor_time_of_all if COUNTS_RUNNING else time.perf_counter
    began, before = time.perf_counter(), processor()
    found = trial.run()
    return found, processor() - before, time.perf_counter() - began


CLOCK = Clock()
"""The clock of all studies of this process."""

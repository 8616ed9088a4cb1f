"""The clock of a study: what runs cost on this machine, in time, calls of FMUs and memory."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence

from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.study.memory import memory_of_ways
from vibroimpact.orchestrator.study.ways.replays import ReplayTrial
from vibroimpact.orchestrator.study.ways.way import CallCounter, SceneTrial, Trial, Way


class Clock:
    """Measures what runs cost, by further runs.

    Studies measure by `CLOCK` alone. Errors, texts and files do not depend on it: a test of these replaces it.
    """

    def now(self) -> float:
        """Return the wall time since some instant, s."""
        return time.perf_counter()

    def wall_time(self, trial: Trial) -> float:
        """Run a trial; return its wall time, s."""
        return trial.run().seconds

    def processor_time(self, trial: SceneTrial | ReplayTrial) -> float:
        """Run a trial; return its processor time, s; its wall time where another process computes it."""
        began, processor = time.perf_counter(), time.process_time()
        trial.run()
        return time.perf_counter() - began if trial.is_guarded else time.process_time() - processor

    def calls(self, way: Way) -> int:
        """Run a way; return how often it calls functions of FMUs; -1 where nobody counts them."""
        counter = CallCounter()
        trial = way.open(counter.wrap)
        try:
            trial.run()
            return sum(counter.calls.values()) or -1
        finally:
            trial.close()

    def memory(self, scene: Scene, given: Mapping[str, float], places: Sequence[int]) -> dict[int, int]:
        """Run ways in processes of their own; return their memory by place, bytes: see `memory_of_ways`."""
        return memory_of_ways(scene, given, places)


CLOCK = Clock()
"""The clock of all studies of this process."""

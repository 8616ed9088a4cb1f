"""A clock of studies that measures the work of runs in place of time: it advances by a tick at each look."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Any

import pytest

from vibroimpact.orchestrator.run.record import runs_limited
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.study import clock
from vibroimpact.orchestrator.study.clock import Clock
from vibroimpact.orchestrator.study.observation import Observation
from vibroimpact.orchestrator.study.ways.replays import ReplayTrial
from vibroimpact.orchestrator.study.ways.way import SceneTrial, Trial, Way


class TickingClock(Clock):
    """Counts the looks of runs at their deadline: a plain step is one, an event of an importer another.

    Parameters
    ----------
    tick : float
        Processor time of a look, s.
    slowness : float
        Wall time over processor time.

    Attributes
    ----------
    told : list of str
        Measurements, in order: `observed`, `timed`, `memory`.
    """

    def __init__(self, tick: float = 1e-3, slowness: float = 1.0) -> None:
        self._tick, self._slowness = tick, slowness
        self.time = 0.0
        self.told: list[str] = []

    def look(self) -> float:
        """Return the processor time, s, after an advance by a tick."""
        self.time += self._tick
        return self.time

    def wall(self) -> float:
        """Return the wall time, s."""
        return self._slowness * self.time

    def spent(self) -> float:
        """Return the processor time, s."""
        return self.time

    def limited(self, seconds: float) -> AbstractContextManager[None]:
        """Give up each run that takes longer."""
        return runs_limited(seconds, self.look)

    def observed(self, trial: Trial) -> tuple[Observation, float, float]:
        """Run a trial; return its observation and its times, s."""
        self.told.append("observed")
        return self._run(trial)

    def timed(self, trial: Trial) -> tuple[float, float]:
        """Run a trial; return its times, s."""
        self.told.append("timed")
        with runs_limited(math.inf, self.look):
            return self._run(trial)[1:]

    def _run(self, trial: Trial) -> tuple[Observation, float, float]:
        before, found = self.time, trial.run()
        took = max(self.time - before, self._tick)
        return found, took, self._slowness * took

    def processor_time(self, trial: SceneTrial | ReplayTrial) -> float:
        """Run a trial; return its processor time, s."""
        return self.timed(trial)[0]

    def calls(self, way: Way) -> int:
        """Return -1: calls are not counted."""
        return -1

    def memory(
        self, scene: Scene, given: Mapping[str, Any], parts: Sequence[tuple[int, float]], seconds: float
    ) -> dict[int, int]:
        """Return one byte for each place."""
        self.told.append("memory")
        return {place: 1 for place, _ in parts}


def tick_the_clock(patch: pytest.MonkeyPatch, ticking: TickingClock) -> TickingClock:
    """Give studies a ticking clock until the patch is undone."""
    patch.setattr(clock, "CLOCK", ticking)
    return ticking

"""A clock that stands still: studies in tests of errors, texts or files run each way once."""

from __future__ import annotations

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

RUN = 1e-3
"""Reported time of each run, s."""
NEVER_LATE = 1e4
"""Budget from which no run takes a share large enough to be given up, however busy the machine is, s."""


class StillClock(Clock):
    """Measures nothing: no run is repeated, and each takes the same time."""

    def wall(self) -> float:
        """Return the same instant each time."""
        return 0.0

    def spent(self) -> float:
        """Return the same time each time: no budget is spent."""
        return 0.0

    def limited(self, seconds: float) -> AbstractContextManager[None]:
        """Give up no run."""
        return runs_limited(seconds, lambda: 0.0)

    def observed(self, trial: Trial) -> tuple[Observation, float, float]:
        """Run a trial; return its observation, and the times of any run, s."""
        return trial.run(), RUN, RUN

    def timed(self, trial: Trial) -> tuple[float, float]:
        """Return the times of any run, s."""
        return RUN, RUN

    def processor_time(self, trial: SceneTrial | ReplayTrial) -> float:
        """Return the time of any run, s."""
        return RUN

    def calls(self, way: Way) -> int:
        """Return -1: calls are not counted."""
        return -1

    def memory(
        self, scene: Scene, given: Mapping[str, Any], parts: Sequence[tuple[int, float]], seconds: float
    ) -> dict[int, int]:
        """Return nothing: memory is not measured."""
        return {}


def let_nothing_run(patch: pytest.MonkeyPatch) -> None:
    """Make each run of a scene an error until the patch is undone."""

    def run(trial: Trial) -> Observation:
        raise AssertionError("a scene has run")

    for kind in (SceneTrial, ReplayTrial):
        patch.setattr(kind, "run", run)


def stop_the_clock(patch: pytest.MonkeyPatch) -> None:
    """Stop the clock of studies until the patch is undone."""
    patch.setattr(clock, "CLOCK", StillClock())

"""One point of a scene, simulated in this process; `dataset` makes the dataset of the runs."""

from __future__ import annotations

from vibroimpact.orchestrator.run.opening import named_runner, open_runner
from vibroimpact.orchestrator.run.point import PointRunner
from vibroimpact.orchestrator.run.runner import OTHER_ENGINE, Runner, RunnerIdentity
from vibroimpact.orchestrator.run.session import Session

__all__ = [
    "OTHER_ENGINE",
    "PointRunner",
    "Runner",
    "RunnerIdentity",
    "Session",
    "named_runner",
    "open_runner",
]

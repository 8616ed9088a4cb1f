"""This package's own run: the stop inside the body's FMU, one step over the motion, impacts and rests recorded."""

from __future__ import annotations

import math

import numpy as np

from peers.problems import Problem
from peers.ways import Clock, Found, Run, Way
from vibroimpact.orchestrator.run import open_runner
from vibroimpact.orchestrator.study.observation import observation_of

NAME = "fused FMU"


def opened(problem: Problem, setting: float, clock: Clock) -> Run:
    """Return a function that simulates a problem; the setting has no effect."""
    runner = open_runner(
        problem.scene.with_values({"record.impacts": True, "record.extrema": False}), "fused"
    )

    def run() -> Found:
        record = runner.run({})
        rests = np.empty(0) if record.sticks is None else record.sticks[:, 0]
        return Found(observation_of(record), rests)

    return run


def ways() -> list[Way]:
    """Return the single way of this package."""
    return [Way(NAME, "", "", lambda problem: (math.nan,), opened, ours=True)]

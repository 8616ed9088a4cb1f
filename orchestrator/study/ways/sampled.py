"""A trial that reads the motion off its samples only, as from a recording."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from vibroimpact.orchestrator.fmi.instance import Wrapper
from vibroimpact.orchestrator.run import open_runner
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.study.observation import Observation, observation_of
from vibroimpact.orchestrator.study.ways.span import first_periods


class SampledTrial:
    """A scene whose impacts and extremes are read off samples of its motion, `rate` a second, in whole periods.

    An impact has the time and the velocity of the last sample before it, as in a recording without a model.
    """

    def __init__(self, scene: Scene, rate: float, wrap: Wrapper | None = None, part: float = 1.0) -> None:
        series = {"rate": rate, "variables": ["displacement", "velocity"]}
        sampled = first_periods(scene, part).with_values({"record.time_series": series})
        of = None if wrap is None else (lambda name: wrap)
        self._runner = open_runner(sampled, sampled.execution.how, wrap=of)

    def run(self) -> Observation:
        """Simulate the scene once, and read its samples."""
        began = time.perf_counter()
        record = self._runner.run({})
        whole = replace(observation_of(record), samples=None)
        rows = record.samples
        if whole.failure or rows is None or not len(rows):
            return whole
        places = np.searchsorted(rows[:, 0], whole.impacts[:, 0], side="right") - 1
        seen = rows[np.maximum(places, 0)]
        impacts = np.column_stack([seen[:, 0], np.abs(seen[:, 2]), whole.impacts[:, 2]])
        return replace(
            whole,
            impacts=impacts,
            lowest=float(rows[:, 1].min()),
            highest=float(rows[:, 1].max()),
            seconds=time.perf_counter() - began,
        )

    def close(self) -> None:
        """Free the components."""
        self._runner.close()

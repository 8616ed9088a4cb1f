"""Replays as points of a campaign: over recordings, and over the swept keys of the scene."""

from __future__ import annotations

import hashlib
import platform
import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from vibroimpact.analysis.dataset import Outcome, RunRecord
from vibroimpact.analysis.replay.comparison import Comparison
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.replay.replayer import (
    Motion,
    Replayer,
    opened_replay,
    recording_of,
    replay_table,
)
from vibroimpact.orchestrator.replay.scoring import compare_motion
from vibroimpact.orchestrator.run.parameters import most_elements, padded_state
from vibroimpact.orchestrator.run.point import built_for, engine_of
from vibroimpact.orchestrator.run.runner import Runner
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.replay_models import RECORDING_KEY


class ReplayRunner(Runner):
    """Runs the replays of one scene; each recording is opened once in a process.

    `fmu_hashes` have the SHA-256 of each component's FMU and of each recording: a campaign never mixes two versions of
    either.
    """

    def __init__(self, scene: Scene, *, execution: str = "auto") -> None:
        self.execution = "fused" if execution == "auto" else execution
        self.engine = engine_of(scene, self.execution)
        self.instruction_set = platform.machine()
        self.scene = scene
        count = max(1, len(replay_table(scene).recordings))
        self._paths = [recording_of(scene, number) for number in range(1, count + 1)]
        recordings = {f"recording {path.name}": _sha256(path) for path in self._paths}
        self._replayers: dict[int, Replayer] = {}
        self._built_for = built_for(scene)
        self.fmu_hashes = recordings | self._replayer(1, scene).hashes

    def _replayer(self, number: int, scene: Scene) -> Replayer:
        if self._built_for != built_for(scene):
            self.close()
            self._replayers, self._built_for = {}, built_for(scene)
        if number not in self._replayers:
            path = self._paths[number - 1]
            self._replayers[number] = opened_replay(scene, path, self.execution)
        return self._replayers[number]

    def run(self, values: Mapping[str, float], start: tuple[float, ...] | None = None) -> RunRecord:
        """Replay one recording with the values of one point.

        VibroimpactError: the recording cannot be read or compared, or the body refuses its parameters.
        """
        began = time.perf_counter()
        numbers = {key: value for key, value in values.items() if key != RECORDING_KEY}
        scene = self.scene.at(numbers) if numbers else self.scene
        replayer = self._replayer(int(values.get(RECORDING_KEY, 1.0)), scene)
        motion = replayer.simulate(numbers)
        comparisons = compare_motion(replayer, motion)
        return self._record(replayer, motion, comparisons, time.perf_counter() - began)

    def _record(
        self, replayer: Replayer, motion: Motion, comparisons: list[Comparison], seconds: float
    ) -> RunRecord:
        displacement, velocity, state = replayer.final_state()
        # remarks on skipped samples are equal for all points; remarks on a doubtful alignment are not
        alignment_remarks = [
            f"{c.measured.name}: {text}" for c in comparisons for text in c.alignment.remarks
        ]
        remarks = [*motion.warnings, *alignment_remarks]
        impacts = self.scene.record.impacts
        return RunRecord(
            outcome=Outcome.ok,
            message="; ".join(remarks),
            impacts=motion.impacts if impacts else None,
            sticks=motion.sticks if impacts else None,
            final_displacement=displacement,
            final_velocity=velocity,
            seconds=seconds,
            final_state=padded_state(state, most_elements(self.scene)),
            scores=np.array([_score_row(comparison) for comparison in comparisons]) if comparisons else None,
        )

    def close(self) -> None:
        """Free the components."""
        for replayer in self._replayers.values():
            replayer.close()


def _score_row(comparison: Comparison) -> tuple[float, ...]:
    """Return the columns `analysis.schema.SCORE_COLUMNS` of one comparison."""
    alignment = comparison.alignment
    difference = comparison.simulated_frequency.frequency - comparison.measured_frequency.frequency
    return (
        comparison.variance,
        comparison.gain,
        alignment.lag,
        alignment.lag_error,
        float(alignment.polarity),
        difference,
    )


def _sha256(path: Path) -> str:
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise UsageError(
            f"{path}: expected a recording that can be read, got: {error.strerror or error}. "
            "Make one with `vibroimpact import`."
        ) from error

"""The trial of a replay, driven by all samples of its recording or by every second, fourth, ... sample."""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np

from vibroimpact.analysis.recording import Recording, TimeAxis, open_signals
from vibroimpact.fmus.errors import ComponentError, DatasetError, EstimationError
from vibroimpact.orchestrator.replay.replayer import Replayer, recording_of
from vibroimpact.orchestrator.replay.scoring import compare_motion
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.study.observation import (
    IMPACT_CONTACT,
    IMPACT_TIME,
    IMPACT_VELOCITY,
    LATE,
    Observation,
)

THINNED = (2, 4, 8, 16, 32)
"""Factors by which the samples are thinned out, as on a slower board without a filter."""
DEADLINE = "execution.deadline"
"""Key in the message of a replay that has taken too long."""
LEAST_SAMPLES = 64
"""Least number of samples of the shortest channel after thinning; factors that leave fewer are not tried."""


class ReplayTrial:
    """A replay of the first recording of a scene, with one of `every` samples of each channel.

    UsageError: the scene names no recording. DatasetError: the recording cannot be read.
    """

    is_guarded = False

    def __init__(self, scene: Scene, every: int = 1, part: float = 1.0) -> None:
        recording = thinned(open_signals(recording_of(scene, 1)), every)
        scene = first_part_of_replay(scene, part)
        self._replayer = Replayer(scene, recording, execution=scene.execution.how)
        self._variance: float | None = None

    def run(self) -> Observation:
        """Simulate the replay once; its score, the same in each run, is computed once and not timed."""
        began, replayer = time.perf_counter(), self._replayer
        try:
            motion = replayer.simulate()
        except ComponentError as error:
            said, now = str(error).splitlines()[0], error.time
            late = said.startswith(f"{replayer.scene.source}: {DEADLINE}:")
            span = float(replayer.time[-1] - replayer.time[0])
            return Observation(
                seconds=time.perf_counter() - began,
                failure=LATE if late else said,
                reached=math.nan if now is None else now / span,
            )
        seconds = time.perf_counter() - began
        if self._variance is None:
            try:
                self._variance = min((c.variance for c in compare_motion(replayer, motion)), default=math.nan)
            except EstimationError:
                self._variance = math.nan  # too few samples for a score; the motion is compared all the same
        return Observation(
            motion.impacts[:, [IMPACT_TIME, IMPACT_VELOCITY, IMPACT_CONTACT]],
            samples=np.column_stack(motion.readings) if motion.readings else None,
            sample_times=motion.time,
            seconds=seconds,
            variance=self._variance,
        )

    def close(self) -> None:
        """Free the components."""
        self._replayer.close()


def thinned(recording: Recording, every: int) -> Recording:
    """Return a recording with one of `every` samples of each channel, starting with the first sample."""
    if every == 1:
        return recording
    axes = {id(channel.axis): _thinned_axis(channel.axis, every) for channel in recording.channels.values()}
    channels = {
        name: replace(
            channel,
            values=channel.values[::every],
            quality=channel.quality[::every],
            axis=axes[id(channel.axis)],
        )
        for name, channel in recording.channels.items()
    }
    return replace(recording, channels=channels)


def _thinned_axis(axis: TimeAxis, every: int) -> TimeAxis:
    return replace(
        axis, time=axis.time[::every], interval=None if axis.interval is None else axis.interval * every
    )


def rates_of(scene: Scene) -> dict[int, float]:
    """Return the possible thinning factors of a scene's recording, each with the rate that is left, 1/s.

    The rate belongs to the driving channel, or else to the first compared channel. DatasetError: the recording cannot
    be read, or has no such channel.
    """
    replay = scene.replay
    assert replay is not None
    recording = open_signals(recording_of(scene, 1))
    name = replay.channel if replay.drive is not None else replay.compare[0].measured
    axis = recording.channel(name).axis
    if len(axis.time) < 2:
        raise DatasetError(f"{recording.title}: {name}: expected at least two samples, got {len(axis.time)}.")
    least = min(len(channel.time) for channel in recording.channels.values())
    return {every: axis.rate / every for every in THINNED if least // every >= LEAST_SAMPLES}


def first_part_of_replay(scene: Scene, part: float) -> Scene:
    """Return a replay that ends after the first part of its time."""
    if part == 1.0:
        return scene
    begin, end = span_of(scene)
    return scene.with_values({"replay.stop": begin + part * (end - begin)})


def span_of(scene: Scene) -> tuple[float, float]:
    """Return the start and the end of the replay of a scene, s."""
    with Replayer(scene, open_signals(recording_of(scene, 1)), execution="fused") as replayer:
        return float(replayer.time[0]), float(replayer.time[-1])

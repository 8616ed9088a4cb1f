"""The beginning of a campaign in this process: a short campaign needs no workers, which take seconds to start.

Chunks, parts and bits equal those of workers. Workers take over as soon as more than `HERE_SECONDS` of work are left at
the measured pace, or a chunk takes that long. Threads of this process, where they can (`threads`), take over earlier.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial

from vibroimpact.analysis.files.object_paths import located
from vibroimpact.orchestrator.campaign.parts import StoredPart
from vibroimpact.orchestrator.campaign.rounds import Stage
from vibroimpact.orchestrator.campaign.schedule import ChunkSchedule
from vibroimpact.orchestrator.campaign.workers.chunks import (
    ChunkResult,
    Work,
    lay_down,
    run_chunk,
    take_up,
)
from vibroimpact.orchestrator.run.record import RunsAbandonedError, runs_abandoned
from vibroimpact.orchestrator.running.kept import OpenedScene, opened_scene
from vibroimpact.orchestrator.running.opening import DEFAULT_RUNNER
from vibroimpact.orchestrator.scene import Scene

HERE_SECONDS = 2.0
"""Work left, or work of one chunk, s, above which workers take over: about the time of their start."""

FEW_SECONDS = 0.2
"""Work left, s, above which threads take over; they start in some milliseconds."""

_ONE_AT_A_TIME = threading.Lock()
"""Lock of the campaign that computes in this process; a campaign of another thread starts workers."""


def may_begin_here(scene: Scene, runner: str, points: int) -> bool:
    """Return whether a campaign may begin in this process, where no component can crash or block it.

    The package's own bodies do neither. Guarded components run in a child process, which pays only for one point.
    """
    if runner != DEFAULT_RUNNER:
        return False
    return points == 1 if scene.execution.guard else scene.is_one_body


@contextmanager
def opened_here(work: Work) -> Iterator[OpenedScene | None]:
    """Open a scene in this process for the block; None where another campaign of this process computes in it."""
    if not _ONE_AT_A_TIME.acquire(blocking=False):
        yield None
        return
    try:
        with opened_scene(work.scene, work.execution or None, work.runner) as opened:
            take_up(work, opened)
            yield opened
    finally:
        lay_down()
        _ONE_AT_A_TIME.release()


def computed_here(
    work: Work,
    stage: Stage,
    schedule: ChunkSchedule,
    done: Callable[[ChunkResult], object],
    most_left: float | None = None,
) -> Stage | None:
    """Compute a stage until it is complete (None), or until too much is left for this process; return the stage then.

    The work is opened in this process (`opened_here`), and the schedule is for one worker. `done` gets the result of
    each chunk whose part is on the disk. The returned stage has the parts of this process. Too much is left if it takes
    more than `most_left` seconds, by default `HERE_SECONDS`.
    """
    most_left = HERE_SECONDS if most_left is None else most_left
    results: list[ChunkResult] = []
    while (chunk := schedule.next_chunk()) is not None:
        try:
            over = time.perf_counter() + HERE_SECONDS
            with runs_abandoned(partial(_is_past, over)):
                result = run_chunk(work, chunk)
        except RunsAbandonedError:
            return _with_parts(stage, results)
        schedule.finished(chunk, result)
        results.append(result)
        done(result)
        if schedule.seconds_left > most_left:
            return _with_parts(stage, results)
    return None


def _is_past(instant: float) -> bool:
    """Return whether an instant, s of `time.perf_counter`, is over."""
    return time.perf_counter() > instant


def _with_parts(stage: Stage, results: Iterable[ChunkResult]) -> Stage:
    """Return a stage that also holds the parts of these results."""
    parts = [StoredPart(located(one.path), one.chunk, one.carried, one.chunk.count) for one in results]
    return replace(stage, held=sorted([*stage.held, *parts], key=lambda part: part.chunk.first))

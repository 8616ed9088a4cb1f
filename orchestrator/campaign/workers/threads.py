"""The chunks of a campaign by threads of this process: points in lanes run in C, where threads run side by side.

Threads start at once; worker processes import for two seconds, and talk TLS. Chunks, parts and bits are the same.
Only scenes in lanes go by threads: none of their components can crash or block this process, and none has a deadline.
"""

from __future__ import annotations

import ctypes
import sys
import threading
from collections.abc import Callable
from contextvars import copy_context
from queue import Empty, SimpleQueue

from vibroimpact.orchestrator.campaign.schedule import ChunkSchedule
from vibroimpact.orchestrator.campaign.workers.chunks import (
    Chunk,
    ChunkResult,
    Work,
    lay_down,
    run_chunk,
    take_up,
)
from vibroimpact.orchestrator.campaign.workers.pieces import MOST_BYTES
from vibroimpact.orchestrator.campaign.workers.processors import processor_count
from vibroimpact.orchestrator.run.record import RunsAbandonedError, runs_abandoned
from vibroimpact.orchestrator.running.kept import opened_scene

MOST_THREADS = 4
"""Largest number of processors that threads keep busy. A point takes .6 us of Python, in one thread at a time."""

BYTES_OF_A_THREAD = MOST_BYTES // 4
"""Size of the results of a thread's chunk, bytes, above which it ends early: all threads share one memory."""

WAIT_SECONDS = 0.5
"""Time after which the waiting thread hears Ctrl-C, s, on systems whose waits cannot be interrupted."""

MAPPED_BYTES = 1 << 18
"""Size of an array, bytes, from which the C library maps its memory alone, and so gives it back when it is freed.

Fresh pages cost .15 us a point. Half this size would cost .65 us, since arrays of a piece would be mapped, too.
"""
_MMAP_THRESHOLD = -3
"""Number of this setting in mallopt(3) of glibc."""

Answer = ChunkResult | BaseException


def thread_count(execution: str) -> int:
    """Return the number of threads that compute points of an execution here; 0 where worker processes do it."""
    processors = processor_count()
    return processors if execution == "lanes" and processors <= MOST_THREADS else 0


def compute_in_threads(
    work: Work, schedule: ChunkSchedule, count: int, done: Callable[[ChunkResult], object]
) -> None:
    """Compute all chunks of a schedule by `count` threads; `done` gets the result of each, in this thread.

    The first error of a thread, or Ctrl-C, ends all threads: a chunk under way is abandoned, and its part is absent.
    """
    _give_arrays_back()
    orders, answers = SimpleQueue[Chunk | None](), SimpleQueue[tuple[Chunk | None, Answer]]()
    ended = threading.Event()
    threads = [
        threading.Thread(
            target=copy_context().run, args=(_compute, work, orders, answers, ended), daemon=True
        )
        for _ in range(count)
    ]
    for thread in threads:
        thread.start()
    in_flight = 0
    try:
        while True:
            while in_flight < schedule.most_in_flight and (chunk := schedule.next_chunk()) is not None:
                orders.put(chunk)
                in_flight += 1
            if not in_flight:
                return
            planned, answer = _next_answer(answers)
            if planned is None or isinstance(answer, BaseException):
                assert isinstance(answer, BaseException)
                raise answer
            in_flight -= 1
            schedule.finished(planned, answer)
            done(answer)
    finally:
        ended.set()
        for _ in threads:
            orders.put(None)
        for thread in threads:
            thread.join()


def _give_arrays_back() -> None:
    """Keep glibc from raising its threshold of mapped memory as arrays are freed: heaps of threads do not shrink."""
    if sys.platform == "linux" and (mallopt := getattr(ctypes.CDLL(None), "mallopt", None)) is not None:
        mallopt(_MMAP_THRESHOLD, MAPPED_BYTES)


def _next_answer(answers: SimpleQueue[tuple[Chunk | None, Answer]]) -> tuple[Chunk | None, Answer]:
    while True:
        try:
            return answers.get(timeout=WAIT_SECONDS)
        except Empty:
            continue


def _compute(
    work: Work,
    orders: SimpleQueue[Chunk | None],
    answers: SimpleQueue[tuple[Chunk | None, Answer]],
    ended: threading.Event,
) -> None:
    """Run the chunks of a queue on components of this thread's own, until there are none, or all threads end."""
    try:
        with (
            opened_scene(work.scene, work.execution or None, work.runner) as opened,
            runs_abandoned(ended.is_set),
        ):
            take_up(work, opened)
            while (chunk := orders.get()) is not None and not ended.is_set():
                answers.put((chunk, run_chunk(work, chunk)))
    except RunsAbandonedError:
        pass  # nobody waits for the answer
    except BaseException as error:
        answers.put((None, error))
    finally:
        lay_down()

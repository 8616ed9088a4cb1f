"""The processor time of this process and of all processes that it has started."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path

COUNTS_RUNNING = sys.platform == "linux"
"""Whether the system gives the processor time of children that still run."""
OF_ALL_THREADS = 2
"""Kind of clock, in Linux's numbers of the clocks of processes: processor time of all threads of a process."""


def processor_time_of_all() -> float:
    """Return the processor time of this process, its ended children and (on Linux) its running children, s."""
    return time.process_time() + _of_the_ended() + sum(map(_of_one, _descendants(os.getpid())))


def _of_the_ended() -> float:
    """Return the processor time of the children that have ended, with their own children, s."""
    if sys.platform == "win32":
        return 0.0  # Windows does not give it
    import resource

    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _of_one(process: int) -> float:
    try:
        return time.clock_gettime((~process << 3) | OF_ALL_THREADS)
    except OSError:  # the process has ended since, and counts among the ended
        return 0.0


def _descendants(process: int) -> Iterator[int]:
    """Yield the running children of a process and their children; none where the system does not list them."""
    for thread in Path(f"/proc/{process}/task").glob("*/children"):
        try:
            children = thread.read_text().split()
        except OSError:  # the thread has ended
            continue
        for child in map(int, children):
            yield child
            yield from _descendants(child)

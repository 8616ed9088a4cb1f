"""The processor time of this process and of all that it has started."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path

COUNTS_RUNNING = sys.platform == "linux"
"""Whether the system tells the processor time of children that run still."""
OF_ALL_THREADS = 2
"""Kind of clock, in Linux's numbers of the clocks of processes: what all threads of a process have spent."""


def processor_time_of_all() -> float:
    """Return the processor time of this process, of those it has waited for and (on Linux) of those that run, s."""
    return time.process_time() + _of_the_ended() + sum(map(_of_one, _descendants(os.getpid())))


def _of_the_ended() -> float:
    """Return the processor time of the children that have ended, with that of their own, s."""
    if sys.platform == "win32":
        return 0.0  # the system does not tell it
    import resource

    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _of_one(process: int) -> float:
    try:
        return time.clock_gettime((~process << 3) | OF_ALL_THREADS)
    except OSError:  # it has ended since, and counts among the ended
        return 0.0


def _descendants(process: int) -> Iterator[int]:
    """Yield the children of a process that run, and theirs; none where the system does not list them."""
    for thread in Path(f"/proc/{process}/task").glob("*/children"):
        try:
            children = thread.read_text().split()
        except OSError:  # the thread has ended
            continue
        for child in map(int, children):
            yield child
            yield from _descendants(child)

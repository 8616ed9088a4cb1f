"""The memory of each way: the way runs once in its own process, whose resident memory the system counts."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Mapping, Sequence
from typing import Any

from vibroimpact.fmus.errors import VibroimpactError
from vibroimpact.fmus.processes.call import ProcessDied, call_alone
from vibroimpact.fmus.processes.fork import forked
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.study.processor import processor_time_of_all
from vibroimpact.orchestrator.study.ways.all_ways import ways_of
from vibroimpact.orchestrator.study.ways.way import Way

UNKNOWN = -1
"""Memory of a way that was not measured, in place of bytes."""
IS_MEASURED = sys.platform == "linux"
"""Whether the peak of a forked process gives its resident memory, which is so only on Linux."""


def memory_of_ways(
    scene: Scene, given: Mapping[str, Any], parts: Sequence[tuple[int, float]], seconds: float = math.inf
) -> dict[int, int]:
    """Return the largest resident memory that ways add to a process, of Python and FMUs, by place, bytes.

    A new process loads only this package. Each way opens and runs once in a fork of it, so no way finds libraries of
    another. Libraries of FMUs and Python modules that a way loads count.

    The scene has no sweep; `given` are the other arguments of `ways_of`. Each entry of `parts` is the place of a way
    in `ways_of` and the part of the time that it simulates. No way starts after `seconds` of processor time. Ways
    whose process died or for which no time was left are missing. The result is empty where the system has no such
    count, or where the FMUs run in processes of their own.
    """
    guarded = scene.execution.guard
    if guarded or not IS_MEASURED:
        return {}
    try:
        found: dict[int, int] = call_alone(_in_forks, scene, dict(given), tuple(parts), seconds)
    except ProcessDied:
        return {}
    return found


def _in_forks(
    scene: Scene, given: dict[str, Any], parts: tuple[tuple[int, float], ...], seconds: float
) -> dict[int, int]:
    ways, found = ways_of(scene, **given), {}
    for place, part in parts:
        if processor_time_of_all() > seconds:
            break
        found[place] = memory_in_fork(ways[place], part)
    return {place: memory for place, memory in found.items() if memory != UNKNOWN}


def memory_in_fork(way: Way, part: float = 1.0) -> int:
    """Open and run a way in a fork of this process; return the growth of its peak resident memory, bytes."""
    answers, answer = os.pipe()
    process = forked(lambda: os.write(answer, str(_growth(way, part)).encode()))
    os.close(answer)
    with os.fdopen(answers) as pipe:
        said = pipe.read()
    os.waitpid(process, 0)
    return int(said) if said else UNKNOWN


def _growth(way: Way, part: float) -> int:
    before = _peak()
    try:
        trial = way.open(None, part)
        trial.run()
    except VibroimpactError:
        return UNKNOWN
    return _peak() - before


def _peak() -> int:
    """Return the peak resident memory of this process, bytes."""
    import resource

    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

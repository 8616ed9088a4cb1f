"""What memory a way takes: each runs once in a process of its own, whose resident memory the system counts."""

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
"""Where nobody measures it."""
IS_MEASURED = sys.platform == "linux"
"""Elsewhere the resident memory of a process that was forked is not told by its peak."""


def memory_of_ways(
    scene: Scene, given: Mapping[str, Any], parts: Sequence[tuple[int, float]], seconds: float = math.inf
) -> dict[int, int]:
    """Return the largest resident memory that ways add to a process, by place, Python's and that of the FMUs, bytes.

    A process is started that loads this package and nothing else; each way is opened and run once in a fork of it, so
    that none finds what another has left. Libraries of FMUs and Python modules that a way loads count, too. The scene
    has no sweep; `given` is what `ways_of` is given beside it. Of each way that is measured `parts` have its place, in
    the order of `ways_of`, and the part of the time that it simulates. After so many seconds of processor time no
    further way is measured. What a process that died would have taken is missing, and ways for which no time was left.
    Nothing is there where the system does not tell, or the FMUs run in processes of their own.
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
    """Open and run a way in a fork of this process; return what its resident memory grew by at most, bytes."""
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
    """Return the largest resident memory that this process has had, bytes."""
    import resource

    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

"""One point simulated on demand, in a process with a deadline, for clicks on a diagram."""

from __future__ import annotations

import threading
from http import HTTPStatus
from pathlib import Path
from typing import Any

from vibroimpact.fmus.processes.call import call
from vibroimpact.fmus.processes.python_child import ending
from vibroimpact.service.problems import ProblemError

DEADLINE = 30.0
"""Time limit for a point, s."""
MOST_AT_ONCE = 2
"""Largest number of points simulated at the same time: campaigns need the processors too."""
_FREE = threading.BoundedSemaphore(MOST_AT_ONCE)


def simulated_point(scene: Path, results: Path, run: int) -> dict[str, Any]:
    """Return the motion of one point of a campaign, by its index.

    Results are the folder of the campaign, or the dataset of a run; they hold the end state of the point before. Raise
    ProblemError if the point took too long or failed, or if too many points are being simulated.
    """
    if not _FREE.acquire(blocking=False):
        raise ProblemError(
            HTTPStatus.TOO_MANY_REQUESTS,
            f"expected fewer than {MOST_AT_ONCE} points that are being simulated. Ask again.",
            {"Retry-After": "1"},
        )
    try:
        found = _answer(scene, results, run)
    finally:
        _FREE.release()
    if "failed" in found:
        raise ProblemError(HTTPStatus.UNPROCESSABLE_ENTITY, found["failed"])
    return found


def _answer(scene: Path, results: Path, run: int) -> dict[str, Any]:
    function = "vibroimpact.service.point_process:answer"
    done = call(function, str(scene), str(results), run, seconds=DEADLINE)
    if done.is_late:
        raise ProblemError(
            HTTPStatus.UNPROCESSABLE_ENTITY,
            f"run: expected a point of at most {DEADLINE:g} s, got one that takes longer. "
            "Simulate it with the command line.",
        )
    if done.code or done.answer is None:
        raise ProblemError(
            HTTPStatus.UNPROCESSABLE_ENTITY, f"run: its process {ending(done.code)}: {done.last_line}"
        )
    found: dict[str, Any] = done.answer
    return found

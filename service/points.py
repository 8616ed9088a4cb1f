"""One point simulated on demand, in a process with a deadline: what clicks on a diagram show."""

from __future__ import annotations

import threading
from http import HTTPStatus
from pathlib import Path
from typing import Any

from vibroimpact.fmus.processes.call import call
from vibroimpact.fmus.processes.python_child import ending
from vibroimpact.service.problems import ProblemError

DEADLINE = 30.0
"""Seconds that a point may take."""
MOST_AT_ONCE = 2
"""Points that are simulated side by side: campaigns need the processors too."""
_FREE = threading.BoundedSemaphore(MOST_AT_ONCE)


def simulated_point(scene: Path, results: Path, run: int) -> dict[str, Any]:
    """Return the motion of one point of a campaign, by its index.

    Results are its folder, or the dataset of a run: where the point before it ended. ProblemError: it took too long,
    failed, or too many are being simulated.
    """
    if not _FREE.acquire(blocking=False):
        raise ProblemError(
            HTTPStatus.TOO_MANY_REQUESTS,
            f"expected fewer than {MOST_AT_ONCE} points that are being simulated. Ask again.",
            {"Retry-After": "1"},
        )
    try:
        said = _answer(scene, results, run)
    finally:
        _FREE.release()
    if "failed" in said:
        raise ProblemError(HTTPStatus.UNPROCESSABLE_ENTITY, said["failed"])
    return said


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

"""One point simulated on demand, in a process with a deadline: what clicks on a diagram show."""

from __future__ import annotations

import json
import os
import subprocess
import threading
from http import HTTPStatus
from pathlib import Path
from typing import Any

from vibroimpact.fmus.processes.python_child import ending, python_command
from vibroimpact.service.child import kill_session
from vibroimpact.service.problems import ProblemError

DEADLINE = 30.0
"""Seconds that a point may take."""
MOST_AT_ONCE = 2
"""Points that are simulated side by side: campaigns need the processors too."""
_FREE = threading.BoundedSemaphore(MOST_AT_ONCE)


def simulated_point(scene: Path, results: Path, run: int) -> dict[str, Any]:
    """Return the motion of one point of a campaign.

    Parameters
    ----------
    scene : Path
        Scene file.
    results : Path
        Folder of the campaign, or dataset of a run: where the point before it ended.
    run : int
        Index of the point.

    Raises
    ------
    ProblemError
        It took too long, failed, or too many are being simulated.
    """
    if not _FREE.acquire(blocking=False):
        raise ProblemError(
            HTTPStatus.TOO_MANY_REQUESTS,
            f"expected fewer than {MOST_AT_ONCE} points that are being simulated. Ask again.",
            {"Retry-After": "1"},
        )
    try:
        said = _said_by_process(scene, results, run)
    finally:
        _FREE.release()
    if "failed" in said:
        raise ProblemError(HTTPStatus.UNPROCESSABLE_ENTITY, said["failed"])
    return said


def _said_by_process(scene: Path, results: Path, run: int) -> dict[str, Any]:
    module = "vibroimpact.service.point_process"
    process = subprocess.Popen(
        python_command("-m", module, str(scene), str(results), str(run)),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        encoding="utf-8",
        errors="replace",
        start_new_session=os.name == "posix",
    )
    with process:
        try:
            out, said = process.communicate(timeout=DEADLINE)
        except subprocess.TimeoutExpired:
            raise ProblemError(
                HTTPStatus.UNPROCESSABLE_ENTITY,
                f"run: expected a point of at most {DEADLINE:g} s, got one that takes longer. "
                "Simulate it with the command line.",
            ) from None
        finally:
            kill_session(process)
    lines = out.splitlines()
    if process.returncode or not lines:
        last = said.strip().splitlines()[-1:] or [""]
        raise ProblemError(
            HTTPStatus.UNPROCESSABLE_ENTITY, f"run: its process {ending(process.returncode)}: {last[0]}"
        )
    found: dict[str, Any] = json.loads(lines[-1])  # an FMU may print before it
    return found

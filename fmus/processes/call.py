"""A call in a separate process, which may crash, hang, or be ended by the code that it loads."""

from __future__ import annotations

import json
import math
import pickle
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from vibroimpact.fmus.processes.child import LENGTH
from vibroimpact.fmus.processes.process import Process
from vibroimpact.fmus.processes.python_child import ending

POLL_SECONDS = 0.5
"""Interval at which the waiting process checks the call, s."""
_CHILD = ("-m", "vibroimpact.fmus.processes.child")


class ProcessDied(Exception):
    """The process ended without an answer; the text names its exit code or signal."""


@dataclass(frozen=True, slots=True)
class Called:
    """Outcome of a call."""

    code: int
    """Exit code of its process (negative: the signal)."""
    answer: Any
    """Result of the function, from JSON; None: the process ended without one."""
    stderr: str
    """Text that the process wrote to its standard error."""
    is_late: bool
    """Whether the call exceeded its time limit."""

    @property
    def last_line(self) -> str:
        """The last line that the process wrote to its standard error, or empty."""
        return (self.stderr.strip().splitlines() or [""])[-1]


def call(
    function: str,
    *arguments: Any,
    seconds: float,
    errors: Literal["dropped", "kept"] = "kept",
    folder: Path | None = None,
) -> Called:
    """Call a function in a process that may crash or hang; nothing that the process starts in its session outlives it.

    Parameters
    ----------
    function : str
        `package.module:function`, with arguments and a result that JSON can hold; or a module to run as a program.
    *arguments
        Arguments of the function, or of the program.
    seconds : float
        Limit of the wall time, s.
    errors : str
        Whether its standard error is `kept` or `dropped`.
    folder : Path, optional
        Current folder of the process; the default is the current folder of this process.

    Raises
    ------
    OSError
        The process cannot be started.
    """
    with Process(*_CHILD, function, str(seconds), errors=errors, folder=folder) as process:
        answer, stderr, is_late = _ended(process, json.dumps(arguments).encode(), seconds)
    try:
        found = json.loads(answer)
    except ValueError:  # no answer, or an incomplete one
        found = None
    return Called(process.returncode, found, stderr.decode(errors="replace"), is_late)


def call_alone(function: Callable[..., Any], *arguments: Any) -> Any:
    """Call a function of this package in a new process and return its result.

    Parameters
    ----------
    function : callable
        Function that can be imported by name, with picklable arguments and result; it must not read untrusted data.

    Raises
    ------
    ProcessDied
        The process ended before the function did.
    Exception
        The exception of the function.
    """
    # libraries show no warnings there, unless a person has asked for them
    warned = [f"-W{option}" for option in ("ignore", *sys.warnoptions)]
    with Process(*warned, *_CHILD, errors="shared") as process:
        answer, _, _ = _ended(
            process, pickle.dumps((sys.path, pickle.dumps((function, arguments)))), math.inf
        )
    if process.returncode:
        raise ProcessDied(f"it {ending(process.returncode)}")
    result, error = pickle.loads(answer)
    if error is not None:
        raise error
    return result


def _ended(process: Process, order: bytes, seconds: float) -> tuple[bytes, bytes, bool]:
    """Give a process its order and wait for its end; return its answer, its standard error, and whether it was late."""
    end = time.monotonic() + seconds
    process.say([LENGTH.pack(len(order)), order])
    # `communicate` would close the pipe, and so end the process
    orders, process.stdin = process.stdin, None  # type: ignore[assignment]  # Popen types it as always there
    is_killed = is_late = False
    try:
        while True:
            try:
                answer, stderr = process.communicate(
                    timeout=max(0.0, min(POLL_SECONDS, end - time.monotonic()))
                )
            except subprocess.TimeoutExpired as so_far:
                if is_killed:  # a process outside of the session still holds a pipe open
                    return so_far.output or b"", so_far.stderr or b"", is_late
                has_ended = process.poll() is not None
                is_late = not has_ended and time.monotonic() >= end
                is_killed = has_ended or is_late
                if is_killed:
                    process.kill_session()
                    end = math.inf
            else:
                return answer, stderr or b"", is_late
    finally:
        process.kill_session()
        process.wait()
        with suppress(BrokenPipeError):
            orders.close()

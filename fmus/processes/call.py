"""A call in a process of its own, which may crash, hang, or be ended by what it loads."""

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
"""How often the waiting process looks up, s."""
_CHILD = ("-m", "vibroimpact.fmus.processes.child")


class ProcessDied(Exception):
    """The process ended without an answer; the text says how."""


@dataclass(frozen=True, slots=True)
class Called:
    """How a call ended."""

    code: int
    """Exit code of its process (negative: the signal)."""
    answer: Any
    """What the function returned, from JSON; None: the process ended before."""
    said: str
    """What the process wrote to its standard error."""
    is_late: bool
    """Whether it took too long."""

    @property
    def last_line(self) -> str:
        """The last line that the process wrote to its standard error; empty: none."""
        return (self.said.strip().splitlines() or [""])[-1]


def call(
    function: str,
    *arguments: Any,
    seconds: float,
    errors: Literal["dropped", "kept"] = "kept",
    folder: Path | None = None,
) -> Called:
    """Call a function in a process that may crash or hang; nothing that it has started in its session outlives it.

    Parameters
    ----------
    function : str
        `package.module:function`, from what JSON can say to what JSON can say; or a module, which is run as a program.
    *arguments
        Those of the function, or the words after the program.
    seconds : float
        Wall time that it may take, s.
    errors : str
        Whether what it writes to its standard error is `kept` or `dropped`.
    folder : Path, optional
        Its current folder in place of that of this process.

    Raises
    ------
    OSError
        The process cannot be started.
    """
    with Process(*_CHILD, function, str(seconds), errors=errors, folder=folder) as process:
        answer, said, is_late = _ended(process, json.dumps(arguments).encode(), seconds)
    try:
        found = json.loads(answer)
    except ValueError:  # none, or one that was cut off
        found = None
    return Called(process.returncode, found, said.decode(errors="replace"), is_late)


def call_alone(function: Callable[..., Any], *arguments: Any) -> Any:
    """Call a function of this package in a new process and return what it returns.

    Parameters
    ----------
    function : callable
        Importable by its name, as its arguments and its result are picklable; it reads nothing of strangers.

    Raises
    ------
    ProcessDied
        When the process ended before the function did.
    Exception
        What the function raised.
    """
    # libraries warn nobody there, unless a person has asked for it
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
    """Give a process its order and wait for its end; return its answer, what it said, and whether it took too long."""
    end = time.monotonic() + seconds
    process.say([LENGTH.pack(len(order)), order])
    # `communicate` would close the pipe, and so end the process
    orders, process.stdin = process.stdin, None  # type: ignore[assignment]
    is_killed = is_late = False
    try:
        while True:
            try:
                answer, said = process.communicate(
                    timeout=max(0.0, min(POLL_SECONDS, end - time.monotonic()))
                )
            except subprocess.TimeoutExpired as so_far:
                if is_killed:  # what it has started has left its session, and holds a pipe open
                    return so_far.output or b"", so_far.stderr or b"", is_late
                has_ended = process.poll() is not None
                is_late = not has_ended and time.monotonic() >= end
                is_killed = has_ended or is_late
                if is_killed:
                    process.kill_session()
                    end = math.inf
            else:
                return answer, said or b"", is_late
    finally:
        process.kill_session()
        process.wait()
        with suppress(BrokenPipeError):
            orders.close()

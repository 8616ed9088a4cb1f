"""The process that reads files first: whatever damaged bytes do to the compiled libraries, they do it here.

Run by `probing`, as a file and not as a module: it needs the libraries alone. It answers each line of standard input,
a JSON object, with one line: {"verdict": "sound" | "raised" | "died" | "late", "error": ..., "text": ...}. Each file is
read in a process of its own, made by `fork` from this one, in which the libraries are imported already. A timer of
the system ends that process, also inside a library that never returns.
"""

from __future__ import annotations

import importlib
import json
import math
import os
import select
import signal
import sys
from collections.abc import Callable
from typing import Any

#: After this time without a file to read this process ends, s.
IDLE = 30.0
#: Values that are read at a time.
BLOCK = 1 << 20
#: Address space of the process that reads, bytes: what a file of some bytes promises may be any number.
MEMORY = 4 << 30
LONGEST_TEXT = 300


def read_netcdf(path: str, options: dict[str, Any]) -> None:
    """Read every attribute and every value of a NetCDF file; `most_bytes` is what it may promise."""
    import netCDF4

    with netCDF4.Dataset(path, "r") as file:
        file.set_auto_maskandscale(False)
        promised = sum(_size(variable) for variable in file.variables.values())
        if promised > options["most_bytes"]:
            raise ValueError(f"it promises {promised} bytes of values, at most {options['most_bytes']} fit")
        holders: list[Any] = [file, *file.variables.values()]
        for holder in holders:
            for name in holder.ncattrs():
                holder.getncattr(name)
        for variable in file.variables.values():
            _read_values(variable)


def _size(variable: Any) -> int:
    return math.prod(int(size) for size in variable.shape) * getattr(variable.dtype, "itemsize", 8)


def _read_values(variable: Any) -> None:
    if not variable.shape or 0 in variable.shape:
        variable[...]
        return
    rows = max(1, BLOCK // math.prod(variable.shape[1:]))
    for first in range(0, variable.shape[0], rows):
        variable[first : first + rows]


def read_matlab(path: str, options: dict[str, Any]) -> None:
    """Read the arrays of a MATLAB file whose class is among `classes`."""
    from scipy.io import loadmat, whosmat

    listed = whosmat(path)
    loadmat(path, variable_names=[name for name, _, kind in listed if kind in options["classes"]])


READERS: dict[str, Callable[[str, dict[str, Any]], None]] = {"NetCDF": read_netcdf, "MATLAB": read_matlab}
LIBRARIES = {"NetCDF": "netCDF4", "MATLAB": "scipy.io"}


def read_here(order: dict[str, Any]) -> dict[str, str]:
    """Read the file of an order in this process."""
    try:
        READERS[order["kind"]](order["path"], order["options"])
    # whatever it is, it is what the file does to its reader
    except BaseException as error:
        return {"verdict": "raised", "error": type(error).__name__, "text": str(error)[:LONGEST_TEXT]}
    return {"verdict": "sound"}


def read_in_fork(order: dict[str, Any]) -> dict[str, str]:
    """Read the file of an order in a process of its own; say how that ended."""
    answers, answer = os.pipe()
    process = os.fork()
    if process == 0:
        os.close(answers)
        _limit(order["seconds"])
        os.write(answer, json.dumps(read_here(order)).encode())
        os._exit(0)
    os.close(answer)
    with os.fdopen(answers, "rb") as pipe:
        # standard input speaks only when nobody waits for this answer any more
        if select.select([0, pipe.fileno()], [], [])[0] == [0]:
            os.kill(process, signal.SIGKILL)
        said = pipe.read()
    _, status = os.waitpid(process, 0)
    if os.WIFSIGNALED(status):
        ended_by = os.WTERMSIG(status)
        return {"verdict": "late" if ended_by == signal.SIGALRM else "died", "error": str(ended_by)}
    if status != 0 or not said:
        return {"verdict": "died", "error": ""}
    found: dict[str, str] = json.loads(said)
    return found


def _limit(seconds: float) -> None:
    """Let the system end this process after a time, and give it no more than `MEMORY`."""
    import resource

    ending = {signal.SIGALRM, signal.SIGINT}
    for number in ending:
        signal.signal(number, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, ending)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    _, most = resource.getrlimit(resource.RLIMIT_AS)
    try:
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, most))
    except (ValueError, OSError):
        return  # the system allows less already, or knows no such limit


def main() -> None:
    """Answer orders until standard input ends, or none has come for a while."""
    answers = os.dup(1)
    os.dup2(2, 1)  # what a library prints is no answer
    forks = hasattr(os, "fork")
    while not forks or select.select([0], [], [], IDLE)[0]:
        line = sys.stdin.buffer.readline()
        if not line:
            return
        order = json.loads(line)
        importlib.import_module(LIBRARIES[order["kind"]])
        found = read_in_fork(order) if forks else read_here(order)
        os.write(answers, json.dumps(found).encode() + b"\n")


if __name__ == "__main__":
    main()

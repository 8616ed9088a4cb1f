"""Child side of this package's processes: it keeps its pipes to itself, and ends when its pipe of orders closes.

`python -m vibroimpact.fmus.processes.child FUNCTION SECONDS` answers one `call`, without arguments one `call_alone`. An
order is its length followed by as many bytes; an answer is all bytes up to the end of its pipe.
"""

from __future__ import annotations

import importlib
import json
import os
import pickle
import runpy
import signal
import struct
import sys
import threading
from collections.abc import Sequence
from typing import Any

STANDARD_INPUT, STANDARD_OUTPUT, STANDARD_ERROR = range(3)
#: Format of the length in front of an order.
LENGTH = struct.Struct("<Q")
#: Time beyond the caller's limit after which the system ends a call, even if its caller was killed, s.
GRACE = 5.0


def private_pipes(*, silent: bool = False) -> tuple[int, int]:
    """Reserve the pipes of orders and of answers; return their descriptors.

    Then neither an FMU nor a program that it starts can read an order, or hold the pipe of answers open. Their output
    goes to standard error, or nowhere if `silent`.
    """
    orders, answers = os.dup(STANDARD_INPUT), os.dup(STANDARD_OUTPUT)
    nothing = os.open(os.devnull, os.O_RDWR)
    os.dup2(nothing, STANDARD_INPUT)
    os.dup2(nothing if silent else STANDARD_ERROR, STANDARD_OUTPUT)
    os.close(nothing)
    return orders, answers


def end_when_closed(orders: int) -> None:
    """End this process, and all others in its session, when the pipe of orders ends.

    The parent process closes the pipe, at the latest by its own end.
    """
    threading.Thread(target=_wait_for_end, args=(orders,), daemon=True).start()


def _wait_for_end(orders: int) -> None:
    os.read(orders, 1)
    if hasattr(os, "killpg"):
        os.killpg(os.getpid(), signal.SIGKILL)
    os._exit(1)


def write_whole(pipe: int, rows: Sequence[Any]) -> None:
    """Write rows of bytes to a pipe completely."""
    for row in rows:
        rest = memoryview(row)
        while rest:
            rest = rest[os.write(pipe, rest) :]


def _order(orders: int) -> bytes:
    """Return an order; end this process if the pipe ends before, since the caller is gone."""
    (size,) = LENGTH.unpack(_read_whole(orders, LENGTH.size))
    return _read_whole(orders, size)


def _read_whole(pipe: int, size: int) -> bytes:
    found = bytearray()
    while len(found) < size:
        part = os.read(pipe, size - len(found))
        if not part:
            os._exit(1)
        found += part
    return bytes(found)


def _answer(name: str, seconds: float) -> None:
    """Answer a call with the JSON of the function's result; a module without a function is run as a program."""
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, seconds + GRACE)
    orders, answers = private_pipes(silent=True)
    arguments = json.loads(_order(orders))
    end_when_closed(orders)
    module, _, function = name.partition(":")
    if function:
        found = getattr(importlib.import_module(module), function)(*arguments)
        write_whole(answers, [json.dumps(found).encode()])
        os.close(answers)
    else:
        sys.argv = [module, *arguments]
        runpy.run_module(module, run_name="__main__", alter_sys=True)


def _answer_alone() -> None:
    """Answer a call of this package's own with a pickle of the function's result or exception."""
    orders, answers = private_pipes()
    sys.path[:], order = pickle.loads(_order(orders))
    end_when_closed(orders)
    function, arguments = pickle.loads(order)
    try:
        answer: tuple[Any, Exception | None] = function(*arguments), None
    except Exception as error:
        # the exception belongs to the caller, in the other process
        answer = None, error
    write_whole(answers, [pickle.dumps(answer)])
    os._exit(0)  # nothing that is left of an FMU needs to end


if __name__ == "__main__":
    if sys.argv[1:]:
        _answer(sys.argv[1], float(sys.argv[2]))
    else:
        _answer_alone()

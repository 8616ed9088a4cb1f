"""Reading of an untrusted file in a separate process, whose answer is JSON and raw bytes, never a pickle.

A library may crash on damaged bytes, run forever, or take all memory; it does so in `reader_child`. On Linux a fork of
this process reads the file (`reader_fork`). On other systems, and after a fork that waits in vain or crashes, a
server reads it. The server starts with the first file, serves all later ones, and ends by itself when idle.
"""

from __future__ import annotations

import atexit
import json
import os
import signal
import sys
import threading
from dataclasses import asdict
from pathlib import Path

from vibroimpact.fmus.confinement import PATIENCE
from vibroimpact.fmus.processes.child import write_whole
from vibroimpact.fmus.processes.process import Process
from vibroimpact.fmus.reader_fork import read_in_fork
from vibroimpact.fmus.reader_orders import Answer, Order, received

__all__ = ["Answer", "Order", "ReaderServer", "read_apart"]

#: Longest time to start Python and import the libraries, on a loaded machine, s.
START_SECONDS = 60.0
#: Longest time for the process to end by itself, s.
STOP_SECONDS = 3.0
#: Whether to try a fork first; on macOS the libraries do not survive a fork.
FORKS = sys.platform == "linux"
_CHILD = Path(__file__).with_name("reader_child.py")


def read_apart(order: Order) -> Answer:
    """Read a file in a separate process: a fork of this process, or the server's if the fork's outcome is unsure.

    Any number of threads may call this function.
    """
    answer = read_in_fork(order) if FORKS else None
    return _server.ask(order) if answer is None or _has_crashed(answer) else answer


def _has_crashed(answer: Answer) -> bool:
    """Return whether a fork has crashed; inherited state may be the cause, so a fresh process decides."""
    return answer.verdict == "died" and answer.error != str(int(signal.SIGKILL))


class ReaderServer:
    """The process that reads files, and the pipe to it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process: Process | None = None

    def ask(self, order: Order) -> Answer:
        """Return the outcome of reading the file of an order."""
        line = json.dumps(asdict(order)).encode() + b"\n"
        with self._lock:
            # A server that ended when idle gives no answer; one that the system ended says nothing about the file.
            answer = self._answer(line, order)
            if answer is None:
                self._start()
                answer = self._answer(line, order)
        return answer or Answer("died")

    def _start(self) -> None:
        self.close()
        environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        self._process = Process(str(_CHILD), environment=environment)

    def _answer(self, line: bytes, order: Order) -> Answer | None:
        """Return the answer; None if the process is gone, at the latest some time after the limit of the order."""
        process = self._process
        if process is None:
            return None
        late = threading.Timer(PATIENCE * order.seconds + START_SECONDS, process.kill)
        late.daemon = True
        late.start()
        try:
            write_whole(process.stdin.fileno(), [line])
            with open(process.stdout.fileno(), "rb", closefd=False) as stream:
                answer = received(stream, order.most_bytes)
            if answer is None:  # further output would be no answer
                process.kill()
                process.wait()
            return answer
        except BrokenPipeError:
            return None
        except BaseException:
            self.close()  # the next caller would get this answer
            raise
        finally:
            late.cancel()

    def close(self) -> None:
        """End the server, and with it the process that reads."""
        process, self._process = self._process, None
        if process is None:
            return
        process.end(STOP_SECONDS)
        process.stdout.close()

    def forget(self) -> None:
        """Keep a child made by `fork` from reading the answers meant for its parent."""
        process, self._lock, self._process = self._process, threading.Lock(), None
        if process is not None:
            process.stdin.close()
            process.stdout.close()
            process.returncode = 0  # the server is not a child of this process


_server = ReaderServer()
atexit.register(_server.close)
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_server.forget)

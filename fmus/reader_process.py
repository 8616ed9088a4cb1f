"""Lets a process of its own read a file of a stranger; its answer is JSON and raw bytes, never a pickle.

A library may crash on damaged bytes, never end, or take all memory: `reader_child` is where it does so. On Linux a fork
of this process reads (`reader_fork`). Elsewhere, and where a fork waits in vain or crashes, a server does: it starts
with the first file, serves all that follow, and ends by itself when none comes.
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

#: Starting Python and importing the libraries, on a loaded machine, s.
START_SECONDS = 60.0
#: What the process may take to end by itself, s.
STOP_SECONDS = 3.0
#: Whether a fork reads first; the libraries of macOS are no good after one.
FORKS = sys.platform == "linux"
_CHILD = Path(__file__).with_name("reader_child.py")


def read_apart(order: Order) -> Answer:
    """Let a process of its own read a file: a fork of this one, or where that says nothing sure, one of the server's.

    Any number of threads may ask.
    """
    answer = read_in_fork(order) if FORKS else None
    return _server.ask(order) if answer is None or _has_crashed(answer) else answer


def _has_crashed(answer: Answer) -> bool:
    """Return whether a fork has crashed: what it has of this process may be why, so that a fresh one tells."""
    return answer.verdict == "died" and answer.error != str(int(signal.SIGKILL))


class ReaderServer:
    """The process that reads files, and the pipe to it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process: Process | None = None

    def ask(self, order: Order) -> Answer:
        """Return what reading the file of an order came to."""
        line = json.dumps(asdict(order)).encode() + b"\n"
        with self._lock:
            # One that ended for want of work answers nothing, and one that the system ended says nothing of the file.
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
        """Return the answer; None where the process is gone, which it is some time after the order's."""
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
            if answer is None:  # nothing more that it says would be an answer
                process.kill()
                process.wait()
            return answer
        except BrokenPipeError:
            return None
        except BaseException:
            self.close()  # whoever asks next would get this answer
            raise
        finally:
            late.cancel()

    def close(self) -> None:
        """End the process, which ends the one that reads."""
        process, self._process = self._process, None
        if process is None:
            return
        process.end(STOP_SECONDS)
        process.stdout.close()

    def forget(self) -> None:
        """Let a process made by `fork` not read the answers of the one that it was made from."""
        process, self._lock, self._process = self._process, threading.Lock(), None
        if process is not None:
            process.stdin.close()
            process.stdout.close()
            process.returncode = 0  # it is no child of this one


_server = ReaderServer()
atexit.register(_server.close)
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_server.forget)

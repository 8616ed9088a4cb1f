"""The process of one served instance, as the server sees it."""

from __future__ import annotations

import json
import os
import sys
import tempfile
import threading
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path

from vibroimpact.fmus.packaging.archive import UnpackedFmu
from vibroimpact.fmus.processes.child import LENGTH
from vibroimpact.fmus.processes.process import Process
from vibroimpact.fmus.processes.python_child import ending
from vibroimpact.orchestrator.fmu_server.child import NOTES_SIZE, Notes

SUPERVISOR = "vibroimpact.orchestrator.guard.supervisor"
"""Module that starts the child and ends whatever an FMU has started."""
CHILD = "vibroimpact.orchestrator.fmu_server.child"
END_SECONDS = 10.0
"""Longest time for a process to end, s: longer than its supervisor takes to kill all processes of an FMU."""


class ProcessEnded(Exception):
    """The process ended in a call; the text names the call and the end."""


class FmuProcess:
    """A process with one instance of an FMU."""

    def __init__(self, fmu: UnpackedFmu) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="vibroimpact-fmu-", ignore_cleanup_errors=True)
        path = Path(self._folder.name, "notes")
        path.write_bytes(bytes(NOTES_SIZE))
        self._notes = Notes(path)
        self._lock = threading.Lock()
        self._is_busy = self._is_ended = self._is_abandoned = False
        if sys.platform == "win32":
            self._process = Process("-m", SUPERVISOR, "0", CHILD)
        else:
            unused = os.open(os.devnull, os.O_WRONLY)  # the bell of a guard
            try:
                self._process = Process("-m", SUPERVISOR, str(unused), CHILD, passed=[unused])
            finally:
                os.close(unused)
        order = json.dumps({"fmu": asdict(fmu), "notes": str(path)}, default=str).encode()
        self._process.say([LENGTH.pack(len(order)), order])

    def ask(self, batch: bytes) -> tuple[bytes, bool]:
        """Send a batch; return its answer, and whether others may follow.

        Raises
        ------
        ProcessEnded
            The process ended before it answered.
        """
        self._is_busy = True  # before the look at the other flag: `abandon` sees one of the two
        if self._is_abandoned:
            raise ProcessEnded("its caller is gone")
        self._process.say([LENGTH.pack(len(batch)), batch])
        head = self._process.stdout.read(LENGTH.size)
        answer = self._process.stdout.read(1 + LENGTH.unpack(head)[0]) if len(head) == LENGTH.size else b""
        self._is_busy = False
        if not answer:
            raise ProcessEnded(self._what_happened())
        return answer[1:], bool(answer[0])

    def _what_happened(self) -> str:
        code = self._process.end(END_SECONDS)
        lines = [line for line in self._notes.log.take() if line]
        logged = " | ".join(lines[-5:]) if lines else "nothing"
        return (
            f"the FMU's process {ending(code)} in {self._notes.function or 'its start'}; the component logged last: "
            f"{logged}"
        )

    def abandon(self) -> None:
        """Make no further call; end the process if it is in one, from which the FMU may never come back."""
        self._is_abandoned = True
        if self._is_busy:
            self._process.terminate()

    def end(self) -> None:
        """End the process: the FMU may free its instance within some seconds."""
        with self._lock:
            if self._is_ended:
                return
            self._is_ended = True
        with suppress(OSError):
            self._process.end(END_SECONDS)
        self._process.stdout.close()
        self._folder.cleanup()

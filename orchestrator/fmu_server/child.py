"""The process of one instance of a served FMU, which may crash it; the guard's supervisor starts it."""

from __future__ import annotations

import ctypes
import json
import mmap
import os
import signal
from pathlib import Path
from typing import Any

from vibroimpact.fmus.packaging.archive import UnpackedFmu
from vibroimpact.fmus.processes.child import LENGTH, private_pipes, write_whole
from vibroimpact.orchestrator.fmi.library import Function
from vibroimpact.orchestrator.fmi.log import RING_SIZE, LogTail
from vibroimpact.orchestrator.fmu_server.calls import ServedInstance

NAME_SIZE = 64
"""Bytes for the name of the call under way, in front of the log lines in the file of notes."""
NOTES_SIZE = NAME_SIZE + RING_SIZE


class Notes:
    """The call under way and the last log lines, in a file that outlives the process."""

    def __init__(self, path: Path) -> None:
        with path.open("r+b") as file:
            self._memory = mmap.mmap(file.fileno(), NOTES_SIZE)
        self._name = (ctypes.c_char * NAME_SIZE).from_buffer(self._memory)
        self.log = LogTail(memoryview(self._memory)[NAME_SIZE:])

    @property
    def function(self) -> str:
        """Name of the last call that was begun; empty before the first."""
        return bytes(self._name.value).decode("utf-8", "replace")

    def noted(self, name: str, function: Function) -> Function:
        """Return a function that notes its name before each call."""
        note = self._name
        text = name.encode()[: NAME_SIZE - 1]

        def call(*arguments: Any) -> Any:
            note.value = text
            return function(*arguments)

        return call


def main(bell: int | None) -> None:
    """Answer batches of calls until standard input ends; the first message is the order, as JSON."""
    # Ctrl-C reaches all processes of a terminal; the server ends this one
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if bell is not None:
        os.close(bell)
    given, answers = private_pipes()
    orders = os.fdopen(given, "rb")
    order = json.loads(_message(orders) or b"null")
    if order is None:
        return
    paths = {name: Path(order["fmu"][name]) for name in ("source", "folder")}
    fmu = UnpackedFmu(**{**order["fmu"], **paths, "identifiers": tuple(order["fmu"]["identifiers"])})
    notes = Notes(Path(order["notes"]))
    instance, goes_on = ServedInstance(fmu, notes.log, notes.noted), True
    while goes_on and (message := _message(orders)) is not None:
        answer, goes_on = instance.answer(message)
        write_whole(answers, [LENGTH.pack(len(answer)), bytes([goes_on]), answer])
    instance.free()
    os._exit(0)  # nothing that is left of an FMU needs to end


def _message(orders: Any) -> bytes | None:
    head = orders.read(LENGTH.size)
    if len(head) < LENGTH.size:
        return None
    (size,) = LENGTH.unpack(head)
    data: bytes = orders.read(size)
    return data if len(data) == size else None

"""The process in which `guard` runs points, since they may crash it; `supervisor` forks it."""

from __future__ import annotations

import contextlib
import gc
import os
import signal
import sys
import threading
import time
from pathlib import Path
from typing import Any

from vibroimpact.fmus.errors import ComponentFileError, VibroimpactError
from vibroimpact.fmus.processes.child import private_pipes
from vibroimpact.orchestrator.guard.breadcrumbs import Breadcrumbs
from vibroimpact.orchestrator.guard.pipe import (
    BATCH_TIME,
    BELL,
    Failure,
    Memory,
    Order,
    PointTask,
    packed,
    receive,
)
from vibroimpact.orchestrator.run import Runner, open_runner

#: Interval at which the child checks its parent and notes its own call, s: shorter than the parent's GRACE.
LOOK = 0.25


def _look_around(parent: int, notes: Breadcrumbs) -> None:
    """End this process if its parent is gone, even with a hanging FMU; until then note the call under way.

    A hanging FMU must not become an orphan. The notes cost nothing but a look now and then; they are right for a call
    that lasts.
    """
    main = threading.main_thread().ident or 0

    def look() -> None:
        while os.getppid() == parent:
            time.sleep(LOOK)
            notes.note_frame(sys._current_frames().get(main))
        os._exit(1)

    threading.Thread(target=look, daemon=True).start()


class _Answers:
    """Sends answers to the guard, which sleeps until the bell rings: waking it takes longer than an answer.

    The bell rings after the last answer of a batch, and for a full pipe. Data in the pipe outlive this process.
    """

    def __init__(self, pipe: int, bell: int | None) -> None:
        self._pipe, self._bell = pipe, bell
        self._unread = 0
        self.memory = Memory(None)
        if bell is not None:
            os.set_inheritable(bell, False)
            os.set_blocking(pipe, False)

    def put(self, message: Any, *, last: bool = True) -> None:
        """Send an answer; `last`: the batch has no further answer."""
        self._unread += 1
        left = packed(message, self.memory)
        with contextlib.suppress(BlockingIOError):
            left = self._written(left)
        if last or left:
            self._ring(last)
        if left:
            os.set_blocking(self._pipe, True)
            while left:
                left = self._written(left)
            os.set_blocking(self._pipe, False)

    def _written(self, rows: list[memoryview]) -> list[memoryview]:
        """Write as much as the pipe takes; return the rest."""
        count = os.writev(self._pipe, rows) if hasattr(os, "writev") else os.write(self._pipe, rows[0])
        for number, row in enumerate(rows):
            if count < len(row):
                return [row[count:], *rows[number + 1 :]]
            count -= len(row)
        return []

    def _ring(self, last: bool) -> None:
        if self._bell is not None:
            os.write(self._bell, BELL.pack(self._unread, last))
        self._unread = 0


def _answer(runner: Runner, point: PointTask) -> Any:
    try:
        return runner.run(*point)
    except (VibroimpactError, ArithmeticError, ValueError) as error:
        return Failure(str(error))


def _serve(runner: Runner, batch: tuple[PointTask, ...], notes: Breadcrumbs, answers: _Answers) -> None:
    """Run points, until all are done or their time is over."""
    answers.memory.clear()
    end = time.monotonic() + BATCH_TIME
    for left, point in zip(reversed(range(len(batch))), batch, strict=True):
        notes.begin()
        answer = _answer(runner, point)
        last = left == 0 or time.monotonic() > end
        answers.put(answer, last=last)
        if last:
            return


def _open(order: Order, notes: Breadcrumbs) -> Runner:
    return open_runner(order.scene, order.execution, log=notes.log, wrap=notes.wrap if order.noting else None)


def main(bell: int | None) -> None:
    """Serve points until standard input ends; `bell` is the descriptor to ring, or None."""
    # Ctrl-C reaches all processes of a terminal, but must not count as a crash of a point. The parent ends this
    # process.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = os.getppid()
    given, pipe = private_pipes()
    orders, answers = os.fdopen(given, "rb"), _Answers(pipe, bell)
    order = receive(orders)
    if not isinstance(order, Order):
        return
    if order.memory is not None:
        os.set_inheritable(order.memory, False)
        answers.memory = Memory(order.memory)
    notes = Breadcrumbs(Path(order.notes))
    _look_around(parent, notes)
    try:
        runner = _open(order, notes)
    except VibroimpactError as error:
        answers.put(Failure(str(error), misuse=isinstance(error, ComponentFileError)))
        return
    gc.freeze()  # present objects stay: no garbage collection need look at them
    answers.put(runner.identity)
    while (batch := receive(orders)) is not None:
        _serve(runner, batch, notes, answers)
    runner.close()

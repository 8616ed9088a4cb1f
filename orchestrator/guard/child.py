"""The process that `guard` lets points run in, since they may take it down. `supervisor` forks it."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from pathlib import Path
from typing import Any, BinaryIO

from vibroimpact.fmus.errors import ComponentFileError, VibroimpactError
from vibroimpact.orchestrator.guard.breadcrumbs import Breadcrumbs
from vibroimpact.orchestrator.guard.pipe import Failure, Order, PointTask, receive, send
from vibroimpact.orchestrator.run import Runner, identity_of, open_runner

#: How often the child looks at its parent and at what it is doing itself, s.
LOOK = 0.1


def _look_around(parent: int, notes: Breadcrumbs) -> None:
    """End this process when its parent is gone, whatever the FMU is doing; until then note what that is.

    A hanging FMU must not become an orphan. The notes cost nothing but a look now and then; they are right for a
    call that lasts.
    """
    main = threading.main_thread().ident or 0

    def look() -> None:
        while os.getppid() == parent:
            time.sleep(LOOK)
            notes.note_frame(sys._current_frames().get(main))
        os._exit(1)

    threading.Thread(target=look, daemon=True).start()


def _private_pipes() -> tuple[BinaryIO, BinaryIO]:
    """Keep standard input and output for orders and answers; what an FMU prints goes to standard error.

    Neither an FMU nor a program that it starts can read an order or hold the answers open.
    """
    orders, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    os.dup2(2, 1)
    return orders, answers


def _answer(runner: Runner, point: PointTask) -> Any:
    try:
        return runner.run(point.values, point.start)
    except (VibroimpactError, ArithmeticError, ValueError) as error:
        return Failure(str(error))


def _open(order: Order, notes: Breadcrumbs) -> Runner:
    return open_runner(order.scene, order.execution, log=notes.log, wrap=notes.wrap if order.noting else None)


def main() -> None:
    """Serve points until standard input ends."""
    # Ctrl-C reaches all processes of a terminal: a point must not count as crashed for it. The parent ends this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = os.getppid()
    orders, answers = _private_pipes()
    order = receive(orders)
    if not isinstance(order, Order):
        return
    notes = Breadcrumbs(Path(order.notes))
    _look_around(parent, notes)
    try:
        runner = _open(order, notes)
    except VibroimpactError as error:
        send(answers, Failure(str(error), misuse=isinstance(error, ComponentFileError)))
        return
    send(answers, identity_of(runner))
    while isinstance(point := receive(orders), PointTask):
        send(answers, _answer(runner, point))
    runner.close()

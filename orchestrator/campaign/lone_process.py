"""A call in a process of its own, which may die of it; what is started here does not hear Ctrl-C."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

from vibroimpact.analysis.files.scratch import ScratchFolder
from vibroimpact.fmus.processes.python_child import ending, no_library_warns, safe_module_path
from vibroimpact.fmus.surroundings import leave_removed_folder

POLL_SECONDS = 0.5
"""How often the waiting process looks up, s."""


class ProcessDied(Exception):
    """The process ended without an answer; the text says how."""


def call_alone(function: Callable[..., Any], *arguments: Any) -> Any:
    """Call a function in a new process and return what it returns.

    Parameters
    ----------
    function : callable
        Importable by its name, as its arguments and its result are picklable.

    Raises
    ------
    ProcessDied
        When the process ended before the function did.
    Exception
        What the function raised.
    """
    context = multiprocessing.get_context("spawn")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_answer, args=(sender, function, arguments), daemon=True)
    # the process goes to the current folder of this one, which is there until it ends
    with ScratchFolder("current-folder") as scratch:
        with safe_module_path(), no_library_warns(), interrupts_blocked():
            leave_removed_folder(Path(scratch.name))
            process.start()
        sender.close()
        try:
            while not receiver.poll(POLL_SECONDS):
                continue
            result, error = receiver.recv()
        except EOFError:
            process.join()
            raise ProcessDied(f"it {ending(process.exitcode)}") from None
        finally:
            process.kill()
            process.join()
            receiver.close()
    if error is not None:
        raise error
    return result


def _answer(sender: Connection[Any, Any], function: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
    threading.Thread(target=_end_with_parent, daemon=True).start()
    try:
        answer: tuple[Any, Exception | None] = function(*arguments), None
    except Exception as error:
        # It is the caller's, who gets it in the other process.
        answer = None, error
    sender.send(answer)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    wait([parent.sentinel])
    os._exit(1)


@contextmanager
def interrupts_blocked() -> Iterator[None]:
    """Let the threads and processes that begin here not hear Ctrl-C: it is for this thread alone.

    A terminal sends the signal to every process of the command. A blocked signal is inherited by threads and
    by the processes they start, also by those that replace a dead worker later. Here it only waits.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    # Start it now: starting it unblocks SIGINT in the calling thread.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)

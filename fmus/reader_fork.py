"""Lets a fork of this process read a file of a stranger, where a fork is sound: nothing has to be imported again.

A fork has the memory of this process, and none of its descriptors: it can write nothing and tell nobody.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
import warnings
from dataclasses import asdict

from vibroimpact.fmus.confinement import PATIENCE
from vibroimpact.fmus.reader_child import how_it_ended, import_libraries, read_and_end
from vibroimpact.fmus.reader_orders import Answer, Order, received
from vibroimpact.fmus.wording import typed_or_called

WAITING = "waits for the end of another process"
"""Name of a thread that holds no lock while it waits, so that a fork without it is sound."""
#: Wall time beyond that of the limits after which a fork is killed, s: the fork itself ends before.
GRACE = 10.0
_ANSWER = 3


_own_program = False


def allow_forks() -> None:
    """Say that this process runs a program of this package, whose libraries all outlive a fork."""
    global _own_program
    _own_program = True


def may_fork() -> bool:
    """Return whether a fork of this process can read a file: nothing runs here that may hold a lock.

    In a program of another a library may have threads that a fork lacks. Those of numpy end and start around a fork.
    """
    is_own = _own_program or bool(typed_or_called("typed"))
    if sys.platform != "linux" or not is_own or threading.current_thread() is not threading.main_thread():
        return False
    return all(
        thread.name == WAITING or thread is threading.current_thread() for thread in threading.enumerate()
    )


def read_in_fork(order: Order) -> Answer | None:
    """Let a fork of this process read a file; None where it waited, and so says nothing of the file.

    A thread of some library that was lost with the fork may be what it waited for.
    """
    given = asdict(order)
    import_libraries(given)
    parent = os.getpid()
    answers, answer = os.pipe()
    with warnings.catch_warnings():
        # of Python 3.12 and of libraries: that threads are lost
        warnings.simplefilter("ignore")
        process = os.fork()
    if process == 0:
        try:
            _leave_all_files(answer)
            read_and_end(given, parent, _ANSWER)
        finally:
            os._exit(1)
    os.close(answer)
    late = threading.Timer(PATIENCE * order.seconds + GRACE, os.kill, (process, signal.SIGKILL))
    late.daemon = True
    late.start()
    try:
        with open(answers, "rb") as stream:
            found = received(stream, order.most_bytes)
    finally:
        late.cancel()
        late.join()
        os.kill(process, signal.SIGKILL)  # it has nothing left to do, whatever it does
        _, status = os.waitpid(process, 0)
    if found is not None:
        return found
    if os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGALRM:
        return None
    ended = how_it_ended(status)
    return Answer(ended["verdict"], error=ended["error"])


def _leave_all_files(answer: int) -> None:
    """Let a fork keep no descriptor of the process that it was made from but that of its answer, as number 3."""
    import fcntl

    answer = fcntl.fcntl(answer, fcntl.F_DUPFD, _ANSWER + 1)
    nowhere = os.open(os.devnull, os.O_RDWR)
    for number in range(_ANSWER):
        os.dup2(nowhere, number)
    os.dup2(answer, _ANSWER)
    for number in map(int, os.listdir("/proc/self/fd")):
        if number > _ANSWER:
            with contextlib.suppress(OSError):  # the descriptor of the listing itself
                os.close(number)

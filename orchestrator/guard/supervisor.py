"""A process between a guard and the process that runs FMUs, so that nothing an FMU has started outlives it.

It is started as `python -m` with the descriptor of the bell (`pipe`), and forks before any large import. The fork runs
the points (`child`), or `main` of the module that a second argument names, in a process group of its own. The
supervisor runs no code of an FMU, so none can crash it. It kills all remaining processes if the fork ends, or if the
guard closes its pipe, dies, or sends SIGTERM. Then it ends as the fork has ended.

On Linux it is the reaper of its descendants: processes that left the group (setsid) come back to it. Elsewhere it
knows only the process group.
"""

from __future__ import annotations

import contextlib
import ctypes
import importlib
import os
import select
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path

#: Time in which the fork may end by itself after the guard has closed its pipe, s.
ENDING_TIME = 0.2
#: Longest time spent on killing descendants, s: an FMU may start them faster than they can be killed.
KILLING_TIME = 5.0
#: Interval at which the supervisor checks that the guard lives, besides its pipe, s.
LOOK = 0.5
#: Options of Linux' prctl.
PR_SET_PDEATHSIG, PR_SET_CHILD_SUBREAPER = 1, 36


def main() -> None:
    """Fork, let the fork serve points, and end with it."""
    if not hasattr(os, "fork"):
        return _serve(None)
    bell = int(sys.argv[1])
    guard, supervisor = os.getppid(), os.getpid()
    _control_process(PR_SET_CHILD_SUBREAPER, 1)
    wakeup = _wakeup_pipe()
    fork = os.fork()
    if fork == 0:
        signal.set_wakeup_fd(-1)
        for number in (signal.SIGCHLD, signal.SIGTERM):
            signal.signal(number, signal.SIG_DFL)
        _control_process(PR_SET_PDEATHSIG, signal.SIGKILL)
        os.setpgid(0, 0)
        if os.getppid() == supervisor:
            _serve(bell)
        return None
    _close_output(bell)
    status = _wait_for_end(fork, guard, wakeup)
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(fork, signal.SIGKILL)
    _end_like(_kill_descendants(fork, status))


def _serve(bell: int | None) -> None:
    # heavy, and not needed by the supervisor
    module = importlib.import_module(sys.argv[2] if sys.argv[2:] else "vibroimpact.orchestrator.guard.child")
    module.main(bell)


def _control_process(option: int, value: int) -> None:
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(option, value, 0, 0, 0)


def _wakeup_pipe() -> int:
    """Return a descriptor that becomes readable at SIGCHLD and SIGTERM; SIGINT of a terminal is the guard's."""
    readable, writable = os.pipe()
    for end in (readable, writable):
        os.set_blocking(end, False)
    signal.set_wakeup_fd(writable, warn_on_full_buffer=False)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.signal(signal.SIGTERM, lambda *_: None)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    return readable


def _close_output(bell: int) -> None:
    """Leave answers and bell to the fork: the guard must see these pipes end with the fork."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.close(nowhere)
    os.close(bell)


def _wait_for_end(fork: int, guard: int, wakeup: int) -> int | None:
    """Wait until the fork has ended (returns its status) or must be ended (None)."""
    poll = select.poll()
    poll.register(wakeup, select.POLLIN)
    # only the end of the guard's pipe matters: the fork reads the orders
    poll.register(0, 0)
    end = float("inf")
    while (left := end - time.monotonic()) > 0.0:
        ready = dict(poll.poll(1e3 * min(LOOK, left)))
        signals = os.read(wakeup, 4096) if wakeup in ready else b""
        status, _ = _reap(fork)
        if status is not None:
            return status
        if signal.SIGTERM in signals or os.getppid() != guard:
            return None
        if 0 in ready:
            poll.unregister(0)
            end = time.monotonic() + ENDING_TIME
    return None


def _reap(fork: int) -> tuple[int | None, bool]:
    """Reap the children that have ended; returns the fork's status if it has ended, and whether others live."""
    found = None
    while True:
        try:
            pid, status = os.waitpid(-1, os.WNOHANG)
        except ChildProcessError:
            return found, False
        if pid == 0:
            return found, True
        if pid == fork:
            found = status


def _kill_descendants(fork: int, status: int | None) -> int | None:
    """Kill all children, and processes that then become children; returns the status of the fork."""
    end = time.monotonic() + KILLING_TIME
    while time.monotonic() < end:
        found, some_live = _reap(fork)
        status = found if found is not None else status
        if not some_live:
            break
        for child in _children():
            with contextlib.suppress(ProcessLookupError):
                os.kill(child, signal.SIGKILL)
        time.sleep(1e-3)
    return status


def _children() -> Iterator[int]:
    """Yield the living and dead children of this process; none without /proc."""
    own = str(os.getpid())
    for entry in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            # the name, in parentheses, may have any characters
            if entry.read_text(errors="replace").rpartition(")")[2].split()[1] == own:
                yield int(entry.parent.name)


def _end_like(status: int | None) -> None:
    """End as the fork did: with its exit code, or by the signal that ended it."""
    if status is None:
        os._exit(1)
    if not os.WIFSIGNALED(status):
        os._exit(os.WEXITSTATUS(status))
    number = os.WTERMSIG(status)
    _no_core()
    if number != signal.SIGKILL:
        signal.signal(number, signal.SIG_DFL)
    os.kill(os.getpid(), number)
    os._exit(1)


def _no_core() -> None:
    import resource  # POSIX only

    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


if __name__ == "__main__":
    main()

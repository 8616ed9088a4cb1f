"""What this machine must have for workers of its own: a current folder, loopback, and descriptors.

Dask starts its processes in threads of its own, where a lack shows as tracebacks, or as workers that never come.
So all three are looked at before.
"""

from __future__ import annotations

import errno
import os
import socket
from pathlib import Path

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.wording import option, typed_or_called

LOOPBACK = "127.0.0.1"
"""Address of this machine itself, over which scheduler, workers and campaign talk."""

REACH_SECONDS = 5.0
"""How long a connection over loopback may take, s; one takes less than a millisecond."""

OWN_DESCRIPTORS = 32
"""Descriptors that a campaign opens for itself and Dask's scheduler: 18 measured on Linux, with 1 and 2 workers."""

WORKER_DESCRIPTORS = 12
"""Descriptors that a campaign opens for each of its workers: 11 measured on Linux, with 1 and 2 workers."""


def refuse_poor_surroundings(workers: int) -> None:
    """Raise UsageError where workers of this machine cannot be started or reached.

    Parameters
    ----------
    workers : int
        Number of worker processes.

    Raises
    ------
    UsageError
        With what is missing and what to do.
    """
    _refuse_few_descriptors(OWN_DESCRIPTORS + workers * WORKER_DESCRIPTORS, workers)
    _refuse_no_loopback()


def leave_removed_folder(instead: Path) -> None:
    """Make `instead` the current folder where that was removed: multiprocessing asks for its path."""
    try:
        os.getcwd()
    except FileNotFoundError:
        os.chdir(instead)


def _refuse_few_descriptors(needed: int, workers: int) -> None:
    available = _available_descriptors(needed)
    if available < needed:
        fewer = f", or ask for fewer workers with {option('workers')}" if workers > 1 else ""
        raise UsageError(
            f"this machine: expected {needed} files that may be opened for {workers} "
            f"worker{'s' if workers > 1 else ''}, got {available}. "
            f"Raise the limit (`ulimit -n 1024`){fewer}."
        )


def _available_descriptors(most: int) -> int:
    """Return how many more files this process may open now, `most` at most."""
    held: list[int] = []
    try:
        while len(held) < most:
            held.append(os.open(os.devnull, os.O_RDONLY))
    except OSError as error:
        if error.errno not in (errno.EMFILE, errno.ENFILE):
            raise
    finally:
        for one in held:
            os.close(one)
    return len(held)


def _refuse_no_loopback() -> None:
    try:
        with (
            socket.create_server((LOOPBACK, 0)) as listener,
            socket.create_connection(listener.getsockname()[:2], timeout=REACH_SECONDS),
        ):
            return
    except OSError as error:
        raise UsageError(
            f"this machine: expected {LOOPBACK} to answer, over which workers are reached, "
            f"got {error.strerror or error}. Set up the network interface of this machine itself "
            f"(`ip link set lo up`), or use {typed_or_called('`vibroimpact run`', 'vi.run')}, "
            "which needs none."
        ) from error

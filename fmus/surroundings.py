"""Requirements of communicating processes on this machine: a current folder, loopback, and descriptors.

Libraries hit the lack of one in their own threads, as a traceback, an abort, or an answer that never comes. So all
three are checked before.
"""

from __future__ import annotations

import errno
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.messages import message

LOOPBACK = "127.0.0.1"
"""Address of this machine itself, over which the processes of a campaign, rig or service communicate."""

REACH_SECONDS = 5.0
"""Longest time for a connection over loopback, s; normally it takes less than a millisecond."""


def leave_removed_folder(instead: Path) -> None:
    """Make `instead` the current folder if that was removed: multiprocessing asks for its path."""
    try:
        os.getcwd()
    except FileNotFoundError:
        os.chdir(instead)


@contextmanager
def in_a_folder_that_exists() -> Iterator[None]:
    """Let a library that asks for the current folder be imported although that folder was removed."""
    try:
        os.getcwd()
    except FileNotFoundError:
        removed = os.open(".", os.O_RDONLY)
    else:
        yield
        return
    try:
        os.chdir(os.sep)
        yield
    finally:
        os.fchdir(removed)
        os.close(removed)


def refuse_few_descriptors(needed: int, whose: str, fewer: str = "") -> None:
    """Raise UsageError if this process cannot open `needed` more files.

    Parameters
    ----------
    needed : int
    whose : str
        Users of the files: `2 workers`.
    fewer : str
        Remedy in the message, after `, or`.
    """
    available = _available_descriptors(needed)
    if available < needed:
        raise UsageError(
            message(
                f"this machine: expected {needed} files that may be opened for {whose}, got {available}. "
                "Raise the limit (`ulimit -n 1024`)",
                *_or(fewer),
            )
        )


def _available_descriptors(most: int) -> int:
    """Return the number of further files that this process can open now, at most `most`."""
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


def refuse_no_loopback(purpose: str, instead: str = "") -> None:
    """Raise UsageError if connections over loopback fail.

    Parameters
    ----------
    purpose : str
        Purpose of loopback, after `over which`: `workers are reached`.
    instead : str
        Remedy in the message, after `, or`.
    """
    try:
        with (
            socket.create_server((LOOPBACK, 0)) as listener,
            socket.create_connection(listener.getsockname()[:2], timeout=REACH_SECONDS),
        ):
            return
    except OSError as error:
        raise UsageError(
            message(
                f"this machine: expected {LOOPBACK} to answer, over which {purpose}, got {error.strerror or error}. "
                "Set up the network interface of this machine itself (`ip link set lo up`)",
                *_or(instead),
            )
        ) from error


def _or(other: str) -> tuple[str, ...]:
    """Return the end of a sentence, with a further remedy."""
    return (", or ", other, ".") if other else (".",)

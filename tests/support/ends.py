"""Waiting for the end of processes."""

from __future__ import annotations

import time
from collections.abc import Callable

import psutil

SECONDS = 60.0
"""Longest wait on a busy machine, s."""


def ended(process: int) -> bool:
    """Return whether a process has ended."""
    try:
        return psutil.Process(process).status() == psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return True


def wait_until(happened: Callable[[], bool]) -> None:
    """Wait until a condition holds."""
    deadline = time.monotonic() + SECONDS
    while not happened():
        assert time.monotonic() < deadline
        time.sleep(0.02)

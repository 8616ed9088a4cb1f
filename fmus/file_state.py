"""Test whether a file has changed since it was read, by the file system's record of it."""

from __future__ import annotations

import os
import time

FileState = tuple[int, ...]
#: Age of a change, ns, above which a later change gets another time stamp: file systems have coarse clocks.
SETTLED = 2_000_000_000


def file_state(status: os.stat_result) -> FileState:
    """Return the values that differ between two contents of a file: place on the disk, size, times of change."""
    return (status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns)


def is_settled(state: FileState) -> bool:
    """Return whether any later change is sure to alter the state."""
    return time.time_ns() - max(state[3:]) > SETTLED

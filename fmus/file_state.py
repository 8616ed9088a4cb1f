"""Whether a file is still the one that was looked at, by what the system says of it."""

from __future__ import annotations

import os
import time

FileState = tuple[int, ...]
#: Age of a change, ns, above which the next one bears another time: clocks of file systems are coarse.
SETTLED = 2_000_000_000


def file_state(status: os.stat_result) -> FileState:
    """Return what differs between two contents of a file: place on the disk, size, times of change."""
    return (status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns)


def is_settled(state: FileState) -> bool:
    """Return whether any later change shows in the state."""
    return time.time_ns() - max(state[3:]) > SETTLED

"""A fork of this process: it has all that was imported here, does its work, and ends."""

from __future__ import annotations

import gc
import os
import warnings
from collections.abc import Callable


def forked(work: Callable[[], object]) -> int:
    """Let a fork of this process do its work and end, whatever becomes of it; return the number of its process.

    The fork lacks the other threads. Objects of this process end with it, not in its copy: no collection comes while
    the copy begins.

    Raises
    ------
    OSError
        The system has no room for it.
    """
    collects = gc.isenabled()
    gc.disable()
    try:
        with warnings.catch_warnings():
            # of Python 3.12 and of libraries: that threads are lost
            warnings.simplefilter("ignore")
            process = os.fork()
        if process == 0:
            gc.freeze()
    finally:
        if collects:
            gc.enable()
    if process == 0:
        code = 1
        try:
            work()
            code = 0
        finally:
            os._exit(code)  # nothing else of this process runs twice
    return process

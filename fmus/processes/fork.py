"""A fork of this process: it shares all imports, does its work, and ends."""

from __future__ import annotations

import gc
import os
import warnings
from collections.abc import Callable


def forked(work: Callable[[], object]) -> int:
    """Let a fork of this process do its work and end in any case; return its process number.

    The fork lacks the other threads. Objects of this process are finalized here, not in the copy: garbage collection is
    off while the copy begins.

    Raises
    ------
    OSError
        The system has no room for another process.
    """
    collects = gc.isenabled()
    gc.disable()
    try:
        with warnings.catch_warnings():
            # Python 3.12 and libraries warn of lost threads
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
            os._exit(code)  # nothing else of this process may run twice
    return process

"""The last log lines of an instance, kept by C code in memory that another process may share.

A component that logs a million lines costs no memory and no call into Python.
"""

from __future__ import annotations

import ctypes
import weakref

from vibroimpact.fmus.core import core_library

LINES = 20
LENGTH = 480


class _Ring(ctypes.Structure):
    _fields_ = [("count", ctypes.c_uint64), ("lines", (ctypes.c_char * LENGTH) * LINES)]


RING_SIZE = ctypes.sizeof(_Ring)
NO_LINES = bytes(_Ring.count.size)
"""The first bytes of an empty ring."""


class LogTail:
    """Keeps the last lines that a component logged, for the message of an error.

    Parameters
    ----------
    memory : memoryview or None
        `RING_SIZE` writable bytes, such as shared memory; None: memory of its own.
    """

    def __init__(self, memory: memoryview | None = None) -> None:
        self._ring = _Ring() if memory is None else _Ring.from_buffer(memory)
        if core_library().vi_log_ring_add(self.environment) != 0:
            raise MemoryError
        weakref.finalize(self, core_library().vi_log_ring_remove, self.environment).atexit = False

    @property
    def environment(self) -> ctypes.c_void_p:
        """Pointer for the component's callbacks."""
        return ctypes.c_void_p(ctypes.addressof(self._ring))

    def take(self) -> tuple[str, ...]:
        """Return the last lines since the previous call, oldest first."""
        count = int(self._ring.count)
        if count == 0:
            return ()
        self._ring.count = 0
        return tuple(self._line(i % LINES) for i in range(max(0, count - LINES), count))

    def _line(self, slot: int) -> str:
        return bytes(self._ring.lines[slot].value).decode("utf-8", "replace")


def callback(name: str) -> ctypes.c_void_p:
    """Return the address of one of the core library's callbacks: `fmi2`, `fmi3`, `allocate`, `free`."""
    function = getattr(core_library(), f"vi_log_ring_{name}")
    return ctypes.cast(function, ctypes.c_void_p)

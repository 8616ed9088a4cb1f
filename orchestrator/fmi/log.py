"""The last log lines of an instance, kept by C code in memory that another process may share.

A component that logs a million lines costs no memory and no call into Python.
"""

from __future__ import annotations

import ctypes
import sys
import weakref
from collections.abc import Iterable
from functools import cache
from typing import Any

from vibroimpact.fmus.core import core_library
from vibroimpact.fmus.errors import ComponentError

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
    memory : memoryview, array or None
        `RING_SIZE` writable bytes, such as shared memory; None: memory of its own.
    """

    def __init__(self, memory: memoryview | None = None) -> None:
        self._ring = _Ring() if memory is None else _Ring.from_buffer(memory)
        core = _core()
        if core is None:
            _tails[ctypes.addressof(self._ring)] = self
            return
        if core.vi_log_ring_add(self.environment) != 0:
            raise MemoryError
        weakref.finalize(self, core.vi_log_ring_remove, self.environment).atexit = False

    @property
    def environment(self) -> ctypes.c_void_p:
        """Pointer for the component's callbacks."""
        return ctypes.c_void_p(ctypes.addressof(self._ring))

    def add(self, lines: Iterable[str]) -> None:
        """Add lines that a component has logged elsewhere."""
        for line in lines:
            self._ring.lines[int(self._ring.count) % LINES].value = line.encode()[: LENGTH - 1]
            self._ring.count += 1

    def take(self) -> tuple[str, ...]:
        """Return the last lines since the previous call, oldest first."""
        count = int(self._ring.count)
        if count == 0:
            return ()
        self._ring.count = 0
        return tuple(self._line(i % LINES) for i in range(max(0, count - LINES), count))

    def _line(self, slot: int) -> str:
        return bytes(self._ring.lines[slot].value).decode("utf-8", "replace")


@cache
def callback(name: str) -> ctypes.c_void_p:
    """Return the address of a callback: `fmi2`, `fmi3`, `allocate`, `free` or `update`.

    It is the core library's. Where that is not built (a server of FMUs in a 32-bit Python), it is Python's own. FMI
    2.0's messages then keep their percent signs, since Python cannot read the values behind them.
    """
    core = _core()
    if core is not None:
        return ctypes.cast(getattr(core, f"vi_log_ring_{name}"), ctypes.c_void_p)
    _kept.append(_plain_callback(name))
    return ctypes.cast(_kept[-1], ctypes.c_void_p)


@cache
def _core() -> Any:
    """Return the core library, or None where it is not built."""
    try:
        return core_library()
    except ComponentError:
        return None


#: The tails of this process by their addresses, for callbacks of Python's own.
_tails: weakref.WeakValueDictionary[int, LogTail] = weakref.WeakValueDictionary()
#: Callbacks of Python's own, which FMUs hold.
_kept: list[Any] = []


def _plain_callback(name: str) -> Any:
    if name in ("allocate", "free"):
        library = ctypes.CDLL("msvcrt" if sys.platform == "win32" else None)
        return library.calloc if name == "allocate" else library.free
    if name == "update":
        times = ctypes.c_void_p, ctypes.c_double
        answers = ctypes.POINTER(ctypes.c_bool), ctypes.POINTER(ctypes.c_double)
        return ctypes.CFUNCTYPE(None, *times, *[ctypes.c_bool] * 4, *answers)(_go_on)
    text, kinds = ctypes.c_char_p, {"fmi2": (ctypes.c_char_p, ctypes.c_int), "fmi3": (ctypes.c_int,)}

    def log(environment: int, *arguments: Any) -> None:
        tail = _tails.get(environment)  # some FMUs pass another pointer
        if tail is not None:
            tail.add([(arguments[-1] or b"").decode("utf-8", "replace")])

    return ctypes.CFUNCTYPE(None, ctypes.c_void_p, *kinds[name], text, text)(log)


def _go_on(environment: int, time: float, *arguments: Any) -> None:
    """Let a step go on to its end, as `vi_log_ring_update` does."""
    is_early, until = arguments[-2:]
    if is_early:
        is_early[0] = False
    if until:
        until[0] = time

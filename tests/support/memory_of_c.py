"""Ways of simulating that take memory as a C library does, outside of Python's own count."""

from __future__ import annotations

import ctypes
import math
import mmap

from vibroimpact.orchestrator.fmi.instance import Wrapper
from vibroimpact.orchestrator.study.memory import memory_in_fork
from vibroimpact.orchestrator.study.observation import Observation
from vibroimpact.orchestrator.study.ways.way import Trial, Way


class OfC:
    """Takes memory and frees it."""

    def __init__(self, size: int) -> None:
        self._size = size

    def run(self) -> Observation:
        # mmap instead of malloc, which may return freed memory that is already resident
        if self._size:
            with mmap.mmap(-1, self._size) as block:
                ctypes.memset(ctypes.addressof(ctypes.c_char.from_buffer(block)), 1, self._size)
        return Observation()

    def close(self) -> None:
        return None


def memories_of_c(sizes: list[int]) -> list[int]:
    """Return the measured memory of ways of these sizes, one after the other, bytes."""
    return [memory_in_fork(_way_of(size)) for size in sizes]


def _way_of(size: int) -> Way:
    def opened(wrap: Wrapper | None, part: float = 1.0) -> Trial:
        return OfC(size)

    return Way("of C", "", math.nan, {}, opened)

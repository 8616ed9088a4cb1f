"""The state of an output, in memory that outlives the driving program: its last samples and its progress.

One process writes. Another process, the guardian, reads after the writer has died, so only the order matters. Samples
are in the memory before they are announced, and announced before they are sent.
"""

from __future__ import annotations

import mmap
import os
import tempfile
import time

import numpy as np

from vibroimpact.hardware.rig.limits import Floats

_FIELDS = ("beat", "driving", "announced", "written", "generated", "generated_at")


class SharedSamples:
    """The last samples of an output, by number, at most `capacity`; OSError without room for them.

    `descriptor` is the memory of another process; None: new memory, which vanishes with its last process.
    """

    beat: int
    """Grows as long as the writer lives."""
    driving: int
    """1 from just before the output starts until it is at rest."""
    announced: int
    """Samples that may have been sent."""
    written: int
    """Samples that were accepted."""
    generated: int
    """Samples that were out at `generated_at`."""
    generated_at: int
    """`time.monotonic_ns`."""

    def __init__(self, capacity: int, descriptor: int | None = None) -> None:
        size = 8 * (len(_FIELDS) + capacity)
        self.descriptor = _new_memory(size) if descriptor is None else descriptor
        self._map = mmap.mmap(self.descriptor, size)
        self.__dict__["_numbers"] = np.frombuffer(self._map, dtype=np.int64, count=len(_FIELDS))
        self._ring = np.frombuffer(self._map, dtype=np.float64, offset=8 * len(_FIELDS))

    def __getattr__(self, name: str) -> int:
        """Return a shared number."""
        if name not in _FIELDS:
            raise AttributeError(name)
        return int(self.__dict__["_numbers"][_FIELDS.index(name)])

    def __setattr__(self, name: str, value: object) -> None:
        """Change a shared number."""
        if name in _FIELDS:
            self.__dict__["_numbers"][_FIELDS.index(name)] = value
        else:
            super().__setattr__(name, value)

    def announce(self, first: int, volts: Floats) -> None:
        """Keep samples that are about to be sent."""
        self._ring[(first + np.arange(volts.size)) % self._ring.size] = volts
        self.announced = first + volts.size

    def progress(self, written: int, generated: int | None = None) -> None:
        """Note the progress of the output, and that the writer lives."""
        self.written = written
        if generated is not None:
            self.generated, self.generated_at = generated, time.monotonic_ns()
        self.beat += 1

    def sample(self, number: int) -> float:
        """Return a sample, V; 0 before the first."""
        return float(self._ring[number % self._ring.size]) if number >= 0 else 0.0

    def close(self) -> None:
        """Close the memory."""
        self.__dict__["_numbers"] = self._ring = np.zeros(len(_FIELDS))
        self._map.close()
        os.close(self.descriptor)


def _new_memory(size: int) -> int:
    """Return a descriptor of nameless memory; its pages are allocated now, not at first use."""
    if hasattr(os, "memfd_create"):
        descriptor = os.memfd_create("vibroimpact-output")
    else:
        with tempfile.TemporaryFile() as file:
            descriptor = os.dup(file.fileno())
    try:
        left = size
        while left > 0:
            left -= os.write(descriptor, bytes(min(left, 2**20)))
    except OSError:
        os.close(descriptor)
        raise
    return descriptor

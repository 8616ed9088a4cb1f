"""Shares of the machine's memory for the imports of uploaded files."""

from __future__ import annotations

MOST_MEMORY = 8 * 2**30
"""Largest address space of one import, byte."""
LEAST_MEMORY = 2 * 2**30
"""Least address space of one import on any machine, byte: the libraries alone map about 1 GiB."""
SHARE = 0.75
"""Share of the machine's memory for all imports together."""
MOST_AT_ONCE = 4
"""Largest number of simultaneous imports, on a machine of any memory."""


def import_memory(machine: int) -> int:
    """Return the address space of one import, byte, on a machine with this memory, byte.

    >>> [import_memory(gib * 2**30) / 2**30 for gib in (1, 4, 8, 64)]
    [2.0, 3.0, 6.0, 8.0]
    """
    return min(MOST_MEMORY, max(LEAST_MEMORY, int(SHARE * machine)))


def imports_at_once(machine: int) -> int:
    """Return the number of simultaneous imports on a machine with this memory, byte.

    >>> [imports_at_once(gib * 2**30) for gib in (1, 8, 16, 24, 64)]
    [1, 1, 1, 2, 4]
    """
    return max(1, min(MOST_AT_ONCE, int(SHARE * machine) // import_memory(machine)))

"""How much of the machine's memory the imports of uploaded files may take together."""

from __future__ import annotations

MOST_MEMORY = 8 * 2**30
"""Address space of one import, byte."""
LEAST_MEMORY = 2 * 2**30
"""Address space that one import has on any machine, byte: the libraries alone map some 1 GiB."""
SHARE = 0.75
"""Part of the machine's memory that all imports may take together."""
MOST_AT_ONCE = 4
"""Imports at a time, on a machine of any memory."""


def import_memory(machine: int) -> int:
    """Return the address space of one import on a machine of so much memory, byte.

    >>> [import_memory(gib * 2**30) / 2**30 for gib in (1, 4, 8, 64)]
    [2.0, 3.0, 6.0, 8.0]
    """
    return min(MOST_MEMORY, max(LEAST_MEMORY, int(SHARE * machine)))


def imports_at_once(machine: int) -> int:
    """Return how many imports a machine of so much memory (byte) takes at a time.

    >>> [imports_at_once(gib * 2**30) for gib in (1, 8, 16, 24, 64)]
    [1, 1, 1, 2, 4]
    """
    return max(1, min(MOST_AT_ONCE, int(SHARE * machine) // import_memory(machine)))

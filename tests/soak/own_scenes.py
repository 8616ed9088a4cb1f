"""Bodies by their modes among all other bodies, with all links, contacts, forces and moving stops.

Their scenes keep the laws of the kind `structures`.
"""

from __future__ import annotations

from support.drawn_forces import forced_structure
from support.drawn_structures import OWN_KINDS, drawn_structure

from soak.structures import fault

CASES, SAMPLE, SECONDS = 5000, 3, 20.0


def check(seed: int) -> str | None:
    """Return the fault of the scene of a seed."""
    return fault(seed, (forced_structure if seed % 2 else drawn_structure)(seed, OWN_KINDS))

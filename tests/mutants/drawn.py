"""Faults drawn over the core by a seed; a fault that does not compile or changes no result is replaced by the next."""

from __future__ import annotations

from itertools import islice

from mutants._faults import drawn
from mutants._trial import tried

CASES, SECONDS = 60, 900.0
MOST = 40
"""Most faults tried in search of one that changes a result."""


def check(seed: int) -> str | None:
    """Try a fault; return it if it survives."""
    return tried(islice(drawn(seed), MOST))

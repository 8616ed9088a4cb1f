"""Faults that a seed draws over the core; one that does not compile or changes no result is replaced by the next."""

from __future__ import annotations

from itertools import islice

from mutants._faults import drawn
from mutants._trial import tried

CASES, SECONDS = 60, 900.0
MOST = 40
"""Faults that may be tried for one that changes a result."""


def check(seed: int) -> str | None:
    """Try a fault; return it where it survives."""
    return tried(islice(drawn(seed), MOST))

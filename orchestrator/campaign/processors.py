"""How many processors there are, and which workers go together; `cluster`, which needs it, imports all of Dask."""

from __future__ import annotations

import os

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.messages import Argument, message


def processor_count() -> int:
    """Return how many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def refuse_two_kinds_of_workers(workers: int | None, scheduler: object) -> None:
    """Refuse workers of this machine beside those of a scheduler."""
    if workers is not None and scheduler is not None:
        raise UsageError(
            message(
                *(Argument("workers"), " and ", Argument("scheduler")),
                ": expected one of them, got both. A scheduler has its own workers.",
            )
        )

"""The number of processors and the choice of workers, apart from `cluster`, which imports all of Dask."""

from __future__ import annotations

import os

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.messages import Argument, message


def processor_count() -> int:
    """Return the number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def refuse_two_kinds_of_workers(workers: int | None, scheduler: object) -> None:
    """Raise UsageError if both workers of this machine and a scheduler are given."""
    if workers is not None and scheduler is not None:
        raise UsageError(
            message(
                *(Argument("workers"), " and ", Argument("scheduler")),
                ": expected one of them, got both. A scheduler has its own workers.",
            )
        )

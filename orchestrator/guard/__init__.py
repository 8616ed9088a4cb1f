"""Points in a process of their own, which an FMU may crash or hang."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vibroimpact.orchestrator.guard.guarded import GuardedRunner

__all__ = ["GuardedRunner"]


def __getattr__(name: str) -> Any:
    # the supervisor imports this module and forks: no module that may start a thread is loaded before
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.guarded"), name)

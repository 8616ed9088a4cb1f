"""Points in a process of their own, which an FMU may crash or hang."""

from __future__ import annotations

from vibroimpact.orchestrator.guard.guarded import GuardedRunner, make_runner

__all__ = [
    "GuardedRunner",
    "make_runner",
]

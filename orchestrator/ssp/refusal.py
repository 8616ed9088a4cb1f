"""The reason why a system cannot be read: raised at its place, reported with the name of the archive."""

from __future__ import annotations

from collections.abc import Callable

from vibroimpact.orchestrator.scene.problems import Problem


class RefusalError(Exception):
    """One `problem` of a system: its place, the expectation, the finding, and the remedy."""

    def __init__(self, where: str, expected: str, got: str, hint: str | Callable[[], str] = "") -> None:
        self.problem = Problem(where, expected, got, hint)
        super().__init__(self.problem)

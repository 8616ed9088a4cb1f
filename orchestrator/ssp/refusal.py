"""Why a system cannot be read: raised wherever it shows, told with the name of the archive where it was opened."""

from __future__ import annotations

from collections.abc import Callable

from vibroimpact.orchestrator.scene.problems import Problem


class RefusalError(Exception):
    """One `problem` of a system: where it is, what is expected, what is there, what to do."""

    def __init__(self, where: str, expected: str, got: str, hint: str | Callable[[], str] = "") -> None:
        self.problem = Problem(where, expected, got, hint)
        super().__init__(self.problem)

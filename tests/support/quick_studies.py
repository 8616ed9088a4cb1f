"""Studies of accuracy whose tests ask for errors alone: each way runs once."""

from __future__ import annotations

import pytest

import vibroimpact.orchestrator.study.accuracy as accuracy

BUDGET = 1e-3
"""Of such a study, s: it is over after the first runs."""


def run_once(patch: pytest.MonkeyPatch) -> None:
    """Leave out repeated runs, counted calls and memory."""
    patch.setattr(accuracy, "LEAST_ROUNDS", 1)
    patch.setattr(accuracy, "COUNTED", 0.0)
    patch.setattr(accuracy, "memory_of_ways", lambda *_: {})

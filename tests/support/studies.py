"""Studies of accuracy whose costs nobody asks for."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.study import Study, study_accuracy
from vibroimpact.orchestrator.study import accuracy as studying


@contextmanager
def costs_left_out() -> Iterator[None]:
    """Let each way run once, and once more to be timed; its memory is not measured."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(studying, "LEAST_ROUNDS", 1)
        patch.setattr(studying, "memory_of_ways", lambda *asked: {})
        yield


def study_errors(scene: Scene, **options: Any) -> Study:
    """Return the study of a scene, with errors but next to no costs."""
    with costs_left_out():
        return study_accuracy(scene, budget=0.1, **options)

"""Statistics of chaotic motion: distances between distributions."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from vibroimpact.orchestrator.study.observation import Observation
from vibroimpact.orchestrator.study.statistics import statistics_of


def test_distributions_are_compared_without_a_warning_of_a_library() -> None:
    rows = np.column_stack([np.arange(30.0), np.linspace(0.0, 1.0, 30), np.ones(30)])
    shifted = rows + np.array([0.0, 0.1, 0.0])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = statistics_of(Observation(shifted), Observation(rows), [Observation(rows)])
    assert found is not None
    assert found.distribution_distance == pytest.approx(0.1)
    assert found.distribution_sampling == 0.0

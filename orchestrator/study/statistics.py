"""Statistics of chaotic motion, which two runs share although their impacts differ one by one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.orchestrator.study.observation import Observation

LEAST_IMPACTS = 20
"""Number of impacts (or samples) of a run, below which no statistics are compared."""


@dataclass(frozen=True, slots=True)
class Statistics:
    """Distance between the statistics of a run and of the reference, with the sampling error of that distance."""

    mean_interval_error: float
    """Relative difference of the mean interval between impacts."""
    mean_interval_sampling: float
    """Largest such difference among runs of the reference."""
    distribution_distance: float
    """Kolmogorov-Smirnov distance between the distributions of impact velocity; without known impacts, the largest of
    the sampled variables.
    """
    distribution_sampling: float
    """Largest such distance among runs of the reference."""


def statistics_of(
    found: Observation, reference: Observation, replicates: Sequence[Observation]
) -> Statistics | None:
    """Return the statistics of a chaotic run against the reference; None with fewer than `LEAST_IMPACTS`.

    Replicates are further runs of the reference, from slightly different numbers.
    """
    apart, count_of = (_off, _impacts) if len(reference.impacts) else (_off_samples, _samples)
    if min(count_of(one) for one in (found, reference, *replicates)) < LEAST_IMPACTS:
        return None
    interval, distance = apart(found, reference)
    by_chance = [apart(one, reference) for one in replicates]
    return Statistics(
        interval,
        max((one[0] for one in by_chance), default=math.nan),
        distance,
        max((one[1] for one in by_chance), default=math.nan),
    )


def _impacts(found: Observation) -> int:
    return len(found.impacts)


def _samples(found: Observation) -> int:
    return 0 if found.samples is None else len(found.samples)


def _off(found: Observation, other: Observation) -> tuple[float, float]:
    own, others = (float(np.diff(one.impacts[:, 0]).mean()) for one in (found, other))
    return abs(own - others) / others, _distance(found.impacts[:, 1], other.impacts[:, 1])


def _off_samples(found: Observation, other: Observation) -> tuple[float, float]:
    assert found.samples is not None
    assert other.samples is not None
    pairs = zip(found.samples.T, other.samples.T, strict=True)
    return math.nan, max(_distance(own, others) for own, others in pairs)


def _distance(values: NDArray[np.float64], others: NDArray[np.float64]) -> float:
    """Return the largest difference of two empirical distribution functions."""
    own, other = np.sort(values), np.sort(others)
    steps = np.concatenate([own, other])
    below, below_other = (np.searchsorted(one, steps, side="right") / len(one) for one in (own, other))
    return float(np.abs(below - below_other).max())

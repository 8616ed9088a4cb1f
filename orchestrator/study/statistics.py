"""Statistics of chaotic motion: what two runs of it have in common when no impact of theirs does."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import ks_2samp

from vibroimpact.orchestrator.study.observation import Floats, Observation

LEAST_IMPACTS = 20
"""Impacts below which there are no statistics."""


@dataclass(frozen=True, slots=True)
class Statistics:
    """How far the statistics of a run are from those of the reference, and how far chance alone takes them.

    Attributes
    ----------
    mean_interval_error, mean_interval_sampling : float
        Relative difference of the mean interval between impacts, and the largest among runs of the reference.
    velocity_distance, velocity_sampling : float
        Largest distance between the distributions of impact velocity (Kolmogorov-Smirnov), and likewise.
    """

    mean_interval_error: float
    mean_interval_sampling: float
    velocity_distance: float
    velocity_sampling: float


def statistics_of(
    found: Observation, reference: Observation, replicates: Sequence[Observation]
) -> Statistics | None:
    """Compare a run of chaotic motion with the reference.

    Parameters
    ----------
    found, reference : Observation
    replicates : sequence of Observation
        Further runs of the reference, from slightly different numbers.

    Returns
    -------
    Statistics or None
        None where there are too few impacts.
    """
    if min(len(one.impacts) for one in (found, reference, *replicates)) < LEAST_IMPACTS:
        return None
    interval, speed = _off(found.impacts, reference.impacts)
    by_chance = [_off(one.impacts, reference.impacts) for one in replicates]
    return Statistics(
        interval,
        max((one[0] for one in by_chance), default=math.nan),
        speed,
        max((one[1] for one in by_chance), default=math.nan),
    )


def _off(impacts: Floats, others: Floats) -> tuple[float, float]:
    own, other = (float(np.diff(rows[:, 0]).mean()) for rows in (impacts, others))
    distance = float(ks_2samp(impacts[:, 1], others[:, 1]).statistic)
    return abs(own - other) / other, distance

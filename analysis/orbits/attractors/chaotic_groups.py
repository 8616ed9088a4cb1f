"""Chaotic attractors separated by the impacts of long runs.

A chaotic run does not return to a state, but its impacts have means and extremes. These scatter between the blocks of
one run as they do between runs on one attractor. Two runs belong to different attractors if all blocks of one lie
beyond all blocks of the other. Runs that overlap, but differ by more than their blocks explain, stay unseparated.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

BLOCK, BLOCKS = 32, 64
"""Forcing periods of a block, and blocks of a run, for the separation of attractors."""
BATCH = 8
"""Blocks of a batch: batches of one run count as independent of each other."""
SEPARATION = 3.0
"""Distance of the means of two runs, over the sum of their standard deviations, above which they may be apart."""
DIFFERENT = 4.0
"""Variance of the means of runs, over the variance that their batches explain, above which runs are not alike. One
attractor with chatter and rests (damping ratio .01, restitution .8, angular frequency 2.9, stop at 0) has 1.9."""
SLOW = 0.01
"""Speed of an impact, over the fastest of its block, below which it does not count: chatter has any number of them."""
MEMBER = 5.0
"""Standard deviations from the mean of a group within which a block may belong to it."""
MOST_BLOCKS = 16
"""Number of blocks after which a start that fits no group stays undecided."""
LEAST_AGREEING = 0.98
"""Share of long runs whose first blocks must show their own group; below it, single blocks are no evidence."""


class Feature(IntEnum):
    """Quantities of the impacts at a stop in a block of forcing periods; their place on the last axis."""

    impacts = 0
    """Impacts per forcing period, without the slow impacts of a chatter."""
    speed = 1
    """Sum of the impact velocities per forcing period, m/s."""
    cosine = 2
    """Sum of impact velocity times the cosine of the forcing phase, per forcing period, m/s."""
    sine = 3
    """Sum of impact velocity times the sine of the forcing phase, per forcing period, m/s."""
    largest = 4
    """Largest impact velocity, m/s; 0 without impacts."""


class Blocks(NamedTuple):
    """Features of consecutive blocks, shape (start, block, stop, feature), and the states of the runs after them."""

    features: Floats
    states: Floats
    well: NDArray[np.bool_]


def block_features(
    owner: NDArray[np.int64],
    block: NDArray[np.int64],
    impacts: tuple[Floats, Floats, NDArray[np.int64]],
    shape: tuple[int, int, int],
    periods: int,
) -> Floats:
    """Return the features of blocks of runs, shape (run, block, stop, feature).

    Parameters
    ----------
    owner, block : array of int, shape (impact,)
        Run and block of each impact.
    impacts : tuple of array, shape (impact,)
        Forcing phase (rad), velocity (m/s), and stop (counted from 0) of each impact.
    shape : tuple of int
        Runs, blocks, stops.
    periods : int
        Forcing periods of a block.

    Examples
    --------
    >>> zero = np.zeros(2, np.int64)
    >>> block_features(zero, zero, (np.array([0.0, np.pi]), np.array([1.0, 3.0]), zero), (1, 1, 1), 2).round(9)
    array([[[[ 1.,  2., -1.,  0.,  3.]]]])
    """
    phase, velocity, stop = impacts
    cell = np.ravel_multi_index((owner, block, stop), shape)
    count = int(np.prod(shape))
    fastest = np.zeros(shape[:2])
    np.maximum.at(fastest, (owner, block), velocity)
    counted = (velocity > SLOW * fastest[owner, block]).astype(np.float64)
    rows = counted, velocity, velocity * np.cos(phase), velocity * np.sin(phase)
    sums = [np.bincount(cell, row, count) / periods for row in rows]
    largest = np.zeros(count)
    np.maximum.at(largest, cell, velocity)
    return np.stack([*sums, largest], axis=-1).reshape(*shape, len(Feature))


@dataclass(frozen=True, slots=True)
class Groups:
    """Runs of a sample by their attractor."""

    labels: NDArray[np.int64]
    """Group of each run, shape (run,); the group of most runs is 0."""
    means: Floats
    spreads: Floats
    """`means` and `spreads`: mean and standard deviation of a block, shape (group, feature)."""
    is_sure: bool = True
    """False if the runs differ more than their blocks explain, but are not apart."""

    def of(self, blocks: Floats) -> NDArray[np.int64]:
        """Return the group of single blocks, shape (start, feature); -1 if a block fits none."""
        count = len(self.means)
        off = np.abs(blocks[:, None] - self.means) / self.spreads
        fits = np.ones((len(blocks), count), np.bool_)
        for one in range(count):
            for other in range(count):
                if one != other:
                    gaps = np.abs(self.means[one] - self.means[other])
                    best = int(np.argmax(gaps / (self.spreads[one] + self.spreads[other])))
                    fits[:, one] &= (off[:, one, best] < off[:, other, best]) & (off[:, one, best] <= MEMBER)
        found = np.where(fits.any(axis=1), fits.argmax(axis=1), -1)
        return np.asarray(found, dtype=np.int64)


NO_GROUPS = Groups(np.empty(0, np.int64), np.empty((0, 0)), np.empty((0, 0)))
"""Groups without runs."""


def grouped(features: Floats) -> Groups:
    """Return the groups of runs that lie on different attractors.

    Features belong to chaotic runs without their transients, shape (run, block, stop, feature).

    >>> noise = np.random.default_rng(1).normal(0.0, 0.1, (6, BLOCKS, 1, len(Feature)))
    >>> grouped(noise + np.array([0.0, 1, 0, 1, 1, 1])[:, None, None, None]).labels
    array([1, 0, 1, 0, 0, 0])
    """
    runs, blocks = features.shape[:2]
    flat = features.reshape(runs, blocks, -1)
    rounding = np.abs(flat).mean(axis=(0, 1)) / BLOCK + 1e-300  # an impact across the edge of a block
    labels = components(_linked(flat, rounding))
    kinds = range(int(labels.max(initial=0)) + 1)
    means = np.array([flat[labels == kind].mean(axis=(0, 1)) for kind in kinds])
    spreads = np.array([flat[labels == kind].std(axis=(0, 1)) for kind in kinds])
    alike = all(_are_equal(flat[labels == kind], rounding) for kind in kinds)
    return Groups(labels, means, spreads + rounding, alike)


def merged(groups: Groups) -> Groups:
    """Return all runs as one group, whose number of attractors is unknown."""
    return Groups(np.zeros_like(groups.labels), groups.means[:1], groups.spreads[:1], is_sure=False)


def _linked(flat: Floats, rounding: Floats) -> NDArray[np.bool_]:
    """Return a mask of the pairs of runs that are not apart, shape (run, run)."""
    low, high = flat.min(axis=1), flat.max(axis=1)
    mean, spread = flat.mean(axis=1), flat.std(axis=1) + rounding
    linked = np.ones((len(flat), len(flat)), np.bool_)
    for feature in range(flat.shape[2]):
        below = high[:, None, feature] < low[None, :, feature]
        gap = np.abs(mean[:, None, feature] - mean[None, :, feature])
        far = gap > SEPARATION * (spread[:, None, feature] + spread[None, :, feature])
        linked &= ~((below | below.T) & far)
    return linked


def components(linked: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the connected component of each run, the largest numbered 0."""
    labels = np.full(len(linked), -1, np.int64)
    for seed in range(len(linked)):
        if labels[seed] >= 0:
            continue
        members = np.zeros(len(linked), np.bool_)
        members[seed] = True
        while (more := members | linked[members].any(axis=0)).sum() > members.sum():
            members = more
        labels[members] = labels.max() + 1
    order = np.argsort(-np.bincount(labels), kind="stable")
    return np.asarray(np.argsort(order)[labels], dtype=np.int64)


def _are_equal(flat: Floats, rounding: Floats) -> bool:
    """Tell whether the means of runs differ by no more than the batches of their blocks explain.

    Numbers of impacts do not count: they come in bursts in chatter, and velocities carry the same information.
    """
    runs, blocks, features = flat.shape
    batches = max(blocks // BATCH, 1)
    if runs < 2 or batches < 2:
        return True
    means = flat[:, : batches * BATCH].reshape(runs, batches, -1, features).mean(axis=2)
    means = np.delete(means, np.s_[Feature.impacts :: len(Feature)], axis=2)
    rounding = np.delete(rounding, np.s_[Feature.impacts :: len(Feature)])
    between = means.mean(axis=1).var(axis=0, ddof=1)
    within = means.var(axis=1, ddof=1).mean(axis=0) / batches
    return bool((between <= DIFFERENT * within + (rounding / blocks) ** 2).all())

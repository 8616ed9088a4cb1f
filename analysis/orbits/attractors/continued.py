"""Attractors continued over a parameter: those of neighbouring values are matched by their features."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.schema import OrbitClass
from vibroimpact.analysis.orbits.attractors.basins import Attractor, Basins
from vibroimpact.analysis.orbits.attractors.chaotic_groups import Feature

MATCHED = 0.25
"""Difference of the features of two attractors, over their size, up to which they are one attractor."""

FAR = 1e6
"""Difference that counts for attractors that do not match."""
MOST_NAMES = 3
"""Largest number of classes in the name of a continued attractor."""


@dataclass(eq=False)
class Continued:
    """Attractors over the values of a parameter.

    Attributes
    ----------
    basins : list of Basins
        Of each value.
    numbers : list of array of int, shape (attractor,)
        Number of each attractor of each value among the continued ones.
    last : list of Attractor
        The latest attractor of each continued one.
    """

    basins: list[Basins] = field(default_factory=list)
    numbers: list[NDArray[np.int64]] = field(default_factory=list)
    last: list[Attractor] = field(default_factory=list)

    def add(self, found: Basins) -> None:
        """Match the attractors of the next value with those before; the others begin."""
        from scipy.optimize import linear_sum_assignment

        numbers = np.full(len(found.attractors), -1)
        if self.last and found.attractors:
            off = np.array([[features_apart(one, other) for other in self.last] for one in found.attractors])
            same = np.array([[_of_one_class(one, other) for other in self.last] for one in found.attractors])
            matches = (off <= MATCHED) | same
            for here, before in zip(*linear_sum_assignment(np.where(matches, off, FAR)), strict=True):
                if matches[here, before]:
                    numbers[here] = before
                    self.last[before] = found.attractors[here]
        for here in np.flatnonzero(numbers < 0):
            numbers[here] = len(self.last)
            self.last.append(found.attractors[here])
        self.basins.append(found)
        self.numbers.append(numbers)

    @property
    def names(self) -> list[str]:
        """Names of the continued attractors: the classes that each has, in the order of the values."""
        found: list[list[str]] = [[] for _ in self.last]
        for basins, numbers in zip(self.basins, self.numbers, strict=True):
            for number, each in zip(numbers, basins.attractors, strict=True):
                if each.name not in found[number]:
                    found[number].append(each.name)
        words = [", ".join(names[:MOST_NAMES]) + " ..." * (len(names) > MOST_NAMES) for names in found]
        return [
            f"{each} ({words[: place + 1].count(each)})" if words.count(each) > 1 else each
            for place, each in enumerate(words)
        ]


def _of_one_class(one: Attractor, other: Attractor) -> bool:
    """Tell whether two attractors have one class, and hit each stop equally often; a coarse step may part them."""
    here, there = (np.nan_to_num(each.impacts) for each in (one, other))
    return one.name == other.name and bool((np.abs(here - there) <= MATCHED * max(here.max(), 1e-300)).all())


def features_apart(one: Attractor, other: Attractor) -> float:
    """Return the largest difference of the features of two attractors, over the size of both motions.

    The features are impacts in a forcing period at each stop, over those of all stops, and the largest velocity.
    Sums of velocities count, too, also weighted by the cosine and sine of their phases, and the extremes of the motion.
    The difference is infinite where only one of them has no impacts.
    """
    kinds = {each.kind.kind is OrbitClass.no_impacts for each in (one, other)}
    if len(kinds) > 1:
        return float("inf")
    here, there = (np.nan_to_num(each.features.at_stops) for each in (one, other))
    extremes = np.array([one.features.extremes, other.features.extremes])
    off = [np.abs(extremes[0] - extremes[1]).max() / max(float(np.abs(extremes).max()), 1e-300)]
    for features in ([Feature.impacts], [Feature.speed, Feature.cosine, Feature.sine], [Feature.largest]):
        both = np.array([here[:, features], there[:, features]])
        size = max(float(np.abs(both[..., 0]).sum(axis=1).max()), 1e-300)
        off.append(np.abs(both[0] - both[1]).max() / size)
    return float(max(off))

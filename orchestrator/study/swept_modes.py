"""The number of modes that a whole sweep needs: its ends decide, and points between them that need more modes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from vibroimpact.fmus.errors import SceneError
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.designs import unit_design
from vibroimpact.orchestrator.scene.replay_models import RECORDING_KEY
from vibroimpact.orchestrator.scene.sweep import Dimension, SpacedValues, dimensions
from vibroimpact.orchestrator.study.convergence import Convergence, ModeRuns, Note, converged_modes

MOST_ENDS = 16
"""Number of combinations of the ends of all dimensions, up to which all run; above, two opposite ones run."""
ALL_CHECKED = 64
"""Number of points of a sweep, up to which all of them run; above, a sample of them runs."""
PROBED = 32
"""Number of inner points of a larger sweep that run, from a Sobol sequence: the same on every machine."""
SEED = 0
"""Seed of the Sobol sequence."""
REFINED = 32
"""Largest number of further points, between points where errors are large."""

Place = tuple[int, ...]
"""Place of a point in a sweep: an index for each dimension."""


class SweepPlaces:
    """The points of a sweep at which a scene is tried before it runs.

    All recordings of a replay share one point. An adaptive axis has its start values.
    """

    def __init__(self, scene: Scene) -> None:
        self._alone = scene.unswept(varied=[axis.key for axis in scene.sweep])
        self._dimensions = dimensions([axis for axis in scene.sweep if axis.key != RECORDING_KEY])
        self.shape = tuple(len(members[0].values) for members in self._dimensions)

    @property
    def count(self) -> int:
        """Number of points of the sweep."""
        return math.prod(self.shape)

    def values_at(self, place: Place) -> dict[str, float]:
        """Return the swept values at a place, by key."""
        at = zip(self._dimensions, place, strict=True)
        return {axis.key: axis.values[index] for members, index in at for axis in members}

    def scene_at(self, place: Place) -> Scene:
        """Return the scene at a place, without a sweep."""
        values = self.values_at(place)
        return self._alone.with_values(values) if values else self._alone

    def ends(self) -> list[Place]:
        """Return the places where each dimension is at an end of its values, and the place in the middle."""
        ends = [_ends_of(members) for members in self._dimensions]
        many = math.prod(map(len, ends)) > MOST_ENDS
        corners = [tuple(end[0] for end in ends), tuple(end[1 % len(end)] for end in ends)]
        places = corners if many else [*product(*ends)]
        return list(dict.fromkeys([*places, tuple(map(_middle_of, self._dimensions))]))

    def inner(self) -> Iterator[Place]:
        """Return further places: all places of a small sweep, else the places of a Sobol sequence."""
        if self.count <= ALL_CHECKED:
            return product(*map(range, self.shape))
        shares = unit_design("sobol", PROBED, len(self.shape), SEED)
        return (tuple(int(u * n) for u, n in zip(row, self.shape, strict=True)) for row in shares)

    def halfway(self, errors: Mapping[Place, float]) -> Place | None:
        """Return the place halfway between the two known neighbours with the largest score; None where none is left.

        Two places are neighbours if the ball with both on its diameter contains no other place. Their score is the
        larger of their errors times their distance. An error is NaN where a place has no result.
        """
        known = np.array(list(errors))
        size = np.nan_to_num(np.array(list(errors.values())))
        unit = known / np.maximum(np.array(self.shape) - 1.0, 1.0)
        square = ((unit[:, None] - unit) ** 2).sum(axis=2)
        first, second = np.triu_indices(len(known), 1)
        alone = [
            not (square[i] + square[j] < square[i, j] * (1.0 - 1e-12)).any()
            for i, j in zip(first, second, strict=True)
        ]
        score = np.where(alone, np.maximum(size[first], size[second]) * np.sqrt(square[first, second]), 0.0)
        for pair in np.argsort(-score, kind="stable"):
            place = tuple(((known[first[pair]] + known[second[pair]]) // 2).tolist())
            if score[pair] > 0.0 and place not in errors:
                return place
        return None


def _ends_of(members: Dimension) -> list[int]:
    """Return the indices of the lowest and the highest value of each key of a dimension."""
    ends = []
    for axis in members:
        last = len(axis.values) - 1
        # the ends of a range have its lowest and its highest value
        indices: Sequence[int] = (0, last) if isinstance(axis.values, SpacedValues) else range(last + 1)
        ends += [min(indices, key=axis.values.__getitem__), max(indices, key=axis.values.__getitem__)]
    return list(dict.fromkeys(ends))


def _middle_of(members: Dimension) -> int:
    values = members[0].values
    if isinstance(values, SpacedValues):
        return (len(values) - (values[0] > values[-1])) // 2
    return sorted(range(len(values)), key=values.__getitem__)[len(values) // 2]


@dataclass(frozen=True, slots=True)
class SweepModes:
    """The number of modes that a sweep needs."""

    convergence: Convergence
    """Result for the whole sweep; its error is the largest of all tried points."""
    points: int
    """Number of tried points."""
    unmet: tuple[str, ...]
    """Points between the ends where no number of modes meets the tolerance, as words with their values."""


def modes_of_sweep(scene: Scene, tolerance: float, note: Note = lambda text: None) -> SweepModes:
    """Return the fewest modes that meet a tolerance at the tried points of a sweep.

    The ends and the middle decide first. Further points then run with the number found and with the largest number of
    its comparison. A small sweep tries all points; a larger one tries 32 points of a Sobol sequence and up to 32 more
    where errors are large. A point that differs by more than the tolerance decides from then on. `note` gets a line
    for each run longer than a second. The scene has `modes = "auto"`. SceneError: no number of modes meets the
    tolerance at an end, or in the middle.
    """
    search = _Search(SweepPlaces(scene), tolerance, note)
    for place in search.places.inner():
        search.look_at(place)
    if search.places.count > ALL_CHECKED:
        search.refine()
    search.settle()
    errors = search.errors()
    worst = max([search.found.error, *errors.values()])
    return SweepModes(replace(search.found, error=worst), len(search.runs), tuple(search.unmet.values()))


class _Search:
    """Points that were tried, and the fewest modes that they need so far."""

    def __init__(self, places: SweepPlaces, tolerance: float, note: Note) -> None:
        self.places, self._tolerance, self._note = places, tolerance, note
        self.runs: dict[Place, ModeRuns | None] = {}
        self.unmet: dict[Place, str] = {}
        for place in places.ends():
            self.runs[place] = self._open(place)
        self._deciding = [one for one in self.runs.values() if one is not None]
        self.found = converged_modes(self._deciding, tolerance)

    def _open(self, place: Place) -> ModeRuns:
        words = self._words(place)
        return ModeRuns(
            self.places.scene_at(place), self._tolerance, self._note, f" at {words}" if words else ""
        )

    def _words(self, place: Place) -> str:
        return ", ".join(f"{key} = {value:.6g}" for key, value in self.places.values_at(place).items())

    def look_at(self, place: Place) -> float:
        """Return the distance of the number found from more modes at a place, which decides if that is too large.

        NaN where no number of modes meets the tolerance, or the scene does not run.
        """
        if place in self.unmet:
            return math.nan
        try:
            runs = self.runs.get(place) or self.runs.setdefault(place, self._open(place))
            assert runs is not None
            error = runs.distance(self.found.modes, self.found.checked_with)
            if error <= self._tolerance:
                return error
            deciding = [*(one for one in self._deciding if one is not runs), runs]
            self.found = converged_modes(deciding, self._tolerance)
            self._deciding = deciding
            return runs.distance(self.found.modes, self.found.checked_with)
        except SceneError:
            self.runs.setdefault(place, None)
            self.unmet[place] = self._words(place)
            return math.nan

    def errors(self) -> dict[Place, float]:
        """Return the error at each place where a number of modes meets the tolerance."""
        distances = {place: self.look_at(place) for place in list(self.runs)}
        return {place: error for place, error in distances.items() if not math.isnan(error)}

    def refine(self) -> None:
        """Try places between known neighbours, where errors are large and neighbours are far apart."""
        for _ in range(REFINED):
            place = self.places.halfway(self.errors() | dict.fromkeys(self.unmet, math.nan))
            if place is None:
                return
            self.look_at(place)

    def settle(self) -> None:
        """Try all places again until the number of modes meets the tolerance at each of them."""
        before = None
        while self.found is not before:
            before = self.found
            self.errors()

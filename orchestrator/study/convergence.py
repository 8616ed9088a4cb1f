"""How many modes a scene takes: runs with different numbers of modes, told by those with more."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import islice, pairwise

from vibroimpact.fmus.errors import SceneError
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.keys import MODES
from vibroimpact.orchestrator.scene.models import MOST_MODES
from vibroimpact.orchestrator.study.errors import errors_of
from vibroimpact.orchestrator.study.observation import Observation
from vibroimpact.orchestrator.study.references import disturbed_scenes, observed, reference_of, scales_of
from vibroimpact.orchestrator.study.statistics import statistics_of

LADDER = (1, 2, 4, 8, 16, 32, MOST_MODES)
"""Modes that are tried first; between two of them the fewest are looked for."""
JUDGED = 4
"""Modes from which on a motion that looks chaotic is taken for it."""
LONG = 1.0
"""Wall time of a run, s, above which it is told."""
REPLICATES = 4
"""Further runs of chaotic motion, which tell what chance does to its statistics."""

Note = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Convergence:
    """How many modes a scene takes."""

    modes: int
    """The fewest that meet the tolerance."""
    error: float
    """Their estimated error, relative."""
    checked_with: int
    """The most modes that they were compared with."""
    by: str
    """`motion`, or `statistics` where motion is chaotic."""
    errors: dict[int, float]
    """Distance of each number of modes that was tried from the most that it was compared with, the largest of all
    points; inf: an impact is missing.
    """


class ModeRuns:
    """Runs of one point with different numbers of modes, each made once.

    The scene has `modes = "auto"` and no sweep. The tolerance is relative, of all that is recorded
    (`errors.errors_of`); in chaotic motion of the statistics of its impacts. `note` is told of each run that takes
    longer than a second. `where` is the point of a sweep, for messages; empty without one. SceneError: the scene does
    not run.
    """

    def __init__(
        self, scene: Scene, tolerance: float, note: Note = lambda text: None, where: str = ""
    ) -> None:
        self.scene, self.where = scene, where
        self._tolerance, self._note = tolerance, note
        self.tried: dict[int, Observation] = {}
        self._replicates: dict[int, list[Observation]] = {}
        self.by_statistics = False
        most = getattr(scene.body, "size", MOST_MODES)
        fewest = next(n for n in range(1, most + 1) if n == most or self._is_valid(n))
        self.ladder = [fewest, *(n for n in LADDER if fewest < n < most), *([most] if most > fewest else [])]
        self._judged = min(max(fewest, JUDGED), most)
        if self.of(self._judged).failure:  # ten more such runs would tell nothing else
            raise self.failed(self.tried[self._judged].failure)
        self._scales = scales_of(self._with(self._judged))

    @cached_property
    def _is_chaotic(self) -> bool:
        return reference_of(self._with(self._judged)).chaotic

    def _with(self, modes: int) -> Scene:
        return self.scene.with_values({MODES: modes})

    def _is_valid(self, modes: int) -> bool:
        try:
            self._with(modes)
        except SceneError:
            return False
        return True

    def of(self, modes: int) -> Observation:
        """Return what the scene shows with so many modes."""
        if modes not in self.tried:
            self.tried[modes] = observed(self._with(modes))
            if self.tried[modes].seconds > LONG:
                self._note(f"{modes} modes{self.where}: {self.tried[modes].seconds:.1f} s")
        return self.tried[modes]

    def distance(self, modes: int, others: int) -> float:
        """Return the relative distance between two runs; inf where they are different motions.

        Motion that differs by more than the tolerance is compared by its statistics where it is chaotic.
        """
        found, reference = self.of(modes), self.of(others)
        errors = errors_of(found, reference, self._scales)
        worst = errors.worst()
        off = math.inf if errors.failure or math.isnan(worst) else worst
        if off > self._tolerance and self._is_chaotic:
            self.by_statistics = True
            return self._statistical_distance(found, reference, others)
        return off

    def _statistical_distance(self, found: Observation, reference: Observation, others: int) -> float:
        """Return the distance of the statistics of two chaotic motions, less what chance alone makes of it."""
        if others not in self._replicates:
            scenes = islice(disturbed_scenes(self._with(others), REPLICATES), REPLICATES)
            self._replicates[others] = [observed(one) for one in scenes]
        compared = statistics_of(found, reference, self._replicates[others])
        if found.failure or compared is None:
            return math.inf
        interval = max(compared.mean_interval_error - compared.mean_interval_sampling, 0.0)
        return max(interval, compared.distribution_distance - compared.distribution_sampling, 0.0)

    def not_met(self) -> SceneError:
        """Return that no number of modes meets the tolerance, with what was reached."""
        finest = self.ladder[-1]
        errors = {n: self.distance(n, finest) for n in self.ladder[:-1]}
        best = min(errors, key=lambda n: errors[n])
        failure = next((run.failure for run in self.tried.values() if run.failure), "")
        if failure and not math.isfinite(errors[best]):
            return self.failed(failure)
        reached = (
            f"{errors[best]:.2g} with {best}"
            if math.isfinite(errors[best])
            else "other impacts with each number"
        )
        hint = "Ask for less, or record less: impact times and velocities converge last."
        if not (self.scene.body.HAS_MASSES or self.scene.body.has_residual_vectors):
            hint += " residual = true keeps the static flexibility of the modes that are left out."
        return SceneError(
            [
                f"{self.scene.source}: body.modes: expected a number of modes that meets execution.tolerance = "
                f"{self._tolerance:g}{self.where}, got {reached} modes (compared with {finest}). {hint}"
            ]
        )

    def failed(self, failure: str) -> SceneError:
        """Return that the point does not run."""
        return SceneError(
            [
                f"{self.scene.source}: body.modes: expected runs to compare{self.where}, got one that failed: "
                f"{failure}."
            ]
        )


@dataclass(frozen=True, slots=True)
class _Jointly:
    """Points of which all have to meet a tolerance with the same number of modes."""

    points: Sequence[ModeRuns]
    tolerance: float
    ladder: list[int] = field(init=False)

    def __post_init__(self) -> None:
        ladder = max((one.ladder for one in self.points), key=lambda ladder: ladder[0])
        object.__setattr__(self, "ladder", ladder)

    @property
    def ends_exactly(self) -> bool:
        """Whether the finest run has all modes that there are."""
        return self.points[0].scene.body.HAS_MASSES

    @property
    def by(self) -> str:
        return "statistics" if any(one.by_statistics for one in self.points) else "motion"

    def distance(self, modes: int, others: int) -> float:
        """Return the largest distance of all points; the first that is above the tolerance does."""
        largest = 0.0
        for one in self.points:
            largest = max(largest, one.distance(modes, others))
            if largest > self.tolerance:
                break
        return largest

    def errors(self, others: int, below: int) -> dict[int, float]:
        """Return the distance of each number of modes below one that all points have tried, the largest of all."""
        tried = set.intersection(*(set(one.tried) for one in self.points))
        return {n: max(one.distance(n, others) for one in self.points) for n in sorted(tried) if n < below}


def converged_modes(points: Sequence[ModeRuns], tolerance: float) -> Convergence:
    """Return the fewest modes with which all points meet a tolerance, checked by runs with more.

    The number of modes is doubled until one run differs little enough from the next, and that one from the next but
    one; between the last two the fewest are then found by bisection. The estimated error is the distance from the
    finest run plus that run's own. Of a chain the finest has all modes, and no error; a chain that meets the tolerance
    with none fewer takes all. SceneError: a point does not meet it with any number of modes.
    """
    runs = _Jointly(points, tolerance)
    for coarse, fine in pairwise(runs.ladder):
        off = runs.distance(coarse, fine)
        more = next((n for n in runs.ladder if n > fine), None)
        if off > tolerance or (more is None and 2.0 * off > tolerance and not runs.ends_exactly):
            continue
        own = runs.distance(fine, more) if more is not None else 0.0 if runs.ends_exactly else off
        if off + own <= tolerance:
            return _fewest(runs, coarse, fine, own, more or fine)
    most = runs.ladder[-1]
    if runs.ends_exactly:
        return Convergence(most, 0.0, most, "motion", runs.errors(most, most) | {most: 0.0})
    before = runs.ladder[-2] if len(runs.ladder) > 1 else most
    raise max(points, key=lambda one: one.distance(before, most)).not_met()


def _fewest(runs: _Jointly, coarse: int, fine: int, own: float, checked_with: int) -> Convergence:
    """Return the fewest modes up to `coarse` whose distance from `fine`, and that one's own error, are small enough."""
    low = max((n for n in runs.ladder if n < coarse), default=runs.ladder[0] - 1)
    high = coarse
    while high - low > 1:
        middle = (low + high) // 2
        if runs.distance(middle, fine) + own <= runs.tolerance:
            high = middle
        else:
            low = middle
    error = runs.distance(high, fine) + own
    return Convergence(high, error, checked_with, runs.by, runs.errors(fine, fine))

"""The number of modes that a scene needs: each run is compared with runs that have more modes."""

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
"""Numbers of modes that are tried first; the fewest are then searched between two of these numbers."""
CHAOS_MODES = 4
"""Number of modes of the run that decides whether the motion is chaotic; a scene with fewer modes takes all."""
NOTED_SECONDS = 1.0
"""Wall time of a run, s, above which `note` gets a line about the run."""
REPLICATES = 4
"""Further runs of chaotic motion, which give the sampling error of its statistics."""

Note = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Convergence:
    """The number of modes that a scene needs."""

    modes: int
    """The fewest modes that meet the tolerance."""
    error: float
    """Estimated error with `modes`, relative."""
    checked_with: int
    """The largest number of modes with which `modes` was compared."""
    by: str
    """`motion`, or `statistics` where the motion is chaotic."""
    errors: dict[int, float]
    """Relative distance of the run with each tried number of modes from the finest run of its comparison.

    The largest of all points; inf where an impact is missing.
    """


class ModeRuns:
    """Runs of one point with different numbers of modes, each made once.

    The scene has `modes = "auto"` and no sweep. The tolerance is relative and holds for all recorded quantities
    (`errors.errors_of`); in chaotic motion it holds for the statistics of the impacts. `note` gets a line for each run
    longer than a second. `where` names the point of a sweep in messages; it is empty without a sweep. SceneError: the
    scene does not run.
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
        self._chaos_modes = min(max(fewest, CHAOS_MODES), most)
        if self.of(self._chaos_modes).failure:  # the ten disturbed runs would fail in the same way
            raise self.failed(self.tried[self._chaos_modes].failure)
        self._scales = scales_of(self._with(self._chaos_modes))

    @cached_property
    def _is_chaotic(self) -> bool:
        return reference_of(self._with(self._chaos_modes)).chaotic

    def _with(self, modes: int) -> Scene:
        return self.scene.with_values({MODES: modes})

    def _is_valid(self, modes: int) -> bool:
        try:
            self._with(modes)
        except SceneError:
            return False
        return True

    def of(self, modes: int) -> Observation:
        """Return the observation of the scene with a number of modes."""
        if modes not in self.tried:
            self.tried[modes] = observed(self._with(modes))
            if self.tried[modes].seconds > NOTED_SECONDS:
                self._note(f"{modes} modes{self.where}: {self.tried[modes].seconds:.1f} s")
        return self.tried[modes]

    def distance(self, modes: int, others: int) -> float:
        """Return the relative distance between two runs; inf where they are different motions.

        Chaotic motions that differ by more than the tolerance are compared by their statistics.
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
        """Return the distance between the statistics of two chaotic motions, less its sampling error."""
        if others not in self._replicates:
            scenes = islice(disturbed_scenes(self._with(others), REPLICATES), REPLICATES)
            self._replicates[others] = [observed(one) for one in scenes]
        compared = statistics_of(found, reference, self._replicates[others])
        if found.failure or compared is None:
            return math.inf
        interval = max(compared.mean_interval_error - compared.mean_interval_sampling, 0.0)
        return max(interval, compared.distribution_distance - compared.distribution_sampling, 0.0)

    def not_met(self) -> SceneError:
        """Return the error for the case that no number of modes meets the tolerance, with the best error reached."""
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
        """Return the error for the case that the point does not run."""
        return SceneError(
            [
                f"{self.scene.source}: body.modes: expected runs to compare{self.where}, got one that failed: "
                f"{failure}."
            ]
        )


@dataclass(frozen=True, slots=True)
class _Jointly:
    """Points that all have to meet a tolerance with the same number of modes."""

    points: Sequence[ModeRuns]
    tolerance: float
    ladder: list[int] = field(init=False)

    def __post_init__(self) -> None:
        ladder = max((one.ladder for one in self.points), key=lambda ladder: ladder[0])
        object.__setattr__(self, "ladder", ladder)

    @property
    def ends_exactly(self) -> bool:
        """Whether the finest run has all modes of the body."""
        return self.points[0].scene.body.HAS_MASSES

    @property
    def by(self) -> str:
        return "statistics" if any(one.by_statistics for one in self.points) else "motion"

    def distance(self, modes: int, others: int) -> float:
        """Return the largest distance of all points, or the first distance above the tolerance."""
        largest = 0.0
        for one in self.points:
            largest = max(largest, one.distance(modes, others))
            if largest > self.tolerance:
                break
        return largest

    def errors(self, others: int, below: int) -> dict[int, float]:
        """Return the largest distance of all points for each number of modes below `below` that all have tried."""
        tried = set.intersection(*(set(one.tried) for one in self.points))
        return {n: max(one.distance(n, others) for one in self.points) for n in sorted(tried) if n < below}


def converged_modes(points: Sequence[ModeRuns], tolerance: float) -> Convergence:
    """Return the fewest modes with which all points meet a tolerance, checked by runs with more modes.

    The number of modes doubles until three runs in a row agree: their two distances add up to no more than the
    tolerance. Bisection then finds the fewest modes in between. The
    estimated error is the distance from the finer run plus the error of the finer run itself. The finest run of a
    chain has all modes and no error; a chain takes all modes if no smaller number meets the tolerance.
    SceneError: no number of modes meets the tolerance at some point.
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
    """Return the fewest modes up to `coarse` whose distance from `fine`, plus `own`, meets the tolerance."""
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

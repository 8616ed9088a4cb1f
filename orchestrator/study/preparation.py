"""What is found out about a scene before it runs: how many modes it takes, and how large its errors are."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import islice, pairwise, product

from vibroimpact.fmus.errors import SceneError
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.body_models import BeamBody, ChainBody
from vibroimpact.orchestrator.scene.keys import MODES
from vibroimpact.orchestrator.scene.models import MOST_MODES
from vibroimpact.orchestrator.scene.replay_models import RECORDING_KEY
from vibroimpact.orchestrator.study.errors import Scales, errors_of
from vibroimpact.orchestrator.study.observation import Observation
from vibroimpact.orchestrator.study.references import disturbed_scenes, observed, reference_of, scales_of
from vibroimpact.orchestrator.study.statistics import statistics_of

LADDER = (1, 2, 4, 8, 16, 32, MOST_MODES)
"""Modes that are tried first; between two of them the fewest are looked for."""
JUDGED = 4
"""Modes from which on a motion that looks chaotic is taken for it."""
MOST_AXES = 3
"""Axes of a sweep of which all corners are looked at; of more, the two opposite ones."""
LONG = 1.0
"""Wall time of a run, s, above which it is told."""
REPLICATES = 4
"""Further runs of chaotic motion, which tell what chance does to its statistics."""

Note = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Convergence:
    """How many modes a scene takes.

    Attributes
    ----------
    modes : int
        The fewest that meet the tolerance.
    error : float
        Their estimated error, relative.
    checked_with : int
        The most modes that they were compared with.
    by : str
        `motion`, or `statistics` where motion is chaotic.
    errors : dict of int to float
        Distance of each number of modes that was tried from the most that it was compared with; inf: an impact is
        missing.
    """

    modes: int
    error: float
    checked_with: int
    by: str
    errors: dict[int, float]


def prepared_scene(scene: Scene, note: Note = lambda text: None) -> Scene:
    """Return a scene that is ready to run, with what was found out about it.

    A scene without `execution.tolerance` is ready as it is. Else `modes = "auto"` becomes the fewest modes that meet
    it, at the corners of the sweep and in its middle, and the error of what is recorded is estimated there: that of
    the number of modes, where it was found here, and that of the solution (`references.reference_of`). All of this is
    the same in every run, on every machine.

    Parameters
    ----------
    scene : Scene
    note : callable
        Told what was found, a line at a time.

    Returns
    -------
    Scene
        Its `found` are attributes of its datasets.

    Raises
    ------
    SceneError
        No number of modes meets the tolerance.
    """
    tolerance = scene.execution.tolerance
    if tolerance is None:
        return scene
    scene = with_found_modes(scene, note)
    truncation = scene.found.get("estimated_error_of_modes")
    points = _looked_at(scene)
    ran = [observed(point) for point in points]
    unfinished = [run.failure for run in ran if run.failure]
    if unfinished:
        note(f"no error is estimated: {unfinished[0]}")
        of = f"nothing: {unfinished[0]}"
        found = {**scene.found, "tolerance": tolerance, "estimated_error": math.nan, "estimated_error_of": of}
        return scene.model_copy(update={"found": found})
    errors = [_error_of_solution(point, run) for point, run in zip(points, ran, strict=True)]
    told = [error for error in errors if not math.isnan(error)]
    solution = max(told, default=math.nan)
    error = solution if truncation is None else float(truncation)
    if truncation is not None and not math.isnan(solution):
        error += solution
    found = {
        **scene.found,
        "tolerance": tolerance,
        "estimated_error": error,
        "estimated_error_of": _what(len(points), truncation is not None, len(told)),
    }
    if math.isnan(error):
        note("the motion is chaotic: no error of single impacts is estimated")
    elif error > tolerance:
        note(f"estimated error {error:.1e}, above execution.tolerance = {tolerance:g}")
    return scene.model_copy(update={"found": found})


def with_found_modes(scene: Scene, note: Note = lambda text: None) -> Scene:
    """Return a scene with `modes = "auto"` replaced by the fewest that meet its tolerance; others as they are.

    Raises
    ------
    SceneError
        No number of modes meets it.
    """
    tolerance = scene.execution.tolerance
    if tolerance is None or not _finds_modes(scene):
        return scene
    converged = [converged_modes(point, tolerance, note) for point in _looked_at(scene)]
    most = max(converged, key=lambda one: (one.modes, one.error))
    error = max(one.error for one in converged)
    chaotic = any(one.by == "statistics" for one in converged)
    note(
        f"modes = {most.modes}: estimated error {error:.1e}, checked with {most.checked_with}"
        f"{'; the motion is chaotic, its statistics are compared' if chaotic else ''}"
    )
    found: dict[str, str | float | int] = {
        "tolerance": tolerance,
        "modes_found": most.modes,
        "modes_checked_with": most.checked_with,
        "modes_compared_by": "statistics" if chaotic else "motion",
        "modes_tried": json.dumps({str(n): round_off(off) for n, off in sorted(most.errors.items())}),
        "estimated_error_of_modes": error,
    }
    return scene.with_values({MODES: most.modes}).model_copy(update={"found": found})


def round_off(error: float) -> float | str:
    """Return an error with three digits, as JSON has it.

    >>> round_off(0.00123456), round_off(float("inf"))
    (0.00123, 'another motion')
    """
    return float(f"{error:.3g}") if math.isfinite(error) else "another motion"


def _what(points: int, truncated: bool, told: int) -> str:
    """Return what an error is estimated of: in words, with how many of the points looked at are chaotic."""
    parts = [
        *(["the number of modes"] if truncated else []),
        *(["the solution of the motion"] if told else []),
    ]
    where = "" if points == 1 else f", the largest of {points} points of the sweep"
    chaotic = points - told
    left_out = (
        ""
        if not chaotic or not told
        else f"; of {chaotic}, which are chaotic, that of the solution means nothing"
    )
    return (" and ".join(parts) or "nothing: the motion is chaotic") + where + left_out


def _finds_modes(scene: Scene) -> bool:
    return isinstance(scene.body_given, BeamBody | ChainBody) and scene.body_given.modes == "auto"


def _looked_at(scene: Scene) -> list[Scene]:
    """Return the scene at the corners of its sweep and in its middle, without a sweep."""
    alone = scene.with_sweep({}) if scene.sweep else scene
    axes = [axis for axis in scene.sweep if axis.key != RECORDING_KEY]
    if not axes:
        return [alone]
    ends = [(axis.values[0], axis.values[-1]) for axis in axes]
    corners = [*zip(*ends, strict=True)] if len(axes) > MOST_AXES else [*product(*ends)]
    middle = tuple(sorted(axis.values)[len(axis.values) // 2] for axis in axes)
    places = dict.fromkeys((*corners, middle))
    keys = [axis.key for axis in axes]
    return [alone.with_values(dict(zip(keys, place, strict=True))) for place in places]


def converged_modes(scene: Scene, tolerance: float, note: Note = lambda text: None) -> Convergence:
    """Return the fewest modes of a scene that meet a tolerance, checked by a run with more.

    The number of modes is doubled until one run differs little enough from the next, and that one from the next but
    one; between the last two the fewest are then found by bisection. The estimated error is the distance from the
    finest run plus that run's own. Of a chain the finest has all modes, and no error; a chain that meets the tolerance
    with none fewer takes all.

    Parameters
    ----------
    scene : Scene
        With `modes = "auto"`, without a sweep.
    tolerance : float
        Relative, of all that is recorded (`errors.errors_of`); in chaotic motion of the statistics of its impacts.
    note : callable
        Told of each run that takes longer than a second.

    Raises
    ------
    SceneError
        The scene does not meet it with any number of modes.
    """
    runs = _Runs(scene, note)
    for coarse, fine in pairwise(runs.ladder):
        off = runs.distance(coarse, fine)
        more = next((n for n in runs.ladder if n > fine), None)
        if off > tolerance or (more is None and 2.0 * off > tolerance and not runs.ends_exactly):
            continue
        own = runs.distance(fine, more) if more is not None else 0.0 if runs.ends_exactly else off
        if off + own <= tolerance:
            return _fewest(runs, coarse, fine, own, tolerance, more or fine)
    if runs.ends_exactly:
        most = runs.ladder[-1]
        errors = {n: runs.distance(n, most) for n in runs.ladder[:-1]}
        return Convergence(most, 0.0, most, "motion", errors | {most: 0.0})
    raise _not_met(runs, tolerance)


def _fewest(
    runs: _Runs, coarse: int, fine: int, own: float, tolerance: float, checked_with: int
) -> Convergence:
    """Return the fewest modes up to `coarse` whose distance from `fine`, and that one's own error, are small enough."""
    low = max((n for n in runs.ladder if n < coarse), default=runs.ladder[0] - 1)
    high = coarse
    while high - low > 1:
        middle = (low + high) // 2
        if runs.distance(middle, fine) + own <= tolerance:
            high = middle
        else:
            low = middle
    error = runs.distance(high, fine) + own
    errors = {n: runs.distance(n, fine) for n in runs.tried if n < fine}
    return Convergence(high, error, checked_with, "statistics" if runs.chaotic else "motion", errors)


def _not_met(runs: _Runs, tolerance: float) -> SceneError:
    finest = runs.ladder[-1]
    errors = {n: runs.distance(n, finest) for n in runs.ladder[:-1]}
    best = min(errors, key=lambda n: errors[n])
    failure = next((run.failure for run in runs.tried.values() if run.failure), "")
    if failure and not math.isfinite(errors[best]):
        return _failed(runs.scene, failure)
    reached = (
        f"{errors[best]:.2g} with {best}" if math.isfinite(errors[best]) else "other impacts with each number"
    )
    hint = "Ask for less, or record less: impact times and velocities converge last."
    if isinstance(runs.scene.body, BeamBody) and not runs.scene.body.residual:
        hint += " residual = true keeps the static flexibility of the modes that are left out."
    return SceneError(
        [
            f"{runs.scene.source}: body.modes: expected a number of modes that meets execution.tolerance = "
            f"{tolerance:g}, got {reached} modes (compared with {finest}). {hint}"
        ]
    )


def _failed(scene: Scene, failure: str) -> SceneError:
    return SceneError(
        [f"{scene.source}: body.modes: expected runs to compare, got one that failed: {failure}."]
    )


@dataclass(slots=True)
class _Runs:
    """Runs of a scene with different numbers of modes, each made once."""

    scene: Scene
    note: Note
    chaotic: bool = False
    ends_exactly: bool = False
    ladder: list[int] = field(default_factory=list)
    tried: dict[int, Observation] = field(default_factory=dict)
    _scales: Scales | None = None
    _replicates: dict[int, list[Observation]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        most = getattr(self.scene.body, "size", MOST_MODES)
        fewest = next(n for n in range(1, most + 1) if n == most or self._is_valid(n))
        self.ladder = [fewest, *(n for n in LADDER if fewest < n < most), *([most] if most > fewest else [])]
        self.ends_exactly = isinstance(self.scene.body, ChainBody)
        count = min(max(fewest, JUDGED), most)
        if self.of(count).failure:  # ten more such runs would tell nothing else
            raise _failed(self.scene, self.tried[count].failure)
        judged = self._with(count)
        self._scales = scales_of(judged)
        self.chaotic = reference_of(judged).chaotic

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
                self.note(f"{modes} modes: {self.tried[modes].seconds:.1f} s")
        return self.tried[modes]

    def distance(self, modes: int, others: int) -> float:
        """Return the relative distance between two runs; inf where they are different motions."""
        assert self._scales is not None
        found, reference = self.of(modes), self.of(others)
        if self.chaotic:
            return self._statistical_distance(found, reference, others)
        errors = errors_of(found, reference, self._scales)
        worst = errors.worst()
        return math.inf if errors.failure or math.isnan(worst) else worst

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


def _error_of_solution(scene: Scene, run: Observation) -> float:
    """Return the estimated error of how the motion of a scene is solved for; NaN where it is chaotic."""
    reference = reference_of(scene)
    if reference.chaotic:
        return math.nan
    errors = errors_of(run, reference.observation, reference.scales)
    told = [name for name, error in errors.of.items() if not math.isnan(error)]
    if errors.failure or not told:
        return math.inf
    return max(errors.of[name] + reference.error.get(name, 0.0) for name in told)

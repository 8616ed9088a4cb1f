"""The preparation of a scene before it runs: its number of modes, and its estimated error."""

from __future__ import annotations

import json
import math

from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.keys import MODES
from vibroimpact.orchestrator.study.convergence import Note
from vibroimpact.orchestrator.study.errors import errors_of
from vibroimpact.orchestrator.study.observation import Observation
from vibroimpact.orchestrator.study.references import observed, reference_of
from vibroimpact.orchestrator.study.swept_modes import SweepPlaces, modes_of_sweep

MOST_NAMED = 3
"""Most points that a note names where no number of modes meets the tolerance; the dataset has all of them."""


def prepared_scene(scene: Scene, note: Note = lambda text: None) -> Scene:
    """Return a scene that is ready to run, with its number of modes and its estimated error.

    A scene without `execution.tolerance` stays as it is. With a tolerance, `modes = "auto"` becomes the fewest modes
    that meet the tolerance at points of the sweep (`swept_modes.modes_of_sweep`). The estimated error adds two parts.
    The error of the number of modes counts where that number was found here. The error of the solution
    (`references.reference_of`) is estimated at the ends and in the middle of the sweep. The result depends only on the
    scene, on every machine: a resumed campaign has the modes with which it began.

    Parameters
    ----------
    scene : Scene
    note : callable
        Receives the results, a line at a time.

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
    places = SweepPlaces(scene)
    points = [places.scene_at(place) for place in places.ends()]
    ran = [observed(point) for point in points]
    unfinished = [run.failure for run in ran if run.failure]
    if unfinished:
        note(f"no error is estimated: {unfinished[0]}")
        of = f"nothing: {unfinished[0]}"
        found = {**scene.found, "tolerance": tolerance, "estimated_error": math.nan, "estimated_error_of": of}
        return scene.model_copy(update={"found": found})
    errors = [_error_of_solution(point, run) for point, run in zip(points, ran, strict=True)]
    known = [error for error in errors if not math.isnan(error)]
    solution = max(known, default=math.nan)
    error = solution if truncation is None else float(truncation)
    if truncation is not None and not math.isnan(solution):
        error += solution
    found = {
        **scene.found,
        "tolerance": tolerance,
        "estimated_error": error,
        "estimated_error_of": _estimated_parts(
            len(points), int(scene.found.get("modes_checked_points", 0)), len(known)
        ),
    }
    if math.isnan(error):
        note("the motion is chaotic: no error of single impacts is estimated")
    elif error > tolerance:
        note(f"estimated error {error:.1e}, above execution.tolerance = {tolerance:g}")
    return scene.model_copy(update={"found": found})


def with_found_modes(scene: Scene, note: Note = lambda text: None) -> Scene:
    """Return a scene with `modes = "auto"` replaced by the fewest modes that meet its tolerance; others unchanged.

    Raises
    ------
    SceneError
        No number of modes meets the tolerance.
    """
    tolerance = scene.execution.tolerance
    if tolerance is None or not _finds_modes(scene):
        return scene
    looked_at = modes_of_sweep(scene, tolerance, note)
    one = looked_at.convergence
    where = f", at {looked_at.points} points of the sweep" if looked_at.points > 1 else ""
    chaos = "; the motion is chaotic, its statistics are compared" if one.by == "statistics" else ""
    note(
        f"modes = {one.modes}: estimated error {one.error:.1e}, checked with {one.checked_with}{where}{chaos}"
    )
    found: dict[str, str | float | int] = {
        "tolerance": tolerance,
        "modes_found": one.modes,
        "modes_checked_with": one.checked_with,
        "modes_checked_points": looked_at.points,
        "modes_compared_by": one.by,
        "modes_tried": json.dumps({str(n): round_off(off) for n, off in sorted(one.errors.items())}),
        "estimated_error_of_modes": one.error,
    }
    if looked_at.unmet:
        found["modes_unmet_points"] = "; ".join(looked_at.unmet)
        few, more = looked_at.unmet[:MOST_NAMED], len(looked_at.unmet) - MOST_NAMED
        note(
            f"no number of modes meets execution.tolerance = {tolerance:g} at {'; '.join(few)}"
            f"{f'; and {more} more' if more > 0 else ''}"
        )
    return scene.with_values({MODES: one.modes}).model_copy(update={"found": found})


def round_off(error: float) -> float | str:
    """Return an error with three digits as a value for JSON.

    >>> round_off(0.00123456), round_off(float("inf"))
    (0.00123, 'another motion')
    """
    return float(f"{error:.3g}") if math.isfinite(error) else "another motion"


def _estimated_parts(points: int, of_modes: int, regular: int) -> str:
    """Return the parts of the estimated error, in words.

    `points` is the number of points of the sweep with a solution, `regular` the number whose motion is not chaotic.
    `of_modes` is the number of points at which numbers of modes were compared; 0 where there was no comparison.
    """
    parts = [
        *([f"the number of modes{_largest(of_modes)}"] if of_modes else []),
        *([f"the solution of the motion{_largest(points)}"] if regular else []),
    ]
    chaotic = points - regular
    left_out = (
        ""
        if not chaotic or not regular
        else f"; of {chaotic}, which are chaotic, that of the solution means nothing"
    )
    return (" and ".join(parts) or f"nothing: the motion is chaotic{_largest(points)}") + left_out


def _largest(points: int) -> str:
    return "" if points == 1 else f", the largest of {points} points of the sweep"


def _finds_modes(scene: Scene) -> bool:
    return scene.is_one_body and scene.body.finds_modes


def _error_of_solution(scene: Scene, run: Observation) -> float:
    """Return the estimated error of the solution of a scene's motion; NaN where the motion is chaotic."""
    reference = reference_of(scene)
    if reference.chaotic:
        return math.nan
    errors = errors_of(run, reference.observation, reference.scales)
    known = [name for name, error in errors.of.items() if not math.isnan(error)]
    if errors.failure or not known:
        return math.inf
    return max(errors.of[name] + reference.error.get(name, 0.0) for name in known)

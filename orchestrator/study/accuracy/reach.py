"""The time of a scene that all ways can simulate within a budget: the transient passed once, the recording halved."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import vibroimpact.orchestrator.study.clock as clock
from vibroimpact.fmus.errors import ComponentError, SceneError, UsageError
from vibroimpact.fmus.messages import Argument, message
from vibroimpact.orchestrator.run.parameters import free_state
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.body_models import StructureBody
from vibroimpact.orchestrator.study.accuracy.budget import Budget
from vibroimpact.orchestrator.study.errors import FIRST_IMPACTS, errors_of
from vibroimpact.orchestrator.study.observation import LATE, Observation
from vibroimpact.orchestrator.study.references import best_of, scales_of
from vibroimpact.orchestrator.study.ways.driven import DrivenTrial
from vibroimpact.orchestrator.study.ways.span import halved
from vibroimpact.orchestrator.study.ways.way import Trial, opened_trial

TRANSIENT_SHARE = 0.25
"""Largest share of the budget for passing the transient."""
RECORDING_SHARE, PERIOD_SHARE = 1.0 / 80.0, 1.0 / 12.0
"""Largest share of the budget for a fused run of the recording; and of a single period, which is not halved."""
GENERAL_SHARE = 1.0 / 250.0
"""Largest share of the budget for a run of a general scene: the reference and its parts cost 60 to 100."""
GUARDED_SHARE, LEAST_GUARDED = 0.04, 0.25
"""Largest share of the budget, in wall time, for a run in another process; and the least wall time of such a run, s."""
SAME_START = 1e-6
"""Relative distance between the motion after a transient and the motion started from its last state, up to which
both are the same motion."""
MOST_HALVINGS = 40


@dataclass(frozen=True, slots=True)
class Passed:
    """A scene whose transient was passed once."""

    scene: Scene
    """Scene that starts with the state at the end of the transient; the given scene where none was passed."""
    whole: Scene
    """The given scene, with its transient."""
    observation: Observation | None = None
    """Observation of a fused run of `whole`; None where no transient was passed."""
    remark: str = ""
    """Reason why each way passes the transient itself; empty where none does."""

    @property
    def is_kept(self) -> bool:
        """Whether the ways begin after the transient."""
        return self.observation is not None


def within_reach(scene: Scene, budget: Budget) -> Scene:
    """Return a scene that records all of the time, a half, a quarter, ..., so that a run fits a share of a budget.

    The scene has no sweep. UsageError: one forcing period takes too much; the message has the least budget.
    """
    share = RECORDING_SHARE if scene.is_one_body else GENERAL_SHARE
    for _ in range(MOST_HALVINGS):
        found = observed_within(_without_transient(scene), share * budget.seconds)
        if found.failure != LATE:
            return scene
        shorter = halved(scene)
        if shorter is None:
            break
        scene = shorter
    found = observed_within(_without_transient(scene), PERIOD_SHARE * budget.seconds)
    if found.failure == LATE:
        _refuse(budget, PERIOD_SHARE, found, "one forcing period")
    return scene


def transient_passed(scene: Scene, budget: Budget) -> Passed:
    """Return a scene of the short form with its transient passed by the fused way, and the state at its end as start.

    The scene has no sweep. UsageError: the transient takes too much of the budget; the message has the least budget.
    """
    if not scene.is_lone_body or not _has_transient(scene):
        return Passed(scene, scene)
    trial = DrivenTrial(best_of(scene))
    try:
        with clock.CLOCK.limited(TRANSIENT_SHARE * budget.seconds):
            found = trial.run()
        if found.failure == LATE:
            _refuse(budget, TRANSIENT_SHARE, found, "the transient")
        kept = _started_with(scene, trial.start)
        if kept is not None and not found.failure and _is_continued(kept, scene, found):
            return Passed(kept, scene, found)
    finally:
        trial.close()
    why = "the motion from the state at its end is not the one after it"
    if isinstance(scene.body, StructureBody):
        why = "the state at its end is one of modes, which the tables of its bodies do not have"
    return Passed(scene, scene, remark=f"one transient for all ways: {why}, so each way passes it")


def observed_within(scene: Scene, seconds: float) -> Observation:
    """Return the observation of a run, fused if possible, that is given up after `seconds` of processor time."""
    trial: Trial = (
        DrivenTrial(best_of(scene)) if scene.is_lone_body else opened_trial(limited_elsewhere(scene, seconds))
    )
    try:
        with clock.CLOCK.limited(seconds):
            return trial.run()
    finally:
        trial.close()


def limited_elsewhere(scene: Scene, seconds: float) -> Scene:
    """Return a scene whose guarded runs are given up after `seconds` of wall time, at least `LEAST_GUARDED`."""
    is_guarded = scene.execution.guard
    if not is_guarded:
        return scene
    own, most = scene.execution.deadline, max(LEAST_GUARDED, seconds)
    return scene.with_values({"execution.deadline": most if own is None else min(own, most)})


def _has_transient(scene: Scene) -> bool:
    return bool(scene.record.transient_periods if scene.period is not None else scene.record.transient_time)


def _without_transient(scene: Scene) -> Scene:
    if not scene.is_lone_body or not _has_transient(scene):
        return scene
    return scene.with_values(_no_transient(scene))


def _no_transient(scene: Scene) -> Mapping[str, Any]:
    return {"record.transient_periods": 0} if scene.period is not None else {"record.transient_time": 0.0}


def _started_with(scene: Scene, state: tuple[float, ...]) -> Scene | None:
    """Return a scene that starts with a state at forcing phase 0; None where such a scene is invalid."""
    if isinstance(scene.body, StructureBody):
        return None  # its state is of modes, which the tables of its bodies do not have
    changes: dict[str, Any] = dict(_no_transient(scene))
    free = free_state(scene, state)
    half = len(free) // 2
    start = (list(free[:half]), list(free[half:])) if scene.body.IS_STRUCTURE else free
    changes |= {
        f"body.{name}_start": value for name, value in zip(("displacement", "velocity"), start, strict=True)
    }
    if scene.period is not None:
        changes["forcing.phase"] = 0.0
    try:
        return scene.with_values(changes)
    except SceneError:
        return None


def _is_continued(kept: Scene, whole: Scene, found: Observation) -> bool:
    """Return whether the scene `kept`, started from a state, continues the whole motion after that state."""
    best, before = DrivenTrial(best_of(kept)), scales_of(whole).window[0]
    try:
        expected = best.run()
    except ComponentError:
        return False
    finally:
        best.close()
    impacts = found.impacts - (before, 0.0, 0.0)
    moved, scales = replace(found, impacts=impacts), scales_of(kept)
    first = errors_of(expected, moved, scales, impacts=FIRST_IMPACTS)
    compared = first if len(impacts) else errors_of(expected, moved, scales)
    worst = compared.worst()
    return not compared.failure and not (math.isfinite(worst) and worst > SAME_START)


def _refuse(budget: Budget, share: float, found: Observation, what: str) -> None:
    least = budget.seconds / found.reached if found.reached > 0.0 else math.inf
    needed = (
        f"about {_rounded_up(least):g} s or more"
        if math.isfinite(least)
        else f"far more than {budget.seconds:g} s"
    )
    raise UsageError(
        message(
            Argument("budget"),
            f": expected {needed} of processor time, got {budget.seconds:g}: {what} takes more than "
            f"{share * budget.seconds:.2g} s by the fused way, of all ways the cheapest.",
        )
    )


def _rounded_up(seconds: float) -> float:
    """Return a time rounded up to two digits, s."""
    unit = 10.0 ** (math.floor(math.log10(seconds)) - 1)
    return math.ceil(seconds / unit) * unit

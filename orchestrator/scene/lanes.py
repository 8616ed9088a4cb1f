"""Which scenes go by lanes: their points run many at once (`fmus.core.run_lanes`).

`execution.how = "auto"` lets the points of a sweep run so where its bodies have few modes between
restitution stops and each point is a run by itself or continues the one before. A point that chatters, rests or is rare
in another way is left by the lanes: it runs by the scalar engine, from its start, as in a fused run.
"""

from __future__ import annotations

from vibroimpact.fmus.core import lanes as core
from vibroimpact.orchestrator.scene.body_models import BeamBody, ChainBody, OscillatorBody
from vibroimpact.orchestrator.scene.called_effects import called_by_numbers
from vibroimpact.orchestrator.scene.keys import MODES
from vibroimpact.orchestrator.scene.models import AMPLITUDE, RestitutionStop
from vibroimpact.orchestrator.scene.scene import Scene


def goes_by_lanes(scene: Scene) -> bool:
    """Whether the points of a scene run many at once: it depends on what it sweeps, not on the number of points."""
    execution = scene.execution
    return (
        execution.how == "auto"
        and bool(scene.sweep)
        and not execution.guard
        # the clock of a point that shares its lanes is not its own
        and execution.deadline is None
        and may_go_by_lanes(scene)
        and _has_many_branches(scene)
    )


def may_go_by_lanes(scene: Scene) -> bool:
    """Whether lanes can run the points of a scene: its body flies as few modes between few rigid stops."""
    if not scene.is_lone_body or scene.is_measured or scene.exciter is not None:
        return False
    if scene.record.time_series is not None or AMPLITUDE in called_by_numbers(scene):
        return False
    if len(scene.stops) > core.MOST_CONTACTS or not all(isinstance(s, RestitutionStop) for s in scene.stops):
        return False
    body = scene.body
    if isinstance(body, OscillatorBody):
        return True
    if body.modes == "auto" or any(axis.key == MODES for axis in scene.sweep):
        return False
    if isinstance(body, ChainBody):
        return (body.modes or body.size) <= core.MOST_MODES
    return body.size <= core.MOST_MODES and body.impact_projection == "variational" and not body.residual


def _has_many_branches(scene: Scene) -> bool:
    """Whether points can run beside each other: along one path alone each waits for the one before.

    A chain hands on the state of its masses, which its modes have only to rounding: its points go one by one.
    """
    chained = [axis for axis in scene.sweep if axis.continuation]
    if not chained:
        return True
    together = [axis for axis in scene.sweep if axis.together and axis.together == chained[0].together]
    return len(scene.sweep) > max(len(together), 1) and isinstance(scene.body, OscillatorBody | BeamBody)

"""The part of a scene's time that a way simulates: all of it, or the first half, quarter, ..."""

from __future__ import annotations

import math
from collections.abc import Mapping

from vibroimpact.orchestrator.run.window import recorded_window
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.study.ways.replays import first_part_of_replay


def window_of(scene: Scene, floats: Mapping[str, float], part: float) -> tuple[float, float]:
    """Return start and end of the recording of the first part of a scene of the short form, s.

    The part, 0 < part <= 1, scales all of the simulated time: both come earlier. `floats` are the real parameters of
    the body.
    """
    begin, end = recorded_window(scene, floats)
    return part * begin, part * end


def first_part(scene: Scene, part: float) -> Scene:
    """Return a general scene or a replay that ends after the first part of its time, 0 < part <= 1.

    The scene has no sweep.
    """
    if part == 1.0:
        return scene
    if scene.replay is not None:
        return first_part_of_replay(scene, part)
    record = scene.record
    return scene.with_values(
        {
            "record.transient_time": part * record.transient_time,
            "record.recorded_time": part * record.recorded_time,
        }
    )


def first_periods(scene: Scene, part: float) -> Scene:
    """Return a scene of the short form that records only a part, in whole periods, at least 1, where it is forced."""
    if part == 1.0:
        return scene
    if scene.period is None:
        return scene.with_values({"record.recorded_time": part * scene.record.recorded_time})
    periods = max(1, math.floor(part * scene.record.recorded_periods))
    return scene.with_values({"record.recorded_periods": periods})


def halved(scene: Scene) -> Scene | None:
    """Return a scene that records half as long; None where it records one period.

    A general scene and a replay are halved from their start.
    """
    if not scene.is_lone_body:
        return first_part(scene, 0.5)
    if scene.period is None:
        return scene.with_values({"record.recorded_time": 0.5 * scene.record.recorded_time})
    periods = scene.record.recorded_periods // 2
    return scene.with_values({"record.recorded_periods": periods}) if periods else None

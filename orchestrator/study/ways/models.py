"""Other models of the same system, not other ways to solve it: other contact laws, fewer or more modes, ..."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

from vibroimpact.orchestrator.run.parameters import body_points
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.body_models import StructureBody
from vibroimpact.orchestrator.scene.laws import any_rigid
from vibroimpact.orchestrator.scene.models import Stop
from vibroimpact.orchestrator.study.ways.equal_restitution import (
    LEAST_RESTITUTION,
    contact_time,
    laws_of_equal_restitution,
    restitution_at,
)
from vibroimpact.orchestrator.study.ways.way import Way, can_have, time_scale, way_by_scene

CONTACT_TIMES = (1e-1, 1e-2, 1e-3)
"""Contact times of compliant stops that stand for a rigid stop, over the period."""
MOST_MODES = 64
LEAST_TRIED_MODES = 8
"""Least upper bound of the tried numbers of modes of a beam; with more than 2 modes the bound is 4 times as many."""
MODES_TRIED = (1, 2, 4, 8, 16, 32, MOST_MODES)


def other_models(scene: Scene, speed: float) -> list[Way]:
    """Return other models of a scene of the short form without a sweep.

    `speed` is the typical speed of its impacts, m/s; NaN without impacts.
    """
    body, ways = scene.body, []
    if scene.stops:
        ways += other_modes(scene)
    if not body.HAS_MASSES and any_rigid(scene.stops):
        other = "collocation" if body.projection == "variational" else "variational"
        change = {"body.impact_projection": other}
        ways.append(way_by_scene(f"{other} projection", "", math.nan, scene, change, model=True))
    if body.HAS_MASSES and scene.stops:
        ways += _equal_restitution(scene, speed)
    return ways


def other_modes(scene: Scene) -> list[Way]:
    """Return the ways with other numbers of modes: fewer for a chain, fewer and more for a beam.

    A beam with stops also has ways with residual vectors. The reference of all of them is the finest number of modes.
    A beam with rigid stops has none of these ways, since nothing converges there.
    """
    body = scene.body
    if body.HAS_MASSES:
        return _fewer_modes(scene) if body.size > 1 else []
    if any_rigid(scene.stops):
        return []
    most = max(LEAST_TRIED_MODES, 4 * body.size)
    counts = sorted({n for n in MODES_TRIED if n <= most} | {body.size})
    kinds = (False, True) if scene.stops else (False,)  # each residual vector belongs to a stop
    changes = [{"body.modes": n, "body.residual": residual} for residual in kinds for n in counts]
    able = [change for change in changes if can_have(scene, change)]
    if not able:
        return []
    finest = scene.with_values(able[-1])
    return [
        replace(
            way_by_scene(
                "residual vectors" if change["body.residual"] else "modes",
                *("modes", change["body.modes"]),
                scene,
                change,
                model=True,
            ),
            against=finest,
        )
        for change in able[:-1]
    ]


def _fewer_modes(scene: Scene) -> list[Way]:
    """Return the ways with fewer modes of a chain, whose reference has all modes."""
    changes = [{"body.modes": n} for n in MODES_TRIED if n < scene.body.size]
    whole = scene.with_values({"body.modes": scene.body.size})
    return [
        replace(
            way_by_scene("modes", "modes", change["body.modes"], scene, change, model=True), against=whole
        )
        for change in changes
        if can_have(scene, change)
    ]


def modes_reference(ways: Sequence[Way]) -> str:
    """Return the reference of other numbers of modes, in words; empty where there are no such ways."""
    finest = next((way.against.body for way in ways if way.against is not None), None)
    if finest is None:
        return ""
    if isinstance(finest, StructureBody):
        return f"{finest.size} modes of all bodies"
    if finest.HAS_MASSES:
        return f"all {finest.size} modes"
    what = ", residual vectors among them" if finest.has_residual_vectors else ""
    return f"{finest.size} modes{what}"


def _equal_restitution(scene: Scene, speed: float) -> Iterator[Way]:
    """Yield ways with stops of other laws, with the same coefficient of restitution."""
    stops: Sequence[Stop] = scene.stops
    masses = body_points(scene).contact_masses().tolist()
    if not speed > 0.0:
        speed = 1.0  # nothing hits the stops, so any speed will do
    found = [restitution_at(stop, mass, speed) for stop, mass in zip(stops, masses, strict=True)]
    if not all(LEAST_RESTITUTION <= one <= 1.0 for one in found):
        return
    own = [contact_time(stop, mass, speed) for stop, mass in zip(stops, masses, strict=True)]
    if any(own):
        tables = [
            _table(stop, law="restitution", restitution=r) for stop, r in zip(stops, found, strict=True)
        ]
        change = {"stop": tables}
        if can_have(scene, change):
            yield way_by_scene("rigid stops of equal restitution", "", math.nan, scene, change, model=True)
    scale = time_scale(scene)
    times = [part * scale for part in CONTACT_TIMES] if not any(own) else [max(own)]
    for duration in times:
        laws = [
            laws_of_equal_restitution(r, mass, speed, duration if time == 0.0 else time)
            for r, mass, time in zip(found, masses, own, strict=True)
        ]
        for name in dict.fromkeys(name for of in laws for name in of):
            if not all(name in of for of in laws) or all(
                of[name]["law"] == stop.law for of, stop in zip(laws, stops, strict=True)
            ):
                continue
            change = {"stop": [_table(stop, **of[name]) for stop, of in zip(stops, laws, strict=True)]}
            if can_have(scene, change):
                words = f"{name} stops of equal restitution"
                yield way_by_scene(words, "contact time", duration, scene, change, model=True)


def _table(stop: Stop, **law: Any) -> dict[str, Any]:
    place = {} if stop.mass is None else {"mass": stop.mass}
    return {"position": stop.position, "side": stop.side, **place, **law}

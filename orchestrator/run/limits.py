"""What lanes, orbits and ways of the studies cannot take: one table, and what a scene has of it.

`execution.how = "auto"` lets the points of a sweep run in lanes (`fmus.core.run_lanes`) where its bodies have few modes
between restitution stops and each point is a run by itself or continues the one before. A point that chatters, rests
or is rare in another way is left by the lanes: it runs by the scalar engine, from its start, as in a fused run.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

from vibroimpact.fmus.core import lanes as core
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.run.called_effects import called_by_numbers
from vibroimpact.orchestrator.run.parameters import body_points
from vibroimpact.orchestrator.scene.keys import MODES
from vibroimpact.orchestrator.scene.models import AMPLITUDE
from vibroimpact.orchestrator.scene.scene import Scene

MOST_SENSORS = 4
"""Places where the FMU of a beam shows its motion."""


@dataclass(frozen=True, slots=True)
class Limit:
    """Who cannot take something of a scene."""

    lanes: bool = False
    """Whether lanes leave the scene; of modes that are coupled, or none, they leave each point."""
    orbits: str = ""
    """What a search for orbits expects in its place."""
    pushed: str = ""
    """Why no force acts at its stops on a body that knows nothing of them."""
    thrown_back: str = ""
    """Why its state after an impact on a rigid stop does not follow from its modes or masses."""


_NONE = "0 where orbits are followed"
LIMITS = {
    "body": Limit(lanes=True, orbits="an oscillator, a chain or a beam whose orbits are followed"),
    "forcing": Limit(orbits="a harmonic force, which orbits are periodic with"),
    "stop": Limit(orbits="a restitution stop"),
    "law": Limit(lanes=True, orbits='"restitution": impacts without duration'),
    "yield_velocity": Limit(orbits=_NONE),
    "distance": Limit(lanes=True, orbits=_NONE),
    "reduced": Limit(thrown_back="a Chain with fewer modes than masses does not move one mass alone"),
    "projection": Limit(
        lanes=True,
        orbits='"variational" where orbits are followed',
        thrown_back="the impacts of a Beam with another projection than the variational one do not follow from its "
        "state",
    ),
    "places": Limit(
        thrown_back=f"a Beam shows its motion at {MOST_SENSORS} places, and its stops are at more"
    ),
    "coupled": Limit(orbits="damping that does not couple the modes where orbits are followed"),
    "spring": Limit(orbits="a spring where orbits are followed"),
    "loose": Limit(orbits="a chain tied to the ground"),
    "held": Limit(orbits="a point that moves"),
    "force": Limit(pushed="a Beam takes one force, where it is forced, and its stops are not all there"),
}


class Seen(NamedTuple):
    """Something of a scene that is in the table: its row, its key, and what the scene has."""

    row: str
    where: str
    got: str


def seen(scene: Scene) -> Iterator[Seen]:
    """Yield what the tables of a scene have that somebody cannot take."""
    if not scene.is_lone_body:
        yield Seen("body", "body", "a scene of components" if scene.replay is None else "a replay")
    if scene.period is None:
        yield Seen("forcing", "forcing", "none")
    if not scene.stops:
        yield Seen("stop", "stop", "none")
    for number, stop in enumerate(scene.stops, start=1):
        if stop.law != "restitution":
            yield Seen("law", f"stop[{number}].law", f'"{stop.law}"')
        elif stop.yield_velocity > 0.0:
            yield Seen("yield_velocity", f"stop[{number}].yield_velocity", f"{stop.yield_velocity:g}")
    if scene.falling_force:
        yield Seen("distance", "exciter.distance", "a force that falls with the distance")
    if not scene.is_one_body:
        return
    body = scene.body
    if not body.finds_modes and body.kept_modes < body.size:
        yield Seen("reduced", "body.modes", f"{body.kept_modes}")
    if body.projection != "variational":
        yield Seen("projection", "body.impact_projection", f'"{body.projection}"')
    if body.PLACE == "location" and len({body.place_of(stop) for stop in scene.stops}) > MOST_SENSORS:
        yield Seen("places", "stop", f"{len(scene.stops)}")


def _kept_from_lanes(scene: Scene) -> dict[str, bool]:
    """Return whether a scene of the short form has what lanes alone cannot take."""
    body = scene.body
    return {
        "measuring chain": scene.is_measured or scene.exciter is not None,
        "time series": scene.record.time_series is not None,
        "many contacts": len(scene.stops) > core.MOST_CONTACTS,
        "many modes": body.kept_modes > core.MOST_MODES,
        "numbers of modes": body.finds_modes or any(axis.key == MODES for axis in scene.sweep),
        "residual vectors": body.has_residual_vectors,
        AMPLITUDE: AMPLITUDE in called_by_numbers(scene),
    }


def seen_of_flaw(scene: Scene, flaw: str) -> Seen:
    """Return what keeps a scene's body from flying in modes: see `flaw` of `BodyPoints`."""
    if flaw == "coupled":
        got = "one that does. Dampings in proportion to the stiffnesses do not"
        return Seen("coupled", "body.dampings", got)
    loose = Seen("loose", "body.stiffnesses", "one that is loose")
    return loose if scene.body.IS_STRUCTURE else Seen("spring", "body.stiffness", "none")


def refuse_orbits(scene: Scene, found: Iterable[Seen]) -> None:
    """Raise UsageError with the first thing that a search for orbits cannot take."""
    for row, where, got in found:
        if LIMITS[row].orbits:
            raise UsageError(f"{scene.source}: {where}: expected {LIMITS[row].orbits}, got {got}.")


def why_not_pushed(scene: Scene) -> str:
    """Return why no force can act on a body where its stops are; empty where one can."""
    return "" if body_points(scene).is_pushed() else LIMITS["force"].pushed


def why_not_thrown_back(scene: Scene) -> str:
    """Return why the state of a body after an impact on a rigid stop cannot be told by its modes or masses alone."""
    return next((LIMITS[each.row].thrown_back for each in seen(scene) if LIMITS[each.row].thrown_back), "")


def may_go_by_lanes(scene: Scene) -> bool:
    """Whether lanes can run the points of a scene: its body flies as few modes between few rigid stops."""
    return not any(LIMITS[each.row].lanes for each in seen(scene)) and not any(
        _kept_from_lanes(scene).values()
    )


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


def _has_many_branches(scene: Scene) -> bool:
    """Whether points can run beside each other: along one path alone each waits for the one before.

    A chain hands on the state of its masses, which its modes have only to rounding: its points go one by one.
    """
    chained = [axis for axis in scene.sweep if axis.continuation]
    if not chained:
        return True
    together = [axis for axis in scene.sweep if axis.together and axis.together == chained[0].together]
    return len(scene.sweep) > max(len(together), 1) and scene.body.KEEPS_MODES

"""The limits of lanes, orbits and the studies' ways: one table, and the entries of the table that a scene has.

`execution.how = "auto"` lets the points of a sweep run in lanes (`fmus.core.run_lanes`). Its bodies then have few modes
between restitution stops, or one mode and a Kelvin-Voigt stop. Each point is independent or continues the point before.
Lanes leave out points that chatter, rest or are rare in another way. These points run by the scalar engine from their
start, as in a fused run.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple, cast

from vibroimpact.fmus.core import lanes as core
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.run.called_effects import called_by_numbers
from vibroimpact.orchestrator.run.forces import further_forces
from vibroimpact.orchestrator.run.parameters import body_points
from vibroimpact.orchestrator.run.record import OBSERVED
from vibroimpact.orchestrator.scene.body_models import StructureBody
from vibroimpact.orchestrator.scene.body_models.growing import GROWING_KEYS
from vibroimpact.orchestrator.scene.forcing_clock import signals_of
from vibroimpact.orchestrator.scene.forcing_models import Forcing, forces_in_words
from vibroimpact.orchestrator.scene.keys import MODES
from vibroimpact.orchestrator.scene.models import AMPLITUDE, StopTable
from vibroimpact.orchestrator.scene.scene import Scene

MOST_SENSORS = 4
"""Largest number of places where the FMU of a beam has outputs of its motion."""


@dataclass(frozen=True, slots=True)
class Limit:
    """The users that cannot take one feature of a scene."""

    lanes: bool = False
    """Whether lanes cannot run the scene at all."""
    orbits: str = ""
    """Feature that a search for orbits expects instead; empty where it takes this one."""
    pushed: str = ""
    """Reason why no force can act at the stops on a body without stops in its FMU."""
    thrown_back: str = ""
    """Reason why the state after an impact on a rigid stop does not follow from the modes or masses."""


LIMITS = {
    "body": Limit(
        lanes=True, orbits="an oscillator, a chain, a beam or several bodies whose orbits are followed"
    ),
    "drift": Limit(orbits="stops that stand still or move as sines, which orbits are periodic with"),
    "forcing": Limit(orbits="a harmonic force, which this study needs"),
    "signals": Limit(orbits="sines and constant forces, which orbits are periodic with"),
    "quasi-periodic": Limit(orbits="sines with a common period, which orbits are periodic with"),
    "stop": Limit(orbits="a restitution stop"),
    "motion": Limit(lanes=True),
    "law": Limit(orbits='"restitution": impacts without duration'),
    "placed": Limit(orbits='"restitution" or "kelvin_voigt" beside bodies that no spring ties to the ground'),
    "relaxing": Limit(orbits="0: a surface that relaxes at once"),
    "distance": Limit(lanes=True, orbits="0 where orbits are followed"),
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
    "dragged": Limit(
        orbits="no damping of bodies that no spring ties to the ground, whose place no spring brings back"
    ),
    "growing": Limit(lanes=True, orbits="springs and dashpots that are not negative beside a force"),
    "held": Limit(orbits="a point that moves"),
    "force": Limit(
        pushed="a body with one force takes it where it is forced, and its stops are not all there"
    ),
}


class Seen(NamedTuple):
    """A feature of a scene in the table of limits: its row, its key, and the scene's value."""

    row: str
    where: str
    got: str


def seen(scene: Scene) -> Iterator[Seen]:
    """Yield the features of a scene that have a row in the table of limits."""
    if not scene.is_lone_body:
        yield Seen("body", "body", "a scene of components" if scene.replay is None else "a replay")
    stops = [*zip(scene.stop_keys, scene.stops, strict=True)]
    for key, stop in stops:
        if isinstance(stop, StopTable) and stop.drifts:
            yield Seen("drift", key, "a velocity or a table of its motion")
    if signals_of(scene.forces):
        yield Seen("signals", "forcing", forces_in_words(scene.forces))
    if scene.period is None:
        yield Seen("forcing", "forcing", "none")
    if scene.clock is not None and not scene.clock.is_common:
        yield Seen("quasi-periodic", "forcing", "sines without one")
    if not stops:
        yield Seen("stop", "stop", "none")
    if scene.moving_stop:
        yield Seen("motion", scene.moving_stop, "a stop that moves")
    for key, stop in stops:
        if stop.law != "restitution":
            yield Seen("law", f"{key}.law", f'"{stop.law}"')
        if (relaxes := getattr(stop, "relaxation_time", 0.0)) > 0.0:
            yield Seen("relaxing", f"{key}.relaxation_time", f"{relaxes:g}")
    if scene.falling_force:
        yield Seen("distance", "exciter.distance", "a force that falls with the distance")
    if not scene.is_one_body:
        return
    body = scene.body
    if isinstance(body, StructureBody) and _may_grow(scene, body):
        yield Seen("growing", "body", "a negative one")
    if not body.finds_modes and body.kept_modes < body.size:
        yield Seen("reduced", "body.modes", f"{body.kept_modes}")
    if body.projection != "variational":
        yield Seen("projection", "body.impact_projection", f'"{body.projection}"')
    if body.PLACE == "location" and len({body.place_of(stop) for stop in scene.stops}) > MOST_SENSORS:
        yield Seen("places", "stop", f"{len(scene.stops)}")


def _may_grow(scene: Scene, body: StructureBody) -> bool:
    """Return whether a spring or a dashpot is negative at a point of the sweep."""
    names = ((axis.key.rpartition(".")[2].partition("[")[0], axis.lowest) for axis in scene.sweep)
    owned = any(name in GROWING_KEYS and lowest < 0.0 for name, lowest in names)
    return owned or body.has_negative


def _kept_from_lanes(scene: Scene) -> dict[str, bool]:
    """Return, by feature, whether a scene of the short form has a feature that only lanes cannot take."""
    body = scene.body
    return {
        "measuring chain": scene.is_measured or scene.exciter is not None,
        "laws": any(stop.law != "restitution" for stop in scene.stops) and not _yields_in_lanes(scene),
        "time series": scene.record.time_series is not None and not _samples_in_lanes(scene),
        "further points": len(scene.record.observed) > 1,
        "forces": scene.has_several_forces and not _forces_in_lanes(scene),
        "many contacts": len(scene.stops) > core.MOST_CONTACTS,
        "many modes": body.kept_modes > core.MOST_MODES,
        "numbers of modes": body.finds_modes or any(axis.key == MODES for axis in scene.sweep),
        "residual vectors": body.has_residual_vectors,
        AMPLITUDE: AMPLITUDE in called_by_numbers(scene),
    }


def _samples_in_lanes(scene: Scene) -> bool:
    """Return whether lanes can sample the time series: the motion of the observed point and at the stops."""
    rigid = all(stop.law == "restitution" for stop in scene.stops)
    return all(
        name in OBSERVED
        or name.startswith(("contact_displacement[", "contact_velocity["))
        or (rigid and name.startswith("contact_force"))
        for name in scene.sampled
    )


def _forces_in_lanes(scene: Scene) -> bool:
    """Return whether lanes can take several forces: sines and constant loads, of rigid stops where sines are several.

    Each sine besides the clock takes the place of two modes of a body of several modes.
    """
    further = [force for force in further_forces(scene) if isinstance(force, Forcing)]
    body = cast(StructureBody, scene.body)
    shaped = any(body.is_shaping(axis.key) for axis in scene.sweep)
    modes = body.size * (2 if shaped or body.is_coupled else 1)
    return (
        not signals_of(scene.forces)
        and len(further) < core.MOST_SINES
        and (body.size == 1 or modes + 2 * len(further) <= 2 * core.MOST_MODES)
        and (not further or all(stop.law == "restitution" for stop in scene.stops))
    )


def contact_of(name: str) -> int | None:
    """Return the contact (1-based) of a sampled variable; None for a variable of the observed point.

    Examples
    --------
    >>> contact_of("contact_velocity[2]"), contact_of("velocity")
    (2, None)
    """
    return int(name.partition("[")[2][:-1]) if "[" in name else None


def _yields_in_lanes(scene: Scene) -> bool:
    """Return whether lanes can follow stops that yield: Kelvin-Voigt stops of one mode; surfaces relax at once."""
    stops = scene.stops
    relaxes = any(axis.key.endswith(".relaxation_time") for axis in scene.sweep) or any(
        getattr(stop, "relaxation_time", 0.0) > 0.0 for stop in stops
    )
    return (
        scene.body.kept_modes == 1
        and all(stop.law in ("restitution", "kelvin_voigt") for stop in stops)
        and len({stop.side for stop in stops}) == len(stops)
        and not relaxes
    )


def seen_of_drag(scene: Scene) -> Seen:
    """Return the feature that keeps orbits from a scene's body, whose mode without a spring has damping."""
    return Seen(
        "dragged", "body" if isinstance(scene.body, StructureBody) else "body.damping", "a dashpot on one"
    )


OF_OWN_PERIOD = frozenset({"forcing", "growing"})
"""Features of bodies without a force whose orbits set their own period."""


def refuse_orbits(scene: Scene, found: Iterable[Seen], taken: Collection[str] = ()) -> None:
    """Raise UsageError unless a search for orbits can take all features of a scene, or they are among those `taken`."""
    for row, where, got in found:
        if LIMITS[row].orbits and row not in taken:
            raise UsageError(f"{scene.source}: {where}: expected {LIMITS[row].orbits}, got {got}.")


def why_not_pushed(scene: Scene) -> str:
    """Return the reason why no force can act on a body at its stops; empty where a force can act."""
    return "" if body_points(scene).is_pushed() else LIMITS["force"].pushed


def why_not_thrown_back(scene: Scene) -> str:
    """Return the reason why the state after an impact on a rigid stop does not follow from the modes or masses."""
    return next((LIMITS[each.row].thrown_back for each in seen(scene) if LIMITS[each.row].thrown_back), "")


def may_go_by_lanes(scene: Scene) -> bool:
    """Return whether lanes can run the points of a scene: its body flies as few modes between few rigid stops."""
    return not any(LIMITS[each.row].lanes for each in seen(scene)) and not any(
        _kept_from_lanes(scene).values()
    )


def goes_by_lanes(scene: Scene) -> bool:
    """Return whether the points of a scene run in lanes, which does not depend on the number of points."""
    execution = scene.execution
    return (
        execution.how == "auto"
        and bool(scene.sweep)
        and not execution.guard
        # points that share lanes have no clock of their own
        and execution.deadline is None
        and may_go_by_lanes(scene)
        and _has_many_branches(scene)
    )


def _has_many_branches(scene: Scene) -> bool:
    """Return whether points can run side by side; along a single path each point waits for the point before.

    The points of a chain run one by one: it hands on the state of its masses, which modes give only to rounding.
    """
    chained = [axis for axis in scene.sweep if axis.continuation]
    if not chained:
        return True
    together = [axis for axis in scene.sweep if axis.together and axis.together == chained[0].together]
    return len(scene.sweep) > max(len(together), 1) and scene.body.KEEPS_MODES

"""The first orbits of a scene's branches."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from vibroimpact.analysis.orbits import OrbitError, PeriodicOrbit
from vibroimpact.analysis.orbits.following import BodyAt, FollowSettings
from vibroimpact.analysis.orbits.search import STARTS, each_orbit, orbits_of
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.orbits.ends_of_runs import RunEnd, ends_of_runs
from vibroimpact.orchestrator.orbits.find import find_orbits
from vibroimpact.orchestrator.orbits.seeds import Seed
from vibroimpact.orchestrator.scene import Scene

MOST_BEGUN_IMPACTS = 16
"""Impacts of an orbit up to which branches begin at ends of runs and at special points, unless an orbit is given."""
SEEDS = 25
"""Values of the parameter at which first orbits are searched."""


def first_orbits(
    body_at: BodyAt,
    scene: Scene,
    parameter: str,
    settings: FollowSettings,
    impacts: int | None,
    periods: int,
    seed: Seed | None,
    ends: list[RunEnd],
    starts: int = STARTS,
    looking: Callable[[float], None] = lambda value: None,
) -> Iterator[tuple[float, PeriodicOrbit]]:
    """Yield values of the parameter and a physical orbit at each; several may lie on one branch.

    The parameter is a key of the scene. A seed belongs to the scene's own value of it. The settings have its range. p
    and q are `impacts` and `periods`. Without them and a seed, orbits are those of one impact, and those on which runs
    end; `ends` takes the ends of these runs. The impacts of a seed, each a phase and a stop, are near those of the only
    orbit. `looking` is called with each value at which runs are made or many starts are tried.

    UsageError: the seed does not fit the scene or the range. OrbitError: there is no physical orbit near the seed.
    """
    if seed is not None:
        yield _of_seed(scene, parameter, settings, seed, impacts, periods)
    elif impacts in (None, 1):
        yield from _of_one_impact(body_at, settings, periods)
        if impacts is None and periods == 1:
            yield from _of_runs(scene, parameter, settings, ends, looking)
    else:
        yield from _of_many_impacts(body_at, scene, parameter, settings, impacts, periods, starts, looking)


def seed_values(settings: FollowSettings) -> list[float]:
    """Return the values of the parameter at which orbits are searched."""
    return [float(each) for each in np.linspace(settings.lowest, settings.highest, SEEDS + 2)[1:-1]]


def _of_one_impact(
    body_at: BodyAt, settings: FollowSettings, periods: int
) -> Iterator[tuple[float, PeriodicOrbit]]:
    for value in seed_values(settings):
        try:
            found = list(each_orbit(body_at(value), 1, periods))
        except OrbitError:
            continue  # a resonance at this very value
        yield from ((value, orbit) for orbit in found)


def _of_runs(
    scene: Scene,
    parameter: str,
    settings: FollowSettings,
    ends: list[RunEnd],
    looking: Callable[[float], None],
) -> Iterator[tuple[float, PeriodicOrbit]]:
    """Yield the orbits on which runs end, after all runs, so that a run goes on where the last one ended."""
    ends.extend(ends_of_runs(scene, parameter, seed_values(settings), looking))
    orbits = ((each.value, each.orbit) for each in ends if each.orbit is not None)
    yield from (each for each in orbits if each[1].phases.size <= MOST_BEGUN_IMPACTS)


def _of_many_impacts(
    body_at: BodyAt,
    scene: Scene,
    parameter: str,
    settings: FollowSettings,
    impacts: int,
    periods: int,
    starts: int,
    looking: Callable[[float], None],
) -> Iterator[tuple[float, PeriodicOrbit]]:
    """Yield orbits at values of the range, first at the scene's own: a branch may lie between the others."""
    own = float(scene.value(parameter))
    inside = [own] if settings.lowest <= own <= settings.highest else []
    for value in [*inside, *seed_values(settings)]:
        looking(value)
        try:
            body = body_at(value)
        except OrbitError:
            continue  # the scene has no body there
        yield from ((value, orbit) for orbit in orbits_of(body, impacts, periods, starts=starts))


def _of_seed(
    scene: Scene, parameter: str, settings: FollowSettings, seed: Seed, impacts: int | None, periods: int
) -> tuple[float, PeriodicOrbit]:
    value = float(scene.value(parameter))
    if not settings.lowest <= value <= settings.highest:
        raise UsageError(
            f"--from, --to: expected a range around {parameter} = {value:g} of the scene, to which the seed belongs, "
            f"got {settings.lowest:g} to {settings.highest:g}."
        )
    (orbit,) = find_orbits(scene, impacts, periods, seed=seed)
    if not orbit.is_physical:
        beyond, _, contact = orbit.highest
        raise OrbitError(
            f"follow: expected a physical orbit near to the seed, got a {orbit.name} that passes through stop "
            f"{contact + 1} by {beyond:.3g}. Try another seed."
        )
    return value, orbit

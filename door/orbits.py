"""Orbits, branches, maps, basins and control: thin over the functions that the commands stand on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import xarray as xr

from vibroimpact.analysis.orbits.feedback import Law
from vibroimpact.analysis.orbits.found import FoundOrbits
from vibroimpact.fmus.errors import UsageError
from vibroimpact.given import PathLike, SceneLike, given_result, given_scene
from vibroimpact.orchestrator.orbits.basins import POINTS, BasinsOfScene, Plane, Span
from vibroimpact.orchestrator.orbits.control import Controlled
from vibroimpact.orchestrator.orbits.control_plan import ControlSettings, control_plan
from vibroimpact.orchestrator.orbits.find import find_orbits as orbits_of_scene
from vibroimpact.orchestrator.orbits.follow import Following
from vibroimpact.orchestrator.orbits.maps import MapOfScene, settings_of
from vibroimpact.orchestrator.orbits.transients import Transients
from vibroimpact.returned import of_study, runs_of_study


def find_orbits(
    scene: SceneLike,
    impacts: int | None = None,
    periods: int | None = None,
    *,
    seed: Sequence[tuple[float, int]] | None = None,
    penetrating: bool = False,
) -> FoundOrbits:
    """Find periodic orbits of a scene, stable and unstable ones.

    Parameters
    ----------
    scene : Scene, path or mapping
        An oscillator, a chain or a beam on restitution stops under a harmonic force; its sweep is left out.
    impacts, periods : int, optional
        p and q of P(p,q). Without them, all orbits P(1,1), and the orbit that a long run ends on.
    seed : sequence of (phase, stop), optional
        Forcing phases, rad, of impacts near to those of one orbit, and their stops, from 1: that orbit alone.
    penetrating : bool
        Whether orbits that pass through a stop between impacts are returned as well.

    Returns
    -------
    list of PeriodicOrbit
        With `phases` (rad), `velocities` (m/s), `multipliers`, `is_stable`, `highest` maximum between impacts. `draw`
        draws the list, and its `dataset` has each physical orbit as a run.

    Raises
    ------
    UsageError
        Orbits of the scene are not followed.
    OrbitError
        There is no orbit near to the seed.

    Examples
    --------
    >>> body = {"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.05}
    >>> stop, force = {"position": 1.0, "restitution": 0.7}, {"amplitude": 0.5, "angular_frequency": 1.4}
    >>> record = {"transient_periods": 0, "recorded_periods": 1}
    >>> for orbit in find_orbits({"body": body, "forcing": force, "stop": [stop], "record": record}, 1):
    ...     print(orbit.name, orbit.velocities.round(6), orbit.is_stable)
    P(1,1) [1.884299] True
    P(1,1) [0.787422] False
    """
    return orbits_of_scene(
        given_scene(scene, for_orbits=True), impacts, periods, seed=seed, penetrating=penetrating
    )


def follow(
    scene: SceneLike,
    parameter: str,
    start: float,
    stop: float,
    path: PathLike | None = None,
    *,
    impacts: int | None = None,
    periods: int = 1,
    seed: Sequence[tuple[float, int]] | None = None,
    doublings: int = 1,
    step: float = 0.01,
    second: str | None = None,
    second_range: tuple[float, float] | None = None,
) -> xr.Dataset:
    """Follow periodic orbits of a scene over one of its numbers, through folds and period doublings.

    Parameters
    ----------
    scene : Scene, path or mapping
        An oscillator, a chain or a beam on restitution stops under a harmonic force; its sweep is left out.
    parameter : str
        Key of a number, such as `forcing.angular_frequency`.
    start, stop : float
        Its range.
    path : path, optional
        The dataset to write as well (.nc).
    impacts, periods : int, optional
        p and q of the orbits to begin with, which are looked for along the range; P(1,1).
    seed : sequence of (phase, stop), optional
        Forcing phases, rad, of impacts near to those of one orbit of the scene as it is, and their stops, from 1: that
        orbit is followed both ways.
    doublings : int
        How often branches of twice the period are followed on.
    step : float
        Largest step along a branch; the range of the parameter counts 1, a radian of all phases 1.
    second : str, optional
        Another number: folds, period doublings and grazes are followed over both.
    second_range : tuple of float, optional
        Its range.

    Returns
    -------
    xarray.Dataset
        Each orbit is a run, with `orbit_branch`, `orbit_stable`, `orbit_special` and its largest multiplier; with
        `second`, each is an orbit at a bifurcation, where there are any. The attributes `curves` and `not_looked_for`
        say on which branch each curve was found, and what was not looked for.

    Raises
    ------
    UsageError
        Orbits of the scene are not followed, or a parameter is no number of it.
    OrbitError
        There is no orbit to begin with.

    Examples
    --------
    >>> follow("scene.toml", "forcing.angular_frequency", 0.6, 1.6)    # doctest: +SKIP
    """
    chosen = given_scene(scene, for_orbits=True)
    written = given_result(path, [scene, chosen])
    alone = chosen.unswept(varied=[parameter])
    if (second is None) != (second_range is None):
        raise UsageError("follow: second: expected a key and its range together, got one of them.")
    study = Following(
        *(alone, parameter, start, stop, impacts, periods, seed),
        doublings=doublings,
        step=step,
        second=second,
        second_range=second_range,
    )
    return runs_of_study(study, written)


def maps(scene: SceneLike | None = None, kind: str = "impact", **options: Any) -> xr.Dataset:
    """Return a map of a scene as points to be drawn.

    Parameters
    ----------
    scene : Scene, path or mapping, optional
        A body on restitution stops under a harmonic force; `square-root`, and `nordmark` with alpha and gamma, need
        none.
    kind : {"impact", "strobe", "discontinuity", "nordmark", "square-root"}
        Phase and velocity of the impacts of a long run, with the orbits P(1,1); states at forcing phase 0, likewise;
        the sets S and W of impacts before and after a graze, of one mode (thesis figure 2.12); bifurcation diagrams of
        Nordmark's map (2.18) and of the one-dimensional square-root map (2.19).
    **options
        `span`, `points`, `alpha`, `gamma`, `restitution`, `slope`: of the last two kinds, see `MapSettings`.

    Returns
    -------
    xarray.Dataset
        What `draw` draws.

    Raises
    ------
    UsageError
        There is no such map, or the scene has none.
    OrbitError
        The body has several modes, where the map is one of one mode.
    """
    settings = settings_of(kind, **options)
    return of_study(MapOfScene(None if scene is None else given_scene(scene), settings))


def basins(
    scene: SceneLike,
    x: Span | None = None,
    y: Span | None = None,
    points: tuple[int, int] = (POINTS, POINTS),
    *,
    number: int | None = None,
) -> xr.Dataset:
    """Find which attractor each start of a plane ends on.

    Parameters
    ----------
    scene : Scene, path or mapping
        An oscillator, a chain or a beam on restitution stops under a harmonic force.
    x, y : tuple of float, optional
        Ends of displacement (m) and velocity (m/s) at the start; those of the scene's own motion, twice as far.
    points : tuple of int
        Along both.
    number : int, optional
        Which mass of a chain, or mode of a beam, starts so: the mass that is hit first, mode 1; the others start as the
        scene says.

    Returns
    -------
    xarray.Dataset
        `basin` on (velocity_start, displacement_start): numbers along `attractor`, -1 undecided, -2 beyond a stop; of
        each attractor its name (`P(1,1)`, `chaos`, ...), `basin_fraction`, its states at forcing phase 0, and
        `attractor_impacts` in a forcing period at each stop. The attribute `undetected_share_below` is the share of
        starts that may end on an attractor which the sample of chaotic starts missed (95 % confidence).

    Raises
    ------
    UsageError
        The scene has no such orbits, or the plane no starts.
    """
    return of_study(BasinsOfScene(given_scene(scene), Plane(x, y, points, number)))


def control(
    scene: SceneLike,
    start: float,
    stop: float,
    *,
    law: Law = "ogy",
    step: float = 1e-4,
    tolerance: float = 1e-4,
    limit: float = 0.1,
    noise: float = 0.0,
    seed: int = 1,
    periods: int = 1,
    stay: int = 1,
) -> xr.Dataset:
    """Keep an orbit P(1,q) from one angular frequency to another by the forcing amplitude.

    Parameters
    ----------
    scene : Scene, path or mapping
        An oscillator on restitution stops under a harmonic force.
    start, stop : float
        Angular frequencies, rad/s.
    law : {"ogy", "deadbeat", "newton"}
        What is done about a deviation at an impact: the next one is put on the direction that comes back faster; the
        orbit is reached two impacts later; as the first, about an orbit that is located from the last two impacts.
    step : float
        Of the angular frequency, rad/s.
    tolerance : float
        Difference of two speeds in a row, over that of the orbit, at which the frequency goes on.
    limit : float
        Largest correction over the forcing amplitude; 0: nothing is corrected.
    noise : float
        Standard deviation of the error of measured speeds, relative.
    seed : int
        Of the noise.
    periods : int
        q.
    stay : int
        Flights at each angular frequency at least.

    Returns
    -------
    xarray.Dataset
        Along `impact` what came (`impact_velocity`, `correction`, ...), along `orbit` what was to be kept; attributes
        `kept_to` (rad/s) and `end` say how far it was kept and why not further, `branch_ends_at` where there is no
        such orbit any more.

    Raises
    ------
    UsageError
        The scene has no orbits that this keeps.
    OrbitError
        There is none at the start.
    ComponentError
        pythonfmu is not installed.
    """
    settings = ControlSettings(law, step, tolerance, limit, noise, seed, periods, stay)
    return of_study(Controlled(control_plan(given_scene(scene), start, stop, settings)))


def transients(
    scene: SceneLike,
    path: PathLike | None = None,
    *,
    starts: int = 8,
    spread: float = 1.0,
    tolerance: float = 1e-6,
    periods: int = 3000,
) -> xr.Dataset:
    """Find how many periods a scene needs to forget its start.

    Parameters
    ----------
    scene : Scene, path or mapping
        An oscillator, a chain or a beam on restitution stops; its sweep is left out. Without a harmonic force the
        period is that of its first mode.
    path : path, optional
        The dataset to write as well (.nc).
    starts : int
        Starts beside that of the scene, drawn evenly, the same each time.
    spread : float
        Their largest distance in each displacement and velocity, over the size of the scene's motion.
    tolerance : float
        Distance over that size below which a start is forgotten.
    periods : int
        Most periods that are followed.

    Returns
    -------
    xarray.Dataset
        `distance` of each `start` from the scene's own motion after each `period`; `forgotten_after` (infinite where it
        never stays below the tolerance), `contraction` a period, `motion` and `end`: what became of it. The attribute
        `linear_contraction` is the factor of the body without impacts.

    Raises
    ------
    UsageError
        The scene is none whose orbits are followed, or a number makes no sense.

    Examples
    --------
    >>> body = {"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.05}
    >>> stop, force = {"position": 1.0, "restitution": 0.7}, {"amplitude": 0.5, "angular_frequency": 1.0}
    >>> record = {"transient_periods": 0, "recorded_periods": 1}
    >>> found = transients({"body": body, "forcing": force, "stop": [stop], "record": record}, starts=2)
    >>> set(found.end.values), found.attrs["motion"]
    ({'forgotten'}, 'P(1,1)')
    """
    chosen = given_scene(scene)
    written = given_result(path, [scene, chosen])
    return of_study(Transients(chosen, starts, spread, tolerance, periods), written)

"""Orbits, branches, maps, basins and control: a thin layer over the functions behind the commands."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import xarray as xr

from vibroimpact.analysis.orbits.attractors.basins import MOST_PERIODS
from vibroimpact.analysis.orbits.feedback import Law
from vibroimpact.analysis.orbits.found import FoundOrbits
from vibroimpact.fmus.errors import UsageError
from vibroimpact.given import PathLike, SceneLike, given_result, given_scene, scene_with_modes
from vibroimpact.orchestrator.orbits.basin_shares import VALUES, BasinShares
from vibroimpact.orchestrator.orbits.basins import BasinsOfScene
from vibroimpact.orchestrator.orbits.control import Controlled
from vibroimpact.orchestrator.orbits.control_plan import ControlSettings, control_plan
from vibroimpact.orchestrator.orbits.diagram import Diagram
from vibroimpact.orchestrator.orbits.find import find_orbits as orbits_of_scene
from vibroimpact.orchestrator.orbits.follow import Following
from vibroimpact.orchestrator.orbits.maps import MapOfScene, settings_of
from vibroimpact.orchestrator.orbits.planes import POINTS, Plane, Span
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
    """Find stable and unstable periodic orbits of a scene.

    Parameters
    ----------
    scene : Scene, path or mapping
        An oscillator, a chain, a beam or several bodies under a harmonic force, on rigid stops or stops that yield. On
        rigid stops it may be without a force. The sweep is ignored.
    impacts, periods : int, optional
        p and q of P(p,q). By default all orbits P(1,1) are found, and the orbit that a long run ends on.
    seed : sequence of (phase, stop), optional
        Approximate impacts of one orbit: their forcing phases (rad) and the numbers of their stops, from 1. Only this
        orbit is returned.
    penetrating : bool
        Whether orbits that pass through a stop between impacts are returned as well.

    Returns
    -------
    list of PeriodicOrbit
        Each has `phases` (rad), `velocities` (m/s), `multipliers`, `is_stable` and its `highest` maximum between
        impacts. `draw` draws the list. The list's `dataset` has each physical orbit as a run.

    Raises
    ------
    UsageError
        The scene has another kind of body, stop or force.
    OrbitError
        There is no orbit near the seed.

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
    grazes: int = 1,
    step: float = 0.01,
    starts: int = 256,
    second: str | None = None,
    second_range: tuple[float, float] | None = None,
) -> xr.Dataset:
    """Follow periodic orbits of a scene over a parameter, through folds and period doublings.

    Parameters
    ----------
    scene : Scene, path or mapping
        An oscillator, a chain, a beam or several bodies under a harmonic force, on rigid stops or stops that yield. On
        rigid stops it may be without a force. The sweep is ignored.
    parameter : str
        Key of a number in the scene, for example `forcing.angular_frequency`.
    start, stop : float
        Ends of the parameter's range.
    path : path, optional
        Dataset file to write as well (.nc).
    impacts, periods : int, optional
        p and q of the orbits that the branches start from; they are searched along the range. Without them, branches
        start from P(1,1) and from the orbits on which runs over the range end. Index sums then show whether orbits
        with a period of one or two forcing periods are missing; missing ones are searched.
    seed : sequence of (phase, stop), optional
        Approximate impacts of one orbit at the scene's own parameter: their forcing phases (rad) and the numbers of
        their stops, from 1. This orbit is followed in both directions.
    doublings : int
        Number of successive period doublings whose branches are followed.
    grazes : int
        Number of successive grazes at which other orbits, with more or fewer impacts, are followed.
    step : float
        Largest step along a branch. The parameter is scaled to a range of 1, the phases are in radians.
    starts : int
        Number of trains of impacts from which each search for orbits of several impacts starts.
    second : str, optional
        Key of a second parameter. Folds, period doublings, tori and grazes are followed over both parameters, and so
        are the loci that leave points of codimension 2. Branches at five further values of it are starts, too.
    second_range : tuple of float, optional
        Ends of the second parameter's range.

    Returns
    -------
    xarray.Dataset
        Each run is an orbit, with `orbit_branch`, `orbit_stable`, `orbit_special`, `orbit_index` and its largest
        multiplier. The attributes `first_orbits` and `index_sums` say where branches start and what is missing. With
        `second`, each run is an orbit at a bifurcation, if any was found. The attribute `curves` names where each
        bifurcation curve begins, `isolas` the closed branches; `not_looked_for` tells where curves were not searched.
        Points of codimension 2 are on `curve_point`.

    Raises
    ------
    UsageError
        The scene has another kind of body, stop or force, or a parameter is no number of the scene.
    OrbitError
        There is no orbit to start from.

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
        grazes=grazes,
        step=step,
        starts=starts,
        second=second,
        second_range=second_range,
    )
    return runs_of_study(study, written)


def diagram(
    scene: SceneLike,
    parameter: str | None = None,
    start: float | None = None,
    stop: float | None = None,
    path: PathLike | None = None,
    *,
    values: int | None = None,
    parts: Sequence[str] | None = None,
    points: int = 60,
    share_values: int = 41,
    impacts: int | None = None,
    periods: int = 1,
    doublings: int = 1,
    grazes: int = 1,
    second: str | None = None,
    second_range: tuple[float, float] | None = None,
    second_values: int | None = None,
) -> xr.Dataset:
    """Return sweep, branches, shares of basins and exponents over a parameter, or classes and loci over two.

    Parameters
    ----------
    scene : Scene, path or mapping
        Without a parameter its own sweep of one or two keys gives ranges and numbers of values.
    parameter : str, optional
        Key of a number in the scene, for example `forcing.angular_frequency`.
    start, stop : float, optional
        Ends of the parameter's range.
    path : path, optional
        Dataset file to write as well (.nc).
    values : int, optional
        Number of values of the sweep. Default: 401, or 121 with a second parameter.
    parts : sequence of str, optional
        Parts that are made: `sweep` (runs up and down), `branches` (see `follow`), `shares` (see `basins`),
        `exponents` of the runs (see `lyapunov`). With a second parameter: `sweep` (a map of the runs), `loci`.
    points : int
        Starts along both axes of the planes in which basins are found.
    share_values : int
        Number of values at which shares are found.
    impacts, periods, doublings, grazes : int
        See `follow`.
    second, second_range, second_values : optional
        Key, ends and number of values (81) of a second parameter.

    Returns
    -------
    xarray.Dataset
        Variables of all parts, each with the name of its part in front. `.vibroimpact.part(name)` is the dataset of
        one part alone. The attribute `parts` names the parts; `refused` has the reasons for missing ones.

    Raises
    ------
    UsageError, SceneError
        A range is empty or incomplete, a part unknown, or a parameter is no number of the scene.
    OrbitError, DatasetError
        The scene can have none of the parts.

    Examples
    --------
    >>> found = diagram("scene.toml", "forcing.angular_frequency", 0.6, 1.6)    # doctest: +SKIP
    >>> found.vibroimpact.part("branches").orbit_stable                         # doctest: +SKIP
    """
    given = given_scene(scene)
    written = given_result(path, [scene, given])
    study = Diagram(
        *(scene_with_modes(given), parameter, start, stop),
        values=values,
        parts=parts,
        points=points,
        share_values=share_values,
        impacts=impacts,
        periods=periods,
        doublings=doublings,
        grazes=grazes,
        second=second,
        second_range=second_range,
        second_values=second_values,
    )
    return of_study(study, written)


def maps(scene: SceneLike | None = None, kind: str = "impact", **options: Any) -> xr.Dataset:
    """Return a Poincaré map of a scene, or a bifurcation diagram of a normal form, as points to draw.

    Parameters
    ----------
    scene : Scene, path or mapping, optional
        A body on restitution stops under a harmonic force. `square-root`, and `nordmark` with alpha and gamma, need
        no scene.
    kind : {"impact", "strobe", "discontinuity", "nordmark", "square-root"}
        `impact`: phase and velocity of the impacts of a long run, with the orbits P(1,1). `strobe`: states at forcing
        phase 0, with the same orbits. `discontinuity`: sets S and W of impacts before and after a graze, one mode
        (thesis figure 2.12). `nordmark`, `square-root`: bifurcation diagrams of Nordmark's map (2.18) and of the
        one-dimensional square-root map (2.19).
    **options
        Options of the last two kinds: `span`, `points`, `alpha`, `gamma`, `restitution`, `slope`; see `MapSettings`.

    Returns
    -------
    xarray.Dataset
        The points, which `draw` draws.

    Raises
    ------
    UsageError
        The map is unknown, or the scene does not have it.
    OrbitError
        The body has several modes, and the map is defined for one.
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
    periods: int = MOST_PERIODS,
    edges: bool = False,
    parameter: str | None = None,
    parameter_range: tuple[float, float] | None = None,
    values: int = VALUES,
) -> xr.Dataset:
    """Find the attractor that each start in a plane of initial states ends on.

    Parameters
    ----------
    scene : Scene, path or mapping
        An oscillator, a chain, a beam or several bodies on restitution stops under a harmonic force.
    x, y : tuple of float, optional
        Ranges of the initial displacement (m) and velocity (m/s). The default is twice the range of the scene's motion.
    points : tuple of int
        Numbers of starts along x and y.
    number : int, optional
        Number of the mass of a chain, or of the mode of a beam, whose start is varied. The others keep the scene's
        start. The default is the mass that hits first, or mode 1.
    periods : int
        Budget: most forcing periods for which one start is followed. The slowest decay says how many are needed.
    edges : bool
        Whether edges between basins are followed to the saddles on them: `edge_orbit`, `edge_multiplier`.
    parameter : str, optional
        Number of the scene over which the shares of the attractors are found, in one plane of starts.
    parameter_range : tuple of float, optional
        Ends of its range.
    values : int
        Number of values in that range.

    Returns
    -------
    xarray.Dataset
        `basin` has the dims (velocity_start, displacement_start): a number along `attractor`, -1 undecided, -2 beyond a
        stop. Each attractor has a name (`P(1,1)`, `chaos`, ...), its `basin_fraction`, its states at forcing phase 0,
        and `attractor_impacts`, impacts per forcing period at each stop. The attribute `undetected_share_below` bounds
        the share of starts on attractors that the sample of chaotic starts missed (95 % confidence).
        With `parameter` the dataset has `basin_fraction` over the dims (parameter, attractor) instead.

    Raises
    ------
    UsageError
        The scene has another kind of body, stop or force, or the plane has no starts.
    """
    plane = Plane(x, y, points, number)
    if parameter is None:
        return of_study(BasinsOfScene(given_scene(scene), plane, periods, edges))
    if parameter_range is None:
        raise UsageError("basins: parameter_range: expected two ends of the parameter's range, got none.")
    return of_study(BasinShares(given_scene(scene), plane, parameter, parameter_range, values, periods))


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
    """Keep an orbit P(1,q) from one angular frequency to another by corrections of the forcing amplitude.

    Parameters
    ----------
    scene : Scene, path or mapping
        An oscillator on restitution stops under a harmonic force.
    start, stop : float
        Angular frequencies, rad/s.
    law : {"ogy", "deadbeat", "newton"}
        Correction of a deviation at an impact. `ogy` puts the next impact on the direction that returns faster.
        `deadbeat` reaches the orbit two impacts later. `newton` is `ogy` about an orbit located from the last two
        impacts.
    step : float
        Step of the angular frequency, rad/s.
    tolerance : float
        Difference of two successive impact speeds, over the orbit's speed, below which the frequency takes its step.
    limit : float
        Largest correction over the forcing amplitude; 0 switches the corrections off.
    noise : float
        Standard deviation of the error of measured speeds, relative.
    seed : int
        Seed of the noise.
    periods : int
        q of P(1,q), forcing periods between impacts.
    stay : int
        Least number of flights at each angular frequency.

    Returns
    -------
    xarray.Dataset
        The impacts along `impact` (`impact_velocity`, `correction`, ...), and the orbits to keep along `orbit`.
        The attribute `kept_to` is the last frequency (rad/s) at which the orbit was kept, `end` the reason for the end
        in words. `branch_ends_at` is the frequency at which the orbit ceases to exist.

    Raises
    ------
    UsageError
        The scene has no orbits that this feedback keeps.
    OrbitError
        The start frequency has no such orbit.
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
    """Measure the number of periods after which a scene has forgotten its start.

    Parameters
    ----------
    scene : Scene, path or mapping
        An oscillator, a chain, a beam or several bodies on restitution stops; the sweep is ignored.
        Without a harmonic force the period is the period of the first mode.
    path : path, optional
        Dataset file to write as well (.nc).
    starts : int
        Number of other starts, drawn evenly around the scene's start; each call draws the same starts.
    spread : float
        Largest distance of these starts in each displacement and velocity, over the size of the scene's motion.
    tolerance : float
        Distance, over the size of the scene's motion, below which a start counts as forgotten.
    periods : int
        Largest number of periods to follow.

    Returns
    -------
    xarray.Dataset
        `distance` of each `start` from the scene's own motion after each `period`. Each start has `forgotten_after` in
        periods, infinite if the distance never stays below the tolerance. It also has its `contraction` per period, and
        its `motion` and `end` in words. The attribute `linear_contraction` is the factor of the body without impacts.

    Raises
    ------
    UsageError
        The scene has another kind of body or stop, or a number is out of its range.

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

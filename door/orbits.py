"""Maps, basins and control of orbits: thin over the functions that the commands stand on."""

from __future__ import annotations

from typing import Any

import xarray as xr

from vibroimpact.analysis.orbits.feedback import Law
from vibroimpact.given import SceneLike, given_scene
from vibroimpact.orchestrator.orbits.basins import (
    POINTS,
    Plane,
    Span,
    basins_dataset,
    prepare_basins,
    run_basins,
)
from vibroimpact.orchestrator.orbits.control import run_plan
from vibroimpact.orchestrator.orbits.control_plan import ControlSettings, control_plan
from vibroimpact.orchestrator.orbits.maps import map_of, settings_of


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
    return map_of(None if scene is None else given_scene(scene), settings)


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
        each attractor its name (`P(1,1)`, `chaos`, ...), `basin_fraction`, and its states at forcing phase 0.

    Raises
    ------
    UsageError
        The scene has no such orbits, or the plane no starts.
    """
    plane = Plane(x, y, points, number)
    alone, across, along, found = prepare_basins(given_scene(scene), plane)
    run_basins(alone, found)
    return basins_dataset(alone, plane, across, along, found)


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
    return run_plan(control_plan(given_scene(scene), start, stop, settings)).dataset

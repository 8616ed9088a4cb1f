"""Periodic orbits of a scene: those of given p and q, and the one that a long run ends on."""

from __future__ import annotations

from functools import partial

import numpy as np

from vibroimpact.analysis.orbits import ImpactingBody, OrbitError, PeriodicOrbit, find_orbit
from vibroimpact.analysis.orbits.found import FoundOrbits
from vibroimpact.analysis.orbits.search import orbits_of, same_orbit
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.orbits.bodies import impacting_body
from vibroimpact.orchestrator.orbits.seeds import Seed
from vibroimpact.orchestrator.run import PointRunner
from vibroimpact.orchestrator.run.provenance import scene_attributes
from vibroimpact.orchestrator.scene import Scene

HISTORY = "periodic orbits found by vibroimpact"
LONGEST = 16
"""Forcing periods of an orbit that a run is taken to end on."""
TRANSIENT = 2000
"""Forcing periods that a run is given to come to its orbit."""
LARGEST_PHASE = 1e6
"""Of a seed, rad: a larger one has lost digits of the turn that it is in."""
REPEATS = 1e-4
"""Difference of phases, rad, up to which a run has come near to an orbit; Newton's method does the rest."""


def find_orbits(
    scene: Scene,
    impacts: int | None = None,
    periods: int | None = None,
    *,
    seed: Seed | None = None,
    penetrating: bool = False,
) -> FoundOrbits:
    """Return periodic orbits of a scene, stable and unstable.

    Parameters
    ----------
    scene : Scene
        An oscillator, a chain or a beam on restitution stops under a harmonic force; its sweep is left out.
    impacts, periods : int, optional
        p and q. Without them, all orbits P(1,1) and the orbit that a long run of the scene ends on.
    seed : sequence of (phase, stop), optional
        Impacts near to those of one orbit, phases ascending within `periods`; that orbit alone is looked for, physical
        or not.
    penetrating : bool
        Whether orbits that pass through a stop between impacts are returned as well.

    Raises
    ------
    UsageError
        The scene has no such orbits to be looked for.
    OrbitError
        There is no orbit near to the seed.
    """
    alone = scene.unswept()
    orbits = _found(alone, impacts, periods, seed, penetrating)
    return FoundOrbits(orbits, alone.units, partial(scene_attributes, alone, HISTORY))


def _found(
    alone: Scene, impacts: int | None, periods: int | None, seed: Seed | None, penetrating: bool
) -> list[PeriodicOrbit]:
    body = impacting_body(alone)
    if seed is not None:
        return [_of_seed(body, seed, impacts, 1 if periods is None else periods)]
    if impacts is not None or periods is not None:
        counts = 1 if impacts is None else impacts, 1 if periods is None else periods
        return orbits_of(body, *counts, penetrating=penetrating)
    found = orbits_of(body, penetrating=penetrating)
    reached = orbit_of_run(alone)
    if reached is not None and not any(same_orbit(reached, other) for other in found):
        found.append(reached)
    return found


def _of_seed(body: ImpactingBody, seed: Seed, impacts: int | None, periods: int) -> PeriodicOrbit:
    if impacts not in (None, len(seed)):
        raise UsageError(
            f"orbit: seed: expected {impacts} impacts, as many as the orbit has, got {len(seed)}."
        )
    for phase, stop in seed:
        if abs(phase) > LARGEST_PHASE:
            raise UsageError(f"orbit: seed: expected phases up to {LARGEST_PHASE:g} rad, got {phase:g}.")
        if not 1 <= stop <= len(body.contacts):
            raise UsageError(f"orbit: seed: expected stops 1 to {len(body.contacts)}, got {stop}.")
    phases, contacts = [phase for phase, _ in seed], [stop - 1 for _, stop in seed]
    orbit = find_orbit(body, phases, contacts, periods)
    if not (orbit.velocities > 0.0).all():
        raise OrbitError(
            "orbit: expected impacts towards the stops near to the seed, got velocities "
            f"{orbit.velocities.round(6).tolist()}. Try other phases."
        )
    return orbit.once


def orbit_of_run(scene: Scene) -> PeriodicOrbit | None:
    """Return the orbit that a long run of a scene ends on; None where it ends on none of few periods."""
    long = scene.with_values(
        {
            "record.transient_periods": TRANSIENT,
            "record.recorded_periods": 2 * LONGEST,
            "record.impacts": True,
        }
    )
    runner = PointRunner(long)
    try:
        rows = runner.run({}).impacts
    finally:
        runner.close()
    body = impacting_body(scene)
    if rows is None or not len(rows):
        return None
    turns = np.floor(
        (rows[:, 0] - rows[0, 0] + (rows[0, 1] - rows[:, 1]) / body.angular_frequency) / body.period + 0.5
    )
    phases, contacts = rows[:, 1] + 2.0 * np.pi * turns, rows[:, 4].astype(int) - 1
    for periods in range(1, LONGEST + 1):
        count = int(np.count_nonzero(phases < phases[0] + 2.0 * np.pi * periods - REPEATS))
        if 2 * count > phases.size:
            return None
        apart = np.abs(phases[count : 2 * count] - phases[:count] - 2.0 * np.pi * periods).max()
        if apart > REPEATS or not (contacts[count : 2 * count] == contacts[:count]).all():
            continue
        try:
            orbit = find_orbit(body, phases[:count], contacts[:count].tolist(), periods)
        except (OrbitError, UsageError):  # impacts closer than phases can tell: chatter
            return None
        return orbit if orbit.is_physical else None
    return None

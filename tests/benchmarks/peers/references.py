"""The reference of all errors, and its distance from a second, independent computation.

The reference is that of `vibroimpact accuracy`: the closed form on the P(1,1) orbit, else the fused run. The second
computation is that of the tests of structures: DOP853 between events at a relative tolerance of 1e-13, without code of
this package. It has half the digits on grazes, so the 40-digit flow of `tests/support/exact_motion.py` replaces it.
"""

from __future__ import annotations

import math

import numpy as np
from support.exact_motion import Oscillator, exact_next_contact
from support.reference_bodies import Body
from support.reference_stops import Forcing, Stop
from support.structure_reference import Reference as SecondRoad

from peers.problems import Problem
from peers.ways import observed
from vibroimpact.orchestrator.study.errors import errors_of
from vibroimpact.orchestrator.study.references import Reference, reference_of

TOLERANCE = 1e-13


def reference(problem: Problem) -> Reference:
    """Return the reference of a problem."""
    return reference_of(problem.scene.with_values({"record.impacts": True, "record.extrema": True}))


def off_second_road(problem: Problem, known: Reference, quantity: str) -> float:
    """Return the error of the second computation against the reference; NaN where no impact is compared.

    Raises
    ------
    ArithmeticError
        The two computations do not have the same impacts.
    """
    if quantity == "impact_time":
        return _off_exact(problem, known)
    table = problem.stop
    law = {"law": "restitution", "restitution": table.restitution} if problem.is_rigid else {}
    if not problem.is_rigid:
        law = {"law": "kelvin_voigt", "stiffness": table.stiffness, "damping": table.damping}
    n = problem.modes
    road = SecondRoad(
        Body(problem.natural, np.diag(problem.damping)),
        [Stop(problem.shape, table.position, **law)],
        Forcing(problem.force, problem.angular_frequency, problem.forcing_phase),
        problem.start[:n],
        problem.start[n:],
        rtol=TOLERANCE,
    ).advance(problem.end)
    seen = [(hit.time, hit.velocity) for hit in road.impacts]
    if not problem.is_rigid:
        seen = [(press.start, press.velocity_in) for press in road.presses]
    found = errors_of(observed(seen, problem.contact(road.y)), known.observation, known.scales)
    if found.failure:
        raise ArithmeticError(f"second road: {found.failure}")
    return found.worst(quantity)


def _off_exact(problem: Problem, known: Reference) -> float:
    """Return the distance of the first impact of a graze from the exact flow's, over the period."""
    if not len(known.observation.impacts):
        return math.nan
    body = Oscillator(1.0, problem.damping[0], 1.0, problem.force[0], problem.angular_frequency)
    start, time = (problem.start[0], problem.start[1]), float(known.observation.impacts[0, 0])
    exact, _ = exact_next_contact(body, start, problem.stop.position, problem.forcing_phase, time)
    return float(abs(exact - time)) / problem.period

"""CVODE of SUNDIALS by scikit-sundae, with its root finding and the Jacobian; slopes are Python functions.

Adams and BDF both run all problems, although Adams is advised for motion that is not stiff, and BDF for stiff motion.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from peers.flights import event_of, follow, longest_step, slope_of, slow_rebound
from peers.problems import Phase, Problem
from peers.ways import ABSOLUTE, Clock, Found, Run, Way, with_tolerances
from vibroimpact.orchestrator.study.observation import Floats

METHODS = ("Adams", "BDF")
MOST_STEPS = 1_000_000
AT_EVENT = 2
"""Status of a result that ends at an event."""


def _callbacks(problem: Problem, phase: Phase, clock: Clock) -> tuple[Callable[..., None], ...]:
    """Return slope, event and Jacobian in the form of scikit-sundae, which passes the array to be filled."""
    slope, event, matrix = (
        slope_of(problem, phase),
        event_of(problem, phase, clock),
        problem.pieces[phase].matrix,
    )

    def fill_slope(t: float, y: Floats, yp: Floats) -> None:
        yp[:] = slope(t, y)

    def fill_event(t: float, y: Floats, events: Floats) -> None:
        events[0] = event(t, y)

    def fill_jacobian(t: float, y: Floats, yp: Floats, jacobian: Floats) -> None:
        jacobian[:, :] = matrix

    attributes: Any = fill_event
    attributes.terminal, attributes.direction = [True], [1]
    return fill_slope, fill_event, fill_jacobian


def opened(method: str, problem: Problem, tolerance: float, clock: Clock) -> Run:
    """Return a function that simulates a problem with one method of CVODE at a tolerance."""
    from sksundae.cvode import CVODE

    phases = list(Phase)[: len(problem.pieces)]
    functions = [_callbacks(problem, phase, clock) for phase in phases]

    def solver(phase: Phase) -> Any:
        slope, event, jacobian = functions[phase]
        longest = longest_step(problem, phase)
        return CVODE(
            slope,
            method=method,
            rtol=tolerance,
            atol=ABSOLUTE * tolerance,
            eventsfn=event,
            num_events=1,
            jacfn=jacobian,
            max_num_steps=MOST_STEPS,
            max_step=0.0 if longest == math.inf else longest,
        )

    solvers = [solver(phase) for phase in phases]

    def integrate(phase: Phase, t: float, y: Floats, first: float) -> tuple[float, Floats, bool]:
        # CVODE's own first steps are short enough for any bounce; a prescribed first step fails its error test
        found = solvers[phase].solve([t, problem.end], y)
        if not found.success:
            raise ArithmeticError(str(found.message))
        return float(found.t[-1]), np.array(found.y[-1]), found.status == AT_EVENT

    def run() -> Found:
        clock.start()
        return follow(problem, integrate, slow_rebound(tolerance), clock)

    return run


def ways() -> list[Way]:
    """Return one way for each method."""
    return [with_tolerances("CVODE", "scikit-sundae", method, opened) for method in METHODS]

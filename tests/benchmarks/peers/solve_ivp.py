"""scipy's `solve_ivp` with terminal events: RK45, DOP853, and Radau with its Jacobian."""

from __future__ import annotations

import math
from typing import Any

from scipy.integrate import solve_ivp

from peers.flights import event_of, follow, longest_step, slope_of, slow_rebound
from peers.problems import Phase, Problem
from peers.ways import ABSOLUTE, Clock, Found, Run, Way, with_tolerances
from vibroimpact.orchestrator.study.observation import Floats

METHODS = ("RK45", "DOP853", "Radau")


def opened(method: str, problem: Problem, tolerance: float, clock: Clock) -> Run:
    """Return a function that simulates a problem with one method of `solve_ivp` at a tolerance."""
    phases = list(Phase)[: len(problem.pieces)]
    slopes = [slope_of(problem, phase) for phase in phases]
    events: list[Any] = [event_of(problem, phase, clock) for phase in phases]
    for event in events:
        event.terminal, event.direction = True, 1.0
    options: list[dict[str, Any]] = [
        {
            "method": method,
            "rtol": tolerance,
            "atol": ABSOLUTE * tolerance,
            "max_step": longest_step(problem, phase),
            **({"jac": problem.pieces[phase].matrix} if method == "Radau" else {}),
        }
        for phase in phases
    ]

    def integrate(phase: Phase, t: float, y: Floats, first: float) -> tuple[float, Floats, bool]:
        own = options[phase]
        left = min(own["max_step"], problem.end - t)
        if 0.0 < first < math.inf:
            own = {**own, "first_step": min(first, left)}
        found = solve_ivp(slopes[phase], (t, problem.end), y, events=events[phase], **own)
        if found.status < 0:
            raise ArithmeticError(str(found.message))
        return float(found.t[-1]), found.y[:, -1].copy(), found.status == 1

    def run() -> Found:
        clock.start()
        return follow(problem, integrate, slow_rebound(tolerance), clock)

    return run


def ways() -> list[Way]:
    """Return one way for each method."""
    return [with_tolerances("solve_ivp", "scipy", method, opened) for method in METHODS]

"""What a way of simulating a problem is to the measurement."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from peers.problems import Problem
from vibroimpact.orchestrator.study.observation import Floats, Observation

TOLERANCES = (1e-3, 1e-6, 1e-9, 1e-12)
"""Relative tolerances of the integrators; the absolute one is a thousandth of it."""
ABSOLUTE = 1e-3


class LateError(Exception):
    """A run took more processor time than it may."""


class Clock:
    """Processor time that a run may take.

    Parameters
    ----------
    seconds : float
    """

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self.start()

    def start(self) -> None:
        """Count from now."""
        self._end = time.process_time() + self.seconds

    def check(self) -> None:
        """Raise `LateError` when the time is over."""
        if time.process_time() > self._end:
            raise LateError


@dataclass(frozen=True, slots=True)
class Found:
    """What a run showed.

    Attributes
    ----------
    observation : Observation
        Impacts, and displacement and velocity of the contact point at the end.
    rests : ndarray, shape (rest,)
        When each rest on the stop began, s: the ends of chatters.
    share : int
        How many runs were made at once, over which the time is shared.
    """

    observation: Observation
    rests: Floats = field(default_factory=lambda: np.empty(0))
    share: int = 1


Run = Callable[[], Found]


@dataclass(frozen=True, slots=True)
class Way:
    """A package with a method, and the settings that trade accuracy for time.

    Attributes
    ----------
    name : str
    package : str
        The distribution that it needs beside this package's own; empty for none.
    knob : str
        What is set.
    settings : callable
        Given a problem: the values, from coarse to fine.
    open : callable
        Given a problem, a setting and the clock: what runs it. Whatever happens once (compilation, files) happens here,
        outside of the time that is measured.
    ours : bool
        Whether the fused FMU does the work, whoever drives it.
    batch : int
        Motions in one run, each of which may take the time of a run.
    """

    name: str
    package: str
    knob: str
    settings: Callable[[Problem], tuple[float, ...]]
    open: Callable[[Problem, float, Clock], Run]
    ours: bool = False
    batch: int = 1


def tolerances(problem: Problem) -> tuple[float, ...]:
    """Return the ladder of tolerances, the same for all problems."""
    return TOLERANCES


def with_tolerances(
    name: str, package: str, method: str, opened: Callable[[str, Problem, float, Clock], Run]
) -> Way:
    """Return one method of an integrator at the ladder of tolerances."""
    return Way(
        f"{name} {method}",
        package,
        "rtol",
        tolerances,
        lambda problem, tolerance, clock: opened(method, problem, tolerance, clock),
    )


def observed(
    impacts: list[tuple[float, float]], final: tuple[float, float], failure: str = ""
) -> Observation:
    """Return what a run showed from the times (s) and velocities (m/s) of its impacts on the one stop."""
    rows = np.array(impacts, dtype=float).reshape(-1, 2)
    return Observation(np.column_stack([rows, np.ones(len(rows))]), final=final, failure=failure)

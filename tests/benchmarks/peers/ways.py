"""A way of simulating a problem, as the measurement sees it: settings, a function that runs, and a result."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from peers.problems import Problem
from vibroimpact.orchestrator.study.observation import Floats, Observation

TOLERANCES = (1e-3, 1e-6, 1e-9, 1e-12)
"""Relative tolerances of the integrators; the absolute tolerance is a thousandth of each."""
ABSOLUTE = 1e-3


class LateError(Exception):
    """A run exceeded its processor time."""


class Clock:
    """Limit of the processor time of a run.

    Parameters
    ----------
    seconds : float
    """

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self.start()

    def start(self) -> None:
        """Restart the count."""
        self._end = time.process_time() + self.seconds

    def check(self) -> None:
        """Raise `LateError` when the time is used up."""
        if time.process_time() > self._end:
            raise LateError


@dataclass(frozen=True, slots=True)
class Found:
    """Result of a run.

    Attributes
    ----------
    observation : Observation
        Impacts, and displacement and velocity of the contact point at the end.
    rests : ndarray, shape (rest,)
        Start of each rest on the stop, s: the end of its chatter.
    share : int
        Number of runs made at once, which share the time.
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
        Distribution that it needs in addition to this package's own; empty for none.
    knob : str
        Name of the setting.
    settings : callable
        Function of a problem; returns the values, from coarse to fine.
    open : callable
        Function of a problem, a setting and the clock; returns the function that runs. Compilation and files cost time
        only here, outside of the measurement.
    ours : bool
        Whether the fused FMU does the work, by whatever importer.
    batch : int
        Motions in one run; the time limit counts for each.
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
    """Return the result of a run, from times (s) and velocities (m/s) of the impacts on its one stop."""
    rows = np.array(impacts, dtype=float).reshape(-1, 2)
    return Observation(np.column_stack([rows, np.ones(len(rows))]), final=final, failure=failure)

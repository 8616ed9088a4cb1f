"""Counts of the steps of a run, and the sum of their errors."""

from __future__ import annotations

import math
from array import array
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

#: Steps in a trace, above which each second one is left out.
MOST_TRACED = 1 << 15


@dataclass(slots=True)
class StepRecord:
    """Steps of a run with chosen sizes.

    Attributes
    ----------
    steps, rejected : int
        Steps made, and steps that were taken back: their errors were too large, or an FMU has discarded them.
    smallest, largest : float
        Extreme sizes, s, of steps that neither an event nor a limit has cut; NaN without one.
    error : float
        Sum of the estimated relative errors of all steps, each of its worst output.
    trace : array of float
        End (s), size (s) and relative error of steps, one after the other: all, or each second, fourth ... of many.
    """

    steps: int = 0
    rejected: int = 0
    smallest: float = math.nan
    largest: float = math.nan
    error: float = 0.0
    trace: array[float] = field(default_factory=lambda: array("d"))
    _stride: int = 1

    def row(self) -> NDArray[np.float64]:
        """Return the numbers in their order, shape (5,), as a dataset has them (`STEP_COLUMNS`)."""
        return np.array([self.steps, self.rejected, self.smallest, self.largest, self.error])

    def traced(self, tolerance: float) -> NDArray[np.float64]:
        """Return end (s), size (s) and error over a tolerance of each traced step, shape (step, 3)."""
        return np.array(self.trace).reshape(-1, 3) / [1.0, 1.0, tolerance]

    def add(self, end: float, size: float, error: float, *, cut: bool) -> None:
        """Count a step of `size` s to `end`, s, with its relative error."""
        if self.steps % self._stride == 0:
            self.trace.extend((end, size, error))
            if len(self.trace) >= 3 * MOST_TRACED:
                self._stride *= 2
                self.trace = array("d", np.array(self.trace).reshape(-1, 3)[::2].tobytes())
        self.steps += 1
        self.error += error
        if not cut:
            self.smallest = size if math.isnan(self.smallest) else min(self.smallest, size)
            self.largest = size if math.isnan(self.largest) else max(self.largest, size)

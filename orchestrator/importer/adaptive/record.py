"""Counts of the steps of a run, and the sum of their errors."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


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
    """

    steps: int = 0
    rejected: int = 0
    smallest: float = math.nan
    largest: float = math.nan
    error: float = 0.0

    def row(self) -> NDArray[np.float64]:
        """Return the attributes in their order, shape (5,), as a dataset has them (`STEP_COLUMNS`)."""
        return np.array([self.steps, self.rejected, self.smallest, self.largest, self.error])

    def add(self, size: float, error: float, *, cut: bool) -> None:
        """Count a step of `size` s with its relative error."""
        self.steps += 1
        self.error += error
        if not cut:
            self.smallest = size if math.isnan(self.smallest) else min(self.smallest, size)
            self.largest = size if math.isnan(self.largest) else max(self.largest, size)

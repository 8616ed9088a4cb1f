"""What was measured: a way with its errors and its times, and all of them with their reference."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.study.errors import Errors
from vibroimpact.orchestrator.study.observation import LATE
from vibroimpact.orchestrator.study.references import Reference
from vibroimpact.orchestrator.study.statistics import Statistics
from vibroimpact.orchestrator.study.ways.way import Way


@dataclass(slots=True)
class Measured:
    """A way with what came of it.

    Attributes
    ----------
    way : Way
    errors : Errors
    seconds : list of float
        Wall time of each run, s.
    calls : int
        Calls of the functions of FMUs in one run; -1 where nobody counts them.
    memory : int
        Largest resident memory that opening it and one run added to a process, bytes; -1 where nobody measures it.
    impacts : int
        How many it showed.
    energy_residual : float
        J; NaN where nothing is exchanged.
    variance : float
        Variance of a recording that a replay accounts for, percent; else NaN.
    statistics : Statistics or None
        In chaos.
    """

    way: Way
    errors: Errors
    seconds: list[float] = field(default_factory=list)
    calls: int = -1
    memory: int = -1
    impacts: int = 0
    energy_residual: float = math.nan
    variance: float = math.nan
    statistics: Statistics | None = None

    @property
    def cost(self) -> float:
        """Median wall time of a run, s."""
        return float(np.median(self.seconds)) if self.seconds else math.nan

    def cost_of_one(self, count: float) -> float:
        """Return the median wall time of a run over what it simulates, s; NaN for nothing, or an early end."""
        return self.cost / count if count > 0.0 and self.errors.failure != LATE else math.nan

    def error(self, quantity: str) -> float:
        """Relative error of a quantity, or the largest of all; NaN where the way failed."""
        return math.nan if self.errors.failure else self.errors.worst(quantity)

    def told(self, quantity: str, known: float) -> str:
        """Return the error in words; below what the reference is known to, that."""
        error = self.error(quantity)
        if error != error:
            return "-"
        return f"{error:.1e}" if error > known else f"< {known:.0e}"


@dataclass(frozen=True, slots=True)
class Study:
    """What was found.

    Attributes
    ----------
    scene : Scene
        As it was studied: without its sweep, and without a time series.
    reference : Reference
    measured : list of Measured
        In the order of the ways.
    quantity : str
        What the errors are of.
    tolerance : float
        What was asked for; NaN where nothing was.
    chosen : Measured or None
        The cheapest way that reaches it.
    orbit : str
        `P(p,q)`, `chaotic`, `no impacts`, ...; empty where nothing forces it.
    remarks : tuple of str
        What was left out, and why.
    modes_reference : str
        What other numbers of modes are compared with; empty where there are none.
    """

    scene: Scene
    reference: Reference
    measured: Sequence[Measured]
    quantity: str
    tolerance: float
    chosen: Measured | None
    orbit: str
    remarks: tuple[str, ...]
    modes_reference: str = ""

    @property
    def periods(self) -> float:
        """Forcing periods that a run simulates, those before the recording among them; NaN where nothing forces it."""
        if self.scene.general is not None or self.scene.replay is not None or self.scene.period is None:
            return math.nan
        return self.reference.scales.window[1] / self.scene.period

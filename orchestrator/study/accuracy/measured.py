"""What was measured: a way with its errors and its times, and all of them with their reference."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.study.accuracy.budget import Effort
from vibroimpact.orchestrator.study.errors import Errors
from vibroimpact.orchestrator.study.observation import LATE
from vibroimpact.orchestrator.study.references import Reference
from vibroimpact.orchestrator.study.statistics import Statistics
from vibroimpact.orchestrator.study.ways.way import Way

SHORT = 0.125
"""Part of a part that is simulated once more, for the cost that a run has however short it is."""


@dataclass(slots=True)
class Measured:
    """A way with what came of it.

    Attributes
    ----------
    way : Way
    errors : Errors
    part : float
        Part of the studied time that it has simulated: 1, 1/2, 1/4, ...
    length : float
        The studied time over the time that the way simulates, at part 1: below 1 where it passes its own transient.
    seconds : list of float
        Processor time of each run over its part, s.
    first : float
        Processor time of the first run, s: with what is loaded for it.
    first_wall : float
        Wall time of the first run, s.
    short : float
        Processor time of a run over an eighth of its part, s; NaN where it simulates all.
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
    part: float = 1.0
    length: float = 1.0
    seconds: list[float] = field(default_factory=list)
    first: float = math.nan
    first_wall: float = math.nan
    short: float = math.nan
    calls: int = -1
    memory: int = -1
    impacts: int = 0
    energy_residual: float = math.nan
    variance: float = math.nan
    statistics: Statistics | None = None

    @property
    def each(self) -> float:
        """Median processor time of a run over its part, s; of the first one where no other was timed."""
        return float(np.median(self.seconds)) if self.seconds else self.first

    @property
    def is_extrapolated(self) -> bool:
        """Whether it has simulated only a part, and its cost over all is a line through those of two parts."""
        return self.part < 1.0

    @property
    def cost(self) -> float:
        """Median processor time of a run over the studied time, s; a least one where it did not finish any part."""
        return self.length * (self.each + self._rate * (1.0 - self.part))

    def cost_of(self, choose: Callable[[Sequence[float]], float]) -> float:
        """Return the cost by another run than the median one, such as `min`, s; NaN where none was timed."""
        return self.cost * choose(self.seconds) / self.each if self.seconds and self.each > 0.0 else math.nan

    @property
    def _rate(self) -> float:
        """Processor time of the simulated time that is left, s: without what a run costs however short it is."""
        shorter = SHORT * self.part
        rate = (self.each - self.short) / (self.part - shorter) if self.short < self.each else math.nan
        return rate if rate == rate else self.each / self.part

    def cost_of_one(self, count: float) -> float:
        """Return the processor time of a run over what it simulates, s; NaN for nothing, or an early end."""
        return self.cost / count if count > 0.0 and self.errors.failure != LATE else math.nan

    @property
    def cost_of_impact(self) -> float:
        """Processor time of a run over the impacts that it showed, s; NaN without one, or after an early end."""
        is_known = self.impacts > 0 and self.errors.failure != LATE
        return self.length * self.each / self.impacts if is_known else math.nan

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
class Comparison:
    """All ways that were tried, with their reference.

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
    effort : Effort
        What the study took of the machine.
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
    effort: Effort = field(default_factory=Effort)

    @property
    def periods(self) -> float:
        """Forcing periods of the studied time; NaN where nothing forces it."""
        if not self.scene.is_lone_body or self.scene.period is None:
            return math.nan
        return self.reference.scales.window[1] / self.scene.period

"""The measurements: a way with its errors and its times, and all ways with their reference."""

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

SHORT_SHARE = 0.125
"""Share of a part that runs once more: the difference separates the fixed cost of a run from the cost per time."""


@dataclass(slots=True)
class Measured:
    """A way with its measurements.

    Attributes
    ----------
    way : Way
    errors : Errors
    part : float
        Simulated part of the studied time: 1, 1/2, 1/4, ...
    length : float
        Studied time over the time that the way simulates at part 1: below 1 where the way passes its own transient.
    seconds : list of float
        Processor time of each run over the part, s.
    first : float
        Processor time of the first run, s, including the loading of libraries.
    first_wall : float
        Wall time of the first run, s.
    short : float
        Processor time of a run over an eighth of the part, s; NaN where the way simulates all of the time.
    calls : int
        Calls of FMU functions in one run; -1 where they are not counted.
    memory : int
        Largest resident memory that opening the way and one run added to a process, bytes; -1 where not measured.
    impacts : int
        Number of impacts of the run.
    energy_residual : float
        Energy that the exchange of forces added, J; NaN where nothing is exchanged.
    variance : float
        Variance of a recording that a replay accounts for, percent; else NaN.
    statistics : Statistics or None
        Comparison of chaotic motion; None without chaos.
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
        """Median processor time of a run over its part, s; the time of the first run where no other was timed."""
        return float(np.median(self.seconds)) if self.seconds else self.first

    @property
    def is_extrapolated(self) -> bool:
        """Whether the way simulated only a part, so that its whole cost lies on a line through two shorter costs."""
        return self.part < 1.0

    @property
    def cost(self) -> float:
        """Median processor time of a run over the studied time, s; a lower bound where the way finished no part."""
        return self.length * (self.each + self._rate * (1.0 - self.part))

    def cost_of(self, choose: Callable[[Sequence[float]], float]) -> float:
        """Return the cost by another statistic than the median, such as `min`, s; NaN where no run was timed."""
        return self.cost * choose(self.seconds) / self.each if self.seconds and self.each > 0.0 else math.nan

    @property
    def _rate(self) -> float:
        """Processor time per whole studied time, s, without the fixed cost of a run."""
        shorter = SHORT_SHARE * self.part
        rate = (self.each - self.short) / (self.part - shorter) if self.short < self.each else math.nan
        return rate if rate == rate else self.each / self.part

    def cost_of_one(self, count: float) -> float:
        """Return the processor time of a run over a count, s; NaN for a count of 0 or an unfinished run."""
        return self.cost / count if count > 0.0 and self.errors.failure != LATE else math.nan

    @property
    def cost_of_impact(self) -> float:
        """Processor time of a run over its number of impacts, s; NaN without impacts or for an unfinished run."""
        is_known = self.impacts > 0 and self.errors.failure != LATE
        return self.length * self.each / self.impacts if is_known else math.nan

    def error(self, quantity: str) -> float:
        """Relative error of a quantity, or the largest error of all quantities; NaN where the method failed."""
        return math.nan if self.errors.failure else self.errors.worst(quantity)

    def error_in_words(self, quantity: str, known: float) -> str:
        """Return the error in words, or the reference's error `known` as a bound where the error is smaller."""
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
        The studied scene, without its sweep and without a time series.
    reference : Reference
    measured : list of Measured
        Measurements in the order of the ways.
    quantity : str
        Quantity of the errors, or `all`.
    tolerance : float
        Requested relative error; NaN without a request.
    chosen : Measured or None
        The cheapest way that reaches the tolerance.
    orbit : str
        Class of the motion: `P(p,q)`, `chaotic`, `no impacts`, ...; empty without forcing.
    remarks : tuple of str
        Parts that were left out, each with the reason.
    modes_reference : str
        Reference of the other numbers of modes, in words; empty where there are none.
    effort : Effort
        Time that the study took on the machine.
    chance : float
        Relative difference of range and mean energy of chaotic motion by chance alone; NaN where they do not count.
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
    chance: float = math.nan

    @property
    def periods(self) -> float:
        """Forcing periods of the studied time; NaN without forcing."""
        if not self.scene.is_lone_body or self.scene.period is None:
            return math.nan
        return self.reference.scales.window[1] / self.scene.period

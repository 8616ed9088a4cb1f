"""The budget of a study: processor time of all its processes, and the time that its runs waited for a processor."""

from __future__ import annotations

import math
from dataclasses import dataclass

import vibroimpact.orchestrator.study.clock as clock
from vibroimpact.orchestrator.study.ways.way import Trial

LEAST_BUDGET = 10.0
"""Least budget, processor time in s; below, the reference and one run of each way leave no time for timing."""
OVERHEAD_SECONDS = 2.0
"""Processor time of a command outside its study, s: it loads the package, prints a table and draws a figure."""
BUSY_SHARE = 0.2
"""Share of the time of runs spent waiting for a processor, above which the machine counts as busy."""


@dataclass(frozen=True, slots=True)
class Effort:
    """The time that a study took on the machine."""

    budget: float = math.nan
    """Budget of the study: processor time, s."""
    processor: float = math.nan
    """Processor time of all processes of the study, s."""
    wall: float = math.nan
    """Wall time of the study, s."""
    waited: float = 0.0
    """Share of the wall time of the timed runs that was spent waiting for a processor."""

    @property
    def is_busy(self) -> bool:
        """Whether other programs kept the runs from the processor."""
        return self.waited > BUSY_SHARE

    def in_words(self) -> str:
        """Return the effort in one or two sentences.

        Examples
        --------
        >>> Effort(10.0, 9.2, 31.0, 0.6).in_words().split(". ")[0]
        'Processor time: 9.2 s of the 10 s asked for, in 31 s of wall time'
        >>> Effort(10.0, 9.2, 9.6, 0.01).in_words()
        'Processor time: 9.2 s of the 10 s asked for, in 9.6 s of wall time.'
        """
        spent = f"{self.processor:.2g} s of the {self.budget:g} s asked for"
        said = f"Processor time: {spent}, in {self.wall:.2g} s of wall time."
        if not self.is_busy:
            return said
        return (
            f"{said} The machine was busy: runs waited for a processor in {100.0 * self.waited:.0f} % of their time. "
            "Costs are processor times; repeat the study where their spreads are large."
        )


class Budget:
    """Budget of a study since this object was made: processor time of all processes, allowed and spent, s."""

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self._spent, self._wall = clock.CLOCK.spent(), clock.CLOCK.wall()
        self._processor = self._elapsed = 0.0

    @property
    def spent(self) -> float:
        """Processor time spent so far, s."""
        return clock.CLOCK.spent() - self._spent

    @property
    def left(self) -> float:
        """Processor time left for the study, s; negative where the study has overspent."""
        return self.seconds - OVERHEAD_SECONDS - self.spent

    def time(self, trial: Trial) -> float:
        """Run a trial once; return its processor time, s."""
        processor, wall = clock.CLOCK.timed(trial)
        self.note(processor, wall)
        return processor

    def note(self, processor: float, wall: float) -> None:
        """Add the times of a run, s: wall time beyond processor time shows how busy the machine is."""
        self._processor += processor
        self._elapsed += wall

    def effort(self) -> Effort:
        """Return the effort of the study so far."""
        waited = 1.0 - self._processor / self._elapsed if self._elapsed > 0.0 else 0.0
        return Effort(self.seconds, self.spent, clock.CLOCK.wall() - self._wall, max(waited, 0.0))

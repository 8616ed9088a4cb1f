"""Progress of a run of an importer: its time, its grid of communication points, its events and steps."""

from __future__ import annotations

import math

from vibroimpact.fmus.core.coupling import CouplingProgress
from vibroimpact.orchestrator.importer.events import macro_step_error


class Progress(CouplingProgress):
    """Progress of a run, in memory shared with the C code that makes steps."""

    def begin(self, start_time: float, macro_step: float) -> None:
        """Start a run at `start_time`, s."""
        self.time = self.grid_start = start_time
        self.next_point = start_time + macro_step
        self.event_time = -math.inf
        self.grid_index = self.event_index = self.standstill = self.steps = self.repeated_steps = 0

    def pass_point(self, macro_step: float, room: float) -> None:
        """Find the next communication point: a multiple of the macro step ahead by more than `room`, s."""
        if macro_step <= room:
            raise macro_step_error(macro_step, room, self.time)
        while self.next_point - self.time <= room:
            self.grid_index += 1
            self.next_point = self.grid_start + (self.grid_index + 1) * macro_step

    def note_event(self) -> int:
        """Count an event at the present time; returns its index among events at the same time."""
        self.event_index = self.event_index + 1 if self.time == self.event_time else 0
        self.event_time = self.time
        return int(self.event_index)

    def note_step(self, end: float) -> None:
        """Count a step to `end`, s."""
        self.time = end
        self.steps += 1

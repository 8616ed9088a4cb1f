"""The line that shows the progress of a measurement."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray
from rich.live import Live
from rich.text import Text

from vibroimpact.fmus.terminal import Terminal, note
from vibroimpact.hardware.rig.acquisition import Acquisition, Block
from vibroimpact.hardware.rig.measurement import MeasuredInput, clips

REFRESHES_PER_SECOND = 4.0
LINE_SECONDS = 10.0
"""Time between two lines if standard error is no terminal, s."""


class Levels:
    """Levels of inputs since the last report, and samples at the ends of ranges since the beginning."""

    def __init__(self, inputs: Sequence[MeasuredInput]) -> None:
        self._inputs = tuple(inputs)
        self.clipped = np.zeros(len(self._inputs), dtype=np.int64)
        self._forget()

    def _forget(self) -> None:
        self._low = np.full(len(self._inputs), np.inf)
        self._high = np.full(len(self._inputs), -np.inf)

    def saw(self, volts: NDArray[np.float64]) -> None:
        """Take samples, shape (channel, sample)."""
        self._low = np.minimum(self._low, volts.min(axis=1))
        self._high = np.maximum(self._high, volts.max(axis=1))
        for place, each in enumerate(self._inputs):
            if (
                self._high[place] >= each.high - 1.5 * each.step
                or self._low[place] <= each.low + 0.5 * each.step
            ):
                self.clipped[place] += int(clips(each, volts[place]).sum())

    def text(self) -> str:
        """Return the levels in V, and start anew."""
        parts = []
        for place, each in enumerate(self._inputs):
            if self._low[place] <= self._high[place]:
                text = f"{each.name} {self._low[place]:.3g} to {self._high[place]:.3g} V"
                parts.append(text + (f" ({self.clipped[place]} CLIPPED)" if self.clipped[place] else ""))
        self._forget()
        return ", ".join(parts)


class Progress:
    """Shows the progress of a measurement.

    Parameters
    ----------
    acquired : Acquisition
    inputs : sequence of MeasuredInput
    duration : float or None
        s.
    show : callable
        Receives a line.
    every : float
        Time between two lines, s.
    """

    def __init__(
        self,
        acquired: Acquisition,
        inputs: Sequence[MeasuredInput],
        duration: float | None,
        show: Callable[[str], None],
        every: float,
    ) -> None:
        self._acquired, self._duration = acquired, duration
        self._show, self._every, self._last = show, every, time.monotonic()
        self._levels = Levels(inputs)

    def saw(self, block: Block, more: str = "") -> None:
        """Take a block; `more` is text to add."""
        self._levels.saw(block.volts)
        now = time.monotonic()
        if now - self._last >= self._every:
            self._last = now
            self._show(self.line(block.end, more))

    def line(self, end: int, more: str = "") -> str:
        """Return the line after `end` samples."""
        acquired = self._acquired
        whole = f" of {self._duration:g}" if self._duration is not None else ""
        late = acquired.lateness
        lost = sum(gap.samples for gap in acquired.gaps)
        parts = [
            f"{end / acquired.facts.rate:.1f}{whole} s",
            more,
            self._levels.text(),
            f"queue {acquired.queue_fill:.0%}",
            f"late {1e3 * late.median:.0f} ms, {1e3 * late.worst:.0f} at worst",
            f"{lost} SAMPLES LOST" if lost else "",
        ]
        return "; ".join(part for part in parts if part)


@contextmanager
def shown_live(
    acquired: Acquisition, inputs: Sequence[MeasuredInput], duration: float | None, shown: bool = True
) -> Iterator[Progress]:
    """Show a measurement on standard error: a changing line in a terminal, else one line from time to time."""
    if not shown:
        yield Progress(acquired, inputs, duration, lambda line: None, np.inf)
    elif not sys.stderr.isatty():
        yield Progress(acquired, inputs, duration, note, LINE_SECONDS)
    else:
        console = Terminal(stderr=True)
        with Live(console=console, transient=True, refresh_per_second=REFRESHES_PER_SECOND) as live:
            yield Progress(
                acquired,
                inputs,
                duration,
                lambda line: live.update(Text(line)),
                1.0 / REFRESHES_PER_SECOND,
            )

"""The part of a motion that a figure shows: from one instant to another, or a number of forcing periods."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import xarray as xr

from vibroimpact.analysis.figures.page import Floats
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.messages import Either, message, option_of

#: Number of forcing periods drawn from a longer record; more would overlap in one column.
SHOWN_PERIODS = 8
# Share of a period by which rounding may lengthen whole periods.
_ROUNDING = 1e-6
_FIRST, _LAST = (Either(name, option_of(name).removeprefix("--")) for name in ("start", "stop"))


@dataclass(frozen=True, slots=True)
class Window:
    """The window that the user requests; without a request, the first periods of a long record.

    Start and stop are in s, on the clock of the file; forcing periods count from the start, or back from the stop.
    """

    start: float | None = None
    stop: float | None = None
    periods: float | None = None

    def __post_init__(self) -> None:
        """Raise UsageError for an impossible window."""
        for name, value in ((_FIRST, self.start), (_LAST, self.stop), ("periods", self.periods)):
            if value is not None and not math.isfinite(value):
                raise UsageError(message("figure: ", name, f": expected a number, got {value}."))
        if self.periods is not None and self.periods <= 0.0:
            raise UsageError(f"figure: periods: expected a number > 0, got {self.periods:g}.")
        if None not in (self.start, self.stop, self.periods):
            raise UsageError(
                message(
                    *("figure: window: expected two of ", _FIRST, ", ", _LAST),
                    " and periods at most, got all three.",
                )
            )
        if self.start is not None and self.stop is not None and self.start >= self.stop:
            raise UsageError(
                message(
                    *("figure: window: expected ", _FIRST, " < ", _LAST),
                    f", got {self.start:g} and {self.stop:g}. Turn them round.",
                )
            )

    @property
    def given(self) -> bool:
        """Whether the user requested a part."""
        return (self.start, self.stop, self.periods) != (None, None, None)

    @staticmethod
    def whole(time: Floats) -> tuple[float, float]:
        """Return the first and last available instant, s."""
        return (float(time[0]), float(time[-1])) if len(time) else (math.nan, math.nan)

    def part(self, time: Floats, period: float | None = None) -> tuple[float, float]:
        """Return the first and last instant to draw (s), from ascending instants and a forcing period (s).

        UsageError: the window is empty or holds a single sample, or periods are given without a forcing.
        """
        first, last = self.whole(time)
        if self.periods is not None and period is None:
            raise UsageError(
                message(
                    "figure: periods: expected a scene with a forcing period, got none. "
                    f"Give a part of {first:.6g} to {last:.6g} s with ",
                    *(_FIRST, " and ", _LAST, "."),
                )
            )
        start, stop = self._ends(first, last, period)
        if int(((time >= start) & (time <= stop)).sum()) < 2 < len(time):
            raise UsageError(
                f"figure: window: expected a part of {first:.6g} to {last:.6g} s with two samples at least, "
                f"got {start:.6g} to {stop:.6g} s."
            )
        return max(start, first), min(stop, last)

    def _ends(self, first: float, last: float, period: float | None) -> tuple[float, float]:
        length = (self.periods or SHOWN_PERIODS) * period if period is not None else math.inf
        if not self.given:
            return first, first + (length if last - first > (1.0 + _ROUNDING) * length else last - first)
        start = first if self.start is None else self.start
        if self.periods is None:
            return start, last if self.stop is None else self.stop
        return (start, start + length) if self.stop is None else (self.stop - length, self.stop)


#: The window without a request.
ANY = Window()


class View(NamedTuple):
    """The contents of a figure: a run by its `run_index`, a recording of a replay, a window of time, and options."""

    run: int | None
    recording: str | None
    window: Window
    over: xr.Dataset | None = None
    segment: int | None = None
    variable: str | None = None

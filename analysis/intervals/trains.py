"""A train of events as intervals: observed window, masked spans, and the intervals that count."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.errors import EstimationError, UsageError

Floats = NDArray[np.float64]
Span = tuple[float, float]

FEWEST_EVENTS = 3


@dataclass(frozen=True, slots=True)
class IntervalTrain:
    """Events, the window in which they were observed, and its masked spans.

    Attributes
    ----------
    times : ndarray of float, shape (event,)
        s, ascending; events inside masked spans are left out.
    window : tuple of float
        Start and end of the observation, s.
    stated : bool
        Whether the window was given; otherwise it is the first and the last event, which then lie in it by definition.
    masked : tuple of (float, float)
        Spans without observation, s, ascending, not overlapping; a span of no length is a seam.
    kept : ndarray of bool, shape (event - 1,)
        Mask of the intervals without a masked instant.
    resolution : float
        Grid of the instants, s; 0: unknown.
    """

    times: Floats
    window: Span
    stated: bool
    masked: tuple[Span, ...]
    kept: NDArray[np.bool_]
    resolution: float

    @property
    def intervals(self) -> Floats:
        """Intervals that count, s, in their order."""
        return np.asarray(np.diff(self.times)[self.kept])

    @property
    def separated(self) -> Floats:
        """All intervals, s, with NaN for masked ones, which delay vectors must not cross."""
        return np.where(self.kept, np.diff(self.times), np.nan)

    @property
    def duration(self) -> float:
        """Seconds of observation, without the masked spans."""
        start, end = self.window
        return end - start - sum(min(b, end) - max(a, start) for a, b in self.masked if b > start and a < end)


def interval_train(
    times: Floats,
    *,
    window: Span | None = None,
    masked: Sequence[Span] = (),
    resolution: float = 0.0,
) -> IntervalTrain:
    """Return a checked train of events; arguments and errors as for `interval_report`.

    Examples
    --------
    >>> train = interval_train(np.array([0.0, 1.0, 2.0, 5.0, 6.0]), masked=[(3.0, 4.0)])
    >>> train.intervals, train.duration
    (array([1., 1., 1.]), 5.0)
    """
    instants = np.asarray(times, dtype=np.float64)
    if instants.ndim != 1 or not np.all(np.isfinite(instants)) or np.any(np.diff(instants) < 0.0):
        raise UsageError(
            "intervals: times: expected finite instants in ascending order, got others. Sort them."
        )
    if not resolution >= 0.0 or not np.isfinite(resolution):
        raise UsageError(f"intervals: resolution: expected 0 s or more, got {resolution}.")
    spans = _joined(masked)
    for start, end in spans:
        instants = instants[(instants <= start) | (instants >= end)]
    if len(instants) < FEWEST_EVENTS:
        raise EstimationError(
            f"intervals: expected at least {FEWEST_EVENTS} events outside the masked spans, got {len(instants)}."
        )
    if instants[0] == instants[-1]:
        raise EstimationError(
            f"intervals: expected events at different instants, got all at {instants[0]:g} s."
        )
    observed = _window(instants, window)
    kept = np.ones(len(instants) - 1, dtype=np.bool_)
    for start, end in spans:
        kept &= (instants[:-1] > start) | (instants[1:] < end)
    if not np.any(np.diff(instants)[kept] > 0.0):
        raise EstimationError(
            "intervals: expected one of more than 0 s without a masked instant in it, got none. Mask less."
        )
    return IntervalTrain(instants, observed, window is not None, spans, kept, float(resolution))


MOST_SEAMS = 10_000
"""Largest number of seams: recordings are joined from hours or days, and each seam costs an interval."""


def seams(period: float, window: Span, half_width: float = 0.0) -> tuple[Span, ...]:
    """Return the spans to mask around the multiples of a period, for example where files were joined.

    Parameters
    ----------
    period : float
        s, > 0.
    window : tuple of float
        Start and end of the observation, s; only multiples strictly between them count.
    half_width : float
        s; 0: only the interval across the seam is masked.

    Examples
    --------
    >>> seams(3600.0, (0.0, 9000.0))
    ((3600.0, 3600.0), (7200.0, 7200.0))
    """
    if not period > 0.0 or not half_width >= 0.0:
        raise UsageError(
            f"seams: expected a period > 0 s and a half width >= 0 s, got {period} and {half_width}."
        )
    if (window[1] - window[0]) / period > MOST_SEAMS:
        raise UsageError(
            f"seams: expected at most {MOST_SEAMS} of them in {window[1] - window[0]:g} s, got one each {period:g} s. "
            "Give the length of a part, s."
        )
    first, last = int(np.floor(window[0] / period)) + 1, int(np.ceil(window[1] / period))
    return tuple((k * period - half_width, k * period + half_width) for k in range(first, last))


def _window(instants: Floats, window: Span | None) -> Span:
    if window is None:
        window = (float(instants[0]), float(instants[-1]))
    start, end = float(window[0]), float(window[1])
    if not (start <= instants[0] and instants[-1] <= end and end > start):
        raise UsageError(
            f"intervals: window: expected a span around all events ({instants[0]:g} to {instants[-1]:g} s), "
            f"got {start:g} to {end:g} s."
        )
    return start, end


def _joined(masked: Sequence[Span]) -> tuple[Span, ...]:
    """Return the spans in order, with overlapping spans joined."""
    joined: list[Span] = []
    for start, end in sorted((float(a), float(b)) for a, b in masked):
        if not end >= start:
            raise UsageError(
                f"intervals: masked: expected spans (start, end) in s, got ({start:g}, {end:g})."
            )
        if joined and start <= joined[-1][1]:
            joined[-1] = (joined[-1][0], max(joined[-1][1], end))
        else:
            joined.append((start, end))
    return tuple(joined)

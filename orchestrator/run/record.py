"""What a body FMU of ours records during a run, and how it is fetched; the same for both drivers.

The body keeps impacts, sticks and periods as rows of eight numbers (`core/body/record.h`), so that no call into Python
or FMI is made for them.
"""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.fmi.variables import VariableGroup
from vibroimpact.orchestrator.importer.events import StepWatcher

ROW_WIDTH = 8
ROW_CAPACITY = 512
ROW_IMPACT, ROW_STICK, ROW_PERIOD, ROW_PEAK = 1.0, 2.0, 3.0, 4.0
IMPACT_WIDTH = 8
"""Columns of an impact: those of its row, and the largest force, whose row comes after it."""
_NOTHING: NDArray[np.float64] = np.empty(0)
OBSERVED = ("displacement", "velocity")
TOUCH_DOWN = ("last_time", "last_phase", "last_velocity")
"""What a contact port tells of the contact that goes on there: when (s, rad) and how fast (m/s) it began."""


class RunEnded(Exception):
    """A run ends before its end, with what it has: the samples of a block before its end, shape (sample, output)."""

    def __init__(self, samples: NDArray[np.float64] | None = None) -> None:
        self.samples = np.empty((0, 0)) if samples is None else samples
        super().__init__()


class ImpactLimitReached(RunEnded):
    """A run met `impact_limit` impacts, touch-downs and rests."""


class DeadlineReached(RunEnded):
    """A run took longer than its deadline."""


@dataclass(frozen=True, slots=True)
class _Limit:
    """What the runs of a block are given up by: a clock, and the most that one of them takes, s."""

    clock: Callable[[], float] = time.perf_counter
    most: float = math.inf


_UNLIMITED = _Limit()
_LIMIT: ContextVar[_Limit] = ContextVar("limit of runs")
_ABANDONED: ContextVar[float] = ContextVar("time at which runs are abandoned", default=math.inf)


class RunsAbandonedError(Exception):
    """Runs took longer than whoever asked for them wants to wait; nothing of them counts."""


@contextmanager
def runs_abandoned(time_of_it: float) -> Iterator[None]:
    """Abandon the runs of this thread that are under way at a time, s of `time.perf_counter`.

    Raises
    ------
    RunsAbandonedError
        In whatever runs then.
    """
    before = _ABANDONED.set(time_of_it)
    try:
        yield
    finally:
        _ABANDONED.reset(before)


def refuse_abandoned() -> None:
    """Raise RunsAbandonedError where the runs of this thread are abandoned."""
    if time.perf_counter() > _ABANDONED.get():
        raise RunsAbandonedError


@contextmanager
def runs_limited(most: float, clock: Callable[[], float]) -> Iterator[None]:
    """Give up each run of this thread that takes longer than `most` seconds of a clock.

    Deadlines of scenes count by that clock, too. Runs in other processes do not hear of it.

    Parameters
    ----------
    most : float
        s.
    clock : callable
        Returns the time since some instant, s: `time.process_time` for processor time.
    """
    before = _LIMIT.set(_Limit(clock, most))
    try:
        yield
    finally:
        _LIMIT.reset(before)


class Deadline:
    """The time at which a run is given up: wall time, or that of the clock of `runs_limited`."""

    def __init__(self) -> None:
        self.begin(None)

    def begin(self, seconds: float | None) -> None:
        """Give the run that begins so many seconds; None: as long as it takes."""
        limit = _LIMIT.get(_UNLIMITED)
        most = limit.most if seconds is None else min(seconds, limit.most)
        self._now = limit.clock
        self._end = math.inf if most == math.inf else self._now() + most

    @property
    def is_over(self) -> bool:
        """Whether the time is over."""
        refuse_abandoned()
        return self._now() > self._end

    def refuse_late(self) -> None:
        """Raise DeadlineReached when the time is over."""
        if self.is_over:
            raise DeadlineReached

    def look_on(self, step_start: float) -> None:
        """Look at the clock before a communication step: one step of a stiff component may take .1 s."""
        self.refuse_late()

    @property
    def watcher(self) -> StepWatcher:
        """What looks on at the steps of an importer."""
        return StepWatcher(self.look_on, lambda time, end: None, lambda: self._end - self._now())


def in_time_order(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return rows in the order of their first column, a time; rows of equal times keep their order.

    What lasts is recorded when it ends: a contact within which another one begins and ends comes after it.

    Examples
    --------
    >>> in_time_order(np.array([[1.2, 2.0], [0.8, 1.0], [1.2, 1.0]])).tolist()
    [[0.8, 1.0], [1.2, 2.0], [1.2, 1.0]]
    """
    time = rows[:, 0]
    return rows[np.argsort(time, kind="stable")] if (np.diff(time) < 0.0).any() else rows


def impact_rows(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the impacts of a record with the largest force of each, NaN where the stop does not yield; shape (n, 8).

    The rows, of eight columns, are as a body has written them: that of a largest force comes after that of its impact.
    """
    places = np.flatnonzero(rows[:, 0] == ROW_IMPACT)
    found = np.full((len(places), IMPACT_WIDTH), np.nan)
    found[:, :-1] = rows[places, 1:]
    has_peak = np.append(rows[1:, 0] == ROW_PEAK, False)[places]
    found[has_peak, -1] = rows[places[has_peak] + 1, 3]
    return found


def open_contacts(
    touch_downs: NDArray[np.float64], contacts: NDArray[np.floating[Any]]
) -> NDArray[np.float64]:
    """Return the impacts of contacts that are open, shape (n, 8): all that is known at their end is NaN.

    The rows of `touch_downs` have the columns `TOUCH_DOWN`; contacts are numbered from 1.

    Examples
    --------
    >>> open_contacts(np.array([[2.0, 0.5, 0.1]]), np.array([1.0])).tolist()
    [[2.0, 0.5, 0.1, nan, 1.0, nan, nan, nan]]
    """
    rows = np.full((len(contacts), IMPACT_WIDTH), np.nan)
    rows[:, :3], rows[:, 4] = touch_downs, contacts
    return rows


@dataclass(slots=True)
class Rows:
    """Rows taken from a body's record, in the order they were written; shape (row, 8) each."""

    blocks: list[NDArray[np.float64]] = field(default_factory=list)

    def impacts(self) -> NDArray[np.float64]:
        """Return the impacts with their largest forces, shape (n, 8)."""
        return impact_rows(np.concatenate([np.empty((0, ROW_WIDTH)), *self.blocks]))

    def of_kind(self, kind: float) -> NDArray[np.float64]:
        """Return the rows of one kind without the column of the kind, shape (n, 7)."""
        rows = np.concatenate(self.blocks) if self.blocks else np.empty((0, ROW_WIDTH))
        chosen: NDArray[np.float64] = rows[rows[:, 0] == kind, 1:]
        return chosen


class RecordedBody(ABC):
    """A body whose runs are driven; its subclasses say how it is stepped.

    `group` makes a group of the body's variables: kind, names, number of values (None: one for each name). `warnings`
    are what the body had to say when the run began; they go with the results.
    """

    def __init__(self, group: Callable[[str, Sequence[str], int | None], VariableGroup]) -> None:
        self._group_of = group
        self._observed = group("Float64", OBSERVED, None)
        self._switches = group("Boolean", ("record.impacts", "record.extrema", "record.periods"), None)
        self._counts = group("Int64", ("record.count", "record.dropped"), None)
        self._taken = group("Int64", ("record.taken",), None)
        self._rows = group("Float64", ("record.rows",), ROW_CAPACITY * ROW_WIDTH)
        self._table = self._rows.values.reshape(ROW_CAPACITY, ROW_WIDTH)
        self.rows = Rows()
        self.warnings: tuple[str, ...] = ()
        self._deadline = Deadline()
        self.watch(contacts=0)

    def watch(
        self,
        *,
        contacts: int,
        sampled: Sequence[str] = (),
        state: Sequence[str] = (),
        energies: bool = False,
        slowest: bool = False,
    ) -> None:
        """Say what of the body is read; nothing else costs a call.

        `contacts` is the number of ports in use, `sampled` are the variables of a time series. `state` are those that
        are the whole state, where it is more than the observed point. `energies` has the body follow its energies while
        it records; `slowest` says that it can tell its lowest natural frequency.
        """
        ports = [f"contact[{k}]" for k in range(1, contacts + 1)]
        self._stuck = self._some("Boolean", [f"{port}.stuck" for port in ports])
        self._stick_starts = self._some("Float64", [f"{port}.stick_start" for port in ports])
        self._open = self._some("Boolean", [f"{port}.open" for port in ports])
        self._touch_downs = self._some("Float64", [f"{port}.{name}" for port in ports for name in TOUCH_DOWN])
        self._sampled, self._sampled_names = self._some("Float64", sampled), tuple(sampled)
        self._state = self._some("Float64", state)
        self._energies = self._some("Boolean", ["record.energies"] if energies else [])
        self._slowest = self._some("Float64", ["natural_angular_frequency[1]"] if slowest else [])

    def _some(self, kind: str, names: Sequence[str]) -> VariableGroup | None:
        return self._group_of(kind, names, None) if names else None

    @property
    @abstractmethod
    def time(self) -> float:
        """The time reached, s."""

    @property
    @abstractmethod
    def hashes(self) -> dict[str, str]:
        """SHA-256 of each component's FMU, by component."""

    @abstractmethod
    def begin(self, floats: Mapping[str, float], deadline: float | None) -> None:
        """Start a run at time 0 with these real parameters; it may take `deadline` seconds of wall time."""

    @abstractmethod
    def advance(self, end: float) -> None:
        """Advance to time `end`, s, looking at the clock and for signals on the way.

        ImpactLimitReached, DeadlineReached: the run ends before.
        """

    @abstractmethod
    def close(self) -> None:
        """Free what is driven."""

    def inputs(self, names: Sequence[str]) -> VariableGroup:
        """Return the body's real inputs of these names as a group: fill its buffer, then `set`."""
        return self._group_of("Float64", names, None)

    def record(self, *, impacts: bool, extrema: bool, periods: bool) -> None:
        """Begin a recording: say what the body records from now on; its energies count from here."""
        for switches in ((False, False, False), (impacts, extrema, periods)):
            self._switches.values[:] = switches
            self._switches.set()
        if self._energies is not None:
            self._energies.values[:] = True
            self._energies.set()

    def take_rows(self) -> None:
        """Take the rows that the body has recorded since the last time.

        ComponentError: rows are lost, as whoever drives the body has not emptied its record in time.
        """
        count, lost = self._counts.get().tolist()
        if lost:
            raise ComponentError(f"body: expected all rows of its record, {lost} are lost.", instance="body")
        if count:
            self._rows.get()
            self.rows.blocks.append(self._table[:count].copy())
            self._taken.values[0] = count
            self._taken.set()

    def impacts(self) -> NDArray[np.float64]:
        """Return the impacts so far by time of touch-down, shape (n, 8): columns `schema.IMPACT_COLUMNS`.

        A contact that is open has no impulse, restitution, duration and largest force yet: NaN.
        """
        self.take_rows()
        return in_time_order(np.concatenate([self.rows.impacts(), self._contacts_open()]))

    def _contacts_open(self) -> NDArray[np.float64]:
        """Return the contacts with stops that yield that began in the recording and go on, shape (n, 8)."""
        if self._open is None or self._touch_downs is None or self._stuck is None:
            return np.empty((0, IMPACT_WIDTH))
        going = np.flatnonzero(self._open.get() & ~self._stuck.get())
        if not len(going):
            return np.empty((0, IMPACT_WIDTH))
        return open_contacts(self._touch_downs.get().reshape(-1, len(TOUCH_DOWN))[going], going + 1.0)

    def sticks(self) -> NDArray[np.float64]:
        """Return the sticks so far by their start, shape (n, 3): start, end (NaN: not ended), contact."""
        self.take_rows()
        ended = self.rows.of_kind(ROW_STICK)[:, :3]
        of_recording: list[bool] = [] if self._open is None else self._open.get().tolist()
        still = [
            (start, np.nan, float(contact))
            for contact, start in self.sticks_open()
            if of_recording[contact - 1]
        ]
        return in_time_order(np.concatenate([ended, np.array(still).reshape(-1, 3)]))

    def observed(self) -> tuple[float, float]:
        """Return displacement (m) and velocity (m/s) of the observed point."""
        displacement, velocity = self._observed.get()
        return float(displacement), float(velocity)

    def advance_sampling(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Advance from one instant to the next, as `advance`; return the sampled variables, shape (instant, variable).

        The times ascend, s; the first is not before the time reached. ImpactLimitReached, DeadlineReached have the
        samples so far.
        """
        rows: list[NDArray[np.float64]] = []
        try:
            for end in times.tolist():
                self.advance(end)
                rows.append(self.sampled().copy())
        except RunEnded as reached:
            reached.samples = np.array(rows)
            raise
        return np.array(rows)

    def sampled(self) -> NDArray[np.float64]:
        """Return the present values of the sampled variables; the buffer is used again at the next call."""
        return _NOTHING if self._sampled is None else self._sampled.get()

    def values_of(self, names: Sequence[str]) -> NDArray[np.float64]:
        """Return the present values of real variables of the body."""
        return self._group_of("Float64", names, None).get().copy() if names else _NOTHING

    def whole_state(self) -> NDArray[np.float64] | None:
        """Return the whole state; None where the observed point is all of it."""
        return None if self._state is None else self._state.get().copy()

    def slowest(self) -> float:
        """Return the lowest natural angular frequency, rad/s; 0 where the body does not tell it."""
        return 0.0 if self._slowest is None else float(self._slowest.get()[0])

    def sticks_open(self) -> list[tuple[int, float]]:
        """Return the contacts (1-based) that the body rests on, with the time it came to rest, s."""
        if self._stuck is None or self._stick_starts is None:
            return []
        stuck, starts = self._stuck.get(), self._stick_starts.get()
        return [(k + 1, float(starts[k])) for k in range(len(stuck)) if stuck[k]]

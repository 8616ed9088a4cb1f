"""The record of a run inside one of the package's body FMUs, and its transfer to Python; the same for both drivers.

The body keeps impacts, sticks and periods as rows of eight numbers (`core/body/record.h`), without calls of Python or
FMI.
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
ROW_IMPACT, ROW_STICK, ROW_PERIOD, ROW_PEAK, ROW_FURTHER = 1.0, 2.0, 3.0, 4.0, 5.0
IMPACT_WIDTH = 8
"""Number of columns of an impact: the seven of its row, and the largest force from the row after it."""
_NOTHING: NDArray[np.float64] = np.empty(0)
OBSERVED = ("displacement", "velocity")
TOUCH_DOWN = ("last_time", "last_phase", "last_velocity")
"""Outputs of a contact port for its open contact: time (s), phase (rad) and velocity (m/s) of the touch-down."""


class RunEnded(Exception):
    """A run ends early; `samples` are the samples of the last block until then, shape (sample, output)."""

    def __init__(self, samples: NDArray[np.float64] | None = None) -> None:
        self.samples = np.empty((0, 0)) if samples is None else samples
        super().__init__()


class ImpactLimitReached(RunEnded):
    """A run met `impact_limit` impacts, touch-downs and rests."""


class UnboundedMotion(RunEnded):
    """A motion that grows can meet no stop any more, or has passed its limit; `reason` is in the words of the body."""

    def __init__(self, reason: str, samples: NDArray[np.float64] | None = None) -> None:
        super().__init__(samples)
        self.reason = reason


class DeadlineReached(RunEnded):
    """A run took longer than its deadline."""


@dataclass(frozen=True, slots=True)
class _Limit:
    """The limit of the runs of a block: a clock, and the longest time of one run, s."""

    clock: Callable[[], float] = time.perf_counter
    most: float = math.inf


_UNLIMITED = _Limit()
_LIMIT: ContextVar[_Limit] = ContextVar("limit of runs")
_ABANDONED: ContextVar[Callable[[], bool] | None] = ContextVar("whether runs are abandoned", default=None)


class RunsAbandonedError(Exception):
    """The caller of runs waits for them no longer; their results do not count."""


@contextmanager
def runs_abandoned(is_over: Callable[[], bool]) -> Iterator[None]:
    """Abandon the run of this thread that is under way as soon as `is_over` returns True.

    Raises
    ------
    RunsAbandonedError
        Raised inside the run that is under way then.
    """
    before = _ABANDONED.set(is_over)
    try:
        yield
    finally:
        _ABANDONED.reset(before)


def refuse_abandoned() -> None:
    """Raise RunsAbandonedError if the runs of this thread are abandoned."""
    is_over = _ABANDONED.get()
    if is_over is not None and is_over():
        raise RunsAbandonedError


@contextmanager
def runs_limited(most: float, clock: Callable[[], float]) -> Iterator[None]:
    """Give up each run of this thread that takes longer than `most` seconds of a clock.

    Deadlines of scenes use this clock, too. Runs in other processes are not limited.

    Parameters
    ----------
    most : float
        Longest time of a run, s.
    clock : callable
        Returns the time since some instant, s: `time.process_time` for processor time.
    """
    before = _LIMIT.set(_Limit(clock, most))
    try:
        yield
    finally:
        _LIMIT.reset(before)


class Deadline:
    """The time at which a run is given up, by wall time or by the clock of `runs_limited`."""

    def __init__(self) -> None:
        self.begin(None)

    def begin(self, seconds: float | None) -> None:
        """Start the clock of a run that may take `seconds`; None: no limit."""
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
        """Raise DeadlineReached if the time is over."""
        if self.is_over:
            raise DeadlineReached

    def look_on(self, step_start: float) -> None:
        """Check the clock before a communication step: one step of a stiff component may take 0.1 s."""
        self.refuse_late()

    @property
    def watcher(self) -> StepWatcher:
        """Watcher that checks the clock at the steps of an importer."""
        return StepWatcher(self.look_on, lambda time, end: None, lambda: self._end - self._now())


def in_time_order(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return rows in the order of their first column, a time; rows of equal times keep their order.

    A lasting contact is recorded at its end: it comes after another contact that begins and ends within it.

    Examples
    --------
    >>> in_time_order(np.array([[1.2, 2.0], [0.8, 1.0], [1.2, 1.0]])).tolist()
    [[0.8, 1.0], [1.2, 2.0], [1.2, 1.0]]
    """
    time = rows[:, 0]
    return rows[np.argsort(time, kind="stable")] if (np.diff(time) < 0.0).any() else rows


def impact_rows(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the impacts of a record with their largest forces, NaN at rigid stops; shape (n, 8).

    The rows, of eight columns, are in the order of the body, which writes a largest force right after its impact.
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
    """Return the impacts of open contacts, shape (n, 8); quantities known only at the end of a contact are NaN.

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
    """Blocks of rows taken from a body's record, in the order of writing; shape (row, 8) each."""

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
    """A body whose runs are driven; its subclasses step it.

    `group` makes a group of the body's variables: kind, names, number of values (None: one for each name). `warnings`
    are the messages of the body at the start of the run; they go with the results.
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
        slowest: str = "",
    ) -> None:
        """Choose the variables of the body that are read; other variables cost no calls.

        `contacts` is the number of ports in use, `sampled` are the variables of a time series. `state` has the
        variables of the whole state, where it is more than the observed point. With `energies` the body follows its
        energies during a recording; `slowest` is the variable that has, or begins with, its lowest frequency.
        """
        ports = [f"contact[{k}]" for k in range(1, contacts + 1)]
        self._stuck = self._some("Boolean", [f"{port}.stuck" for port in ports])
        self._stick_starts = self._some("Float64", [f"{port}.stick_start" for port in ports])
        self._open = self._some("Boolean", [f"{port}.open" for port in ports])
        self._touch_downs = self._some("Float64", [f"{port}.{name}" for port in ports for name in TOUCH_DOWN])
        self._sampled, self._sampled_names = self._some("Float64", sampled), tuple(sampled)
        self._state = self._some("Float64", state)
        self._energies = self._some("Boolean", ["record.energies"] if energies else [])
        self._slowest = self._some("Float64", [slowest] if slowest else [])

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
        """Advance to time `end`, s, with checks of the clock and of signals on the way.

        ImpactLimitReached, DeadlineReached: the run ends earlier.
        """

    @abstractmethod
    def close(self) -> None:
        """Free the components."""

    def inputs(self, names: Sequence[str]) -> VariableGroup:
        """Return the body's real inputs of these names as a group: fill its buffer, then call `set`."""
        return self._group_of("Float64", names, None)

    def record(self, *, impacts: bool, extrema: bool, periods: bool) -> None:
        """Begin a recording of the given kinds of rows; the energies of the body count from here."""
        for switches in ((False, False, False), (impacts, extrema, periods)):
            self._switches.values[:] = switches
            self._switches.set()
        if self._energies is not None:
            self._energies.values[:] = True
            self._energies.set()

    def take_rows(self) -> None:
        """Take the rows that the body has recorded since the last call.

        ComponentError: rows are lost, as the driver has not emptied the record in time.
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

        An open contact has NaN for impulse, restitution, duration and largest force, which are not known yet.
        """
        self.take_rows()
        return in_time_order(np.concatenate([self.rows.impacts(), self._contacts_open()]))

    def _contacts_open(self) -> NDArray[np.float64]:
        """Return the open contacts with compliant stops that began in the recording, shape (n, 8)."""
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
        """Advance through all instants, as by `advance`; return the sampled variables, shape (instant, variable).

        The times ascend, s; the first is not before the time reached. ImpactLimitReached, DeadlineReached: the run ends
        early; the error has the samples so far.
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
        """Return the present values of the sampled variables; the next call overwrites the buffer."""
        return _NOTHING if self._sampled is None else self._sampled.get()

    def values_of(self, names: Sequence[str]) -> NDArray[np.float64]:
        """Return the present values of real variables of the body."""
        return self._group_of("Float64", names, None).get().copy() if names else _NOTHING

    def whole_state(self) -> NDArray[np.float64] | None:
        """Return the whole state; None where the observed point is the whole state."""
        return None if self._state is None else self._state.get().copy()

    def slowest(self) -> float:
        """Return the lowest natural angular frequency, rad/s; 0 where it is not read."""
        return 0.0 if self._slowest is None else float(self._slowest.get()[0])

    def sticks_open(self) -> list[tuple[int, float]]:
        """Return the contacts (1-based) on which the body rests, each with the start of the rest, s."""
        if self._stuck is None or self._stick_starts is None:
            return []
        stuck, starts = self._stuck.get(), self._stick_starts.get()
        return [(k + 1, float(starts[k])) for k in range(len(stuck)) if stuck[k]]

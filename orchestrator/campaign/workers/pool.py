"""Workers that take pieces of work and return their results, on any `cluster`.

A campaign submits work and takes finished work, which may be marked as lost with its worker.
"""

from __future__ import annotations

import queue
import time
from collections.abc import Callable, Set
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass
from typing import Any

from distributed import CancelledError, Client, Future
from distributed.comm.core import CommClosedError
from distributed.scheduler import KilledWorker

from vibroimpact.fmus.errors import CampaignError, UsageError, WorkersGoneError
from vibroimpact.fmus.messages import CALL, message
from vibroimpact.orchestrator.run.progress import Progress

WORKERLESS_SECONDS = 30.0
"""Time without any worker, s, after which a campaign gives up."""

LOOK_SECONDS = 1.0
"""Time between two checks of the present workers, s."""

ASK_SECONDS = 0.05
"""Time between two checks of workers and their answers while workers get ready, s."""

RESULT_SECONDS = 10.0
"""Time without the result of a finished call, s, after which its worker counts as gone."""

SUSPENDED_SECONDS = 10.0
"""Time between two checks, s, normally about a second, above which this process was suspended in between."""

DEAD_SECONDS = 5.0
"""Time with a dead worker of this machine, s, after which a new worker replaces it."""

STALL_SECONDS = 10.0
"""Time without finished work, s, after which the pool asks whether any worker computes."""

IDLE_LOOKS = 3
"""Number of idle answers in a row, from which on the connections count as stalled."""

MOST_RESTARTS = 3
"""Number of restarts in a row without finished work; the next stall ends the campaign."""

MOST_REPLACEMENTS = 50
"""Largest number of replaced workers in a campaign; after that, the living workers go on alone."""

MOST_DEATHS = 5
"""Deaths per worker while workers get ready, above which the scene counts as the cause."""


UNREADABLE = "Error during deserialization"
"""Start of Dask's error message where a scheduler or a worker lacks a package."""


@dataclass(frozen=True, slots=True)
class Finished:
    """A finished piece of work: its ticket, and its result or its error."""

    ticket: int
    result: Any = None
    error: BaseException | None = None
    worker_lost: bool = False


@dataclass(frozen=True, slots=True)
class Cluster:
    """A client and, for workers of this machine, their number and a function that replaces dead workers."""

    client: Client
    size: int = 0
    replace_dead: Callable[[], None] = lambda: None


class WorkerPool:
    """Workers of one Dask cluster, one piece of work at a time on each.

    `where` names the cluster in messages; `progress` gets the number of lost workers, `lost_workers`. Local workers are
    processes of this command. `connection` closes the connection, also after the pool has connected anew.
    """

    def __init__(
        self, connect: Callable[[], AbstractContextManager[Cluster]], where: str, progress: Progress
    ) -> None:
        self._connect = connect
        self._where = where
        self._progress = progress
        self._calls: dict[int, tuple[Any, ...]] = {}
        self._futures: dict[int, Future[Any]] = {}
        self._tickets = self._replacements = self._restarts = 0
        self.lost_workers = 0
        self.is_local = False
        self.connection = ExitStack()
        self._open()

    def _open(self) -> None:
        self._cluster = self.connection.enter_context(self._connect())
        self._client, self.is_local = self._cluster.client, self._cluster.size > 0
        self._ended: queue.SimpleQueue[int] = queue.SimpleQueue()
        self._present: frozenset[str] = frozenset()
        self._looked = self._last_present = self._last_complete = self._last_moved = time.monotonic()

    def worker_addresses(self) -> tuple[str, ...]:
        """Return the addresses of the present workers, and count the workers that have gone.

        WorkersGoneError: no worker, or no scheduler, has been present for `WORKERLESS_SECONDS`.
        """
        self._leave_out_suspension()
        there = self._workers_there()
        self._looked = time.monotonic()
        if there is not None:
            if lost := len(self._present - there):
                self.lost_workers += lost
                self._progress.lost_workers(self.lost_workers)
            self._present = there
            self._replace_dead()
        if there:
            self._last_present = self._looked
        elif self._looked - self._last_present > WORKERLESS_SECONDS:
            raise WorkersGoneError(
                message(
                    f"{self._where}: expected at least one worker, got none for {WORKERLESS_SECONDS:.0f} s. "
                    "Start workers; then the same ",
                    CALL,
                    " resumes.",
                )
            )
        return tuple(sorted(there or ()))

    def _workers_there(self) -> frozenset[str] | None:
        """Return the addresses of the scheduler's workers; None where the scheduler does not answer.

        `Client.scheduler_info` is not used: it may return the answer to another call, which has no workers.
        """
        if self._client.scheduler is None:
            return None
        identity = self._client.scheduler.identity
        try:
            answer = self._client.sync(identity, n_workers=-1, callback_timeout=RESULT_SECONDS)
        except OSError:
            return None
        return frozenset(answer["workers"])

    def _leave_out_suspension(self) -> None:
        """Subtract from all waiting times the time in which this process was suspended (Ctrl-Z, sleep)."""
        away = time.monotonic() - self._looked
        if away > SUSPENDED_SECONDS:
            self._last_present += away
            self._last_complete += away
            self._last_moved += away

    def _replace_dead(self) -> None:
        if len(self._present) >= self._cluster.size:
            self._last_complete = self._looked
        elif self._looked - self._last_complete > DEAD_SECONDS and self._replacements < MOST_REPLACEMENTS:
            self._last_complete = self._looked
            self._replacements += 1
            self._cluster.replace_dead()

    def wait_for_workers(self) -> None:
        """Wait until a worker is present."""
        while not self.worker_addresses():
            time.sleep(ASK_SECONDS)

    def call_everywhere(self, function: Callable[..., Any], *arguments: Any) -> dict[str, Any]:
        """Call a function once on each worker, in its working thread; return the results by address.

        A worker that dies meanwhile is left out; its replacement is called, too. CampaignError: workers die again and
        again. UsageError: scheduler or workers lack this package.
        """
        calls: dict[str, Future[Any]] = {}
        answers: dict[str, Any] = {}
        began, lost_before = time.monotonic(), self.lost_workers
        while True:
            present = self.worker_addresses()
            self._refuse_deadly_start(self.lost_workers - lost_before)
            gone = [calls.pop(address) for address in calls.keys() - set(present)]
            self._client.cancel(gone, force=True)
            for address in set(present) - calls.keys():
                calls[address] = self._client.submit(function, *arguments, workers=[address], pure=False)
            answers = {address: answer for address, answer in answers.items() if address in calls}
            answers |= self._new_answers(calls, calls.keys() - answers.keys())
            if calls and len(answers) == len(calls) and self._is_complete(began):
                return answers
            waiting = [call for address, call in calls.items() if address not in answers]
            if waiting and self._is_stalled() and not any(call.done() for call in waiting):
                self._restart()
                calls, answers = {}, {}

    def _new_answers(self, calls: dict[str, Future[Any]], waiting: Set[str]) -> dict[str, Any]:
        """Return the answers that have arrived after a short wait; lost calls are removed from `calls`."""
        answers = {}
        time.sleep(ASK_SECONDS)
        for address in waiting:
            if not calls[address].done():
                continue
            try:
                answers[address] = calls[address].result(timeout=RESULT_SECONDS)
                self._moved()
            except (TimeoutError, CancelledError, KilledWorker):
                del calls[address]
            except (ImportError, RuntimeError) as error:
                self._refuse_strangers(error)
                raise
        return answers

    def _refuse_strangers(self, error: Exception) -> None:
        """Raise UsageError if the error shows a scheduler or a worker that cannot read its messages."""
        if isinstance(error, ImportError) or str(error).startswith(UNREADABLE):
            raise UsageError(
                f"{self._where}: expected a scheduler and workers with the packages of this process, got some that "
                "cannot read the work. Install vibroimpact where they run, and the same versions of dask and "
                "distributed. See docs/scaling.md."
            ) from error

    def _is_complete(self, began: float) -> bool:
        """Return whether all workers are present, or the time to wait for missing workers is over."""
        return len(self._present) >= self._cluster.size or time.monotonic() - began > WORKERLESS_SECONDS

    def _refuse_deadly_start(self, deaths: int) -> None:
        if deaths > MOST_DEATHS * max(self._cluster.size, len(self._present), 1):
            raise CampaignError(
                f"{self._where}: expected workers that live until the first point, got {deaths} that died while "
                "they loaded the components. `vibroimpact run` shows whether a component of the scene ends its "
                "process; a lack of memory does it too."
            )

    def submit(self, function: Callable[..., Any], *arguments: Any) -> int:
        """Queue a call for the first free worker; return the ticket of its `Finished`."""
        self._tickets += 1
        self._calls[self._tickets] = (function, *arguments)
        self._send(self._tickets)
        return self._tickets

    def _send(self, ticket: int) -> None:
        self._futures[ticket] = self._client.submit(*self._calls[ticket], pure=False)
        self._announce(ticket)

    def _announce(self, ticket: int) -> None:
        ended = self._ended
        self._futures[ticket].add_done_callback(lambda _future: ended.put(ticket))

    def next_finished(self) -> Finished:
        """Wait for the next finished piece of work and return it; WorkersGoneError: see `worker_addresses`."""
        while True:
            if time.monotonic() - self._looked > LOOK_SECONDS:
                self.worker_addresses()
            try:
                ticket = self._ended.get(timeout=LOOK_SECONDS)
            except queue.Empty:
                if self._is_stalled() and self._ended.empty():
                    self._restart()
                continue
            self._last_moved = time.monotonic()
            finished = self._finished_work(ticket, self._futures[ticket])
            if finished is not None:
                del self._futures[ticket], self._calls[ticket]
                self._moved()
                return finished

    def _moved(self) -> None:
        """Reset the clock and the restarts of stalls, since a piece of work has ended."""
        self._last_moved = time.monotonic()
        self._restarts = 0

    def _finished_work(self, ticket: int, future: Future[Any]) -> Finished | None:
        """Return a finished piece of work; None if it is under way again."""
        try:
            if future.status != "lost":
                return Finished(ticket, result=future.result(timeout=RESULT_SECONDS))
        except KilledWorker as error:
            return Finished(ticket, error=error, worker_lost=True)
        except (CancelledError, CommClosedError) as error:
            raise WorkersGoneError(
                message(
                    f"{self._where}: expected a scheduler that stays up, got none any more. The same ",
                    CALL,
                    " resumes.",
                )
            ) from error
        except Exception as error:
            # The work itself raised an error: the caller handles it.
            if future.status == "error" or not isinstance(error, TimeoutError):
                return Finished(ticket, error=error)
        # The worker died with the result in its memory; another worker computes it already.
        self._announce(ticket)
        return None

    def _is_stalled(self) -> bool:
        """Return whether no worker computes although work is out: a message is missing, or a worker hangs.

        Dask sends a message when the wall clock passes a deadline, so never after the clock was set back. A worker that
        imports modules may answer late, when its work has ended already. The caller therefore checks for finished work
        afterwards.
        """
        if time.monotonic() - self._last_moved < STALL_SECONDS or not self._present:
            return False
        for _ in range(IDLE_LOOKS):
            if not self._is_idle():
                self._last_moved = time.monotonic()
                return False
            time.sleep(LOOK_SECONDS)
        return True

    def _is_idle(self) -> bool:
        """Return whether no worker computes, or a worker does not answer, by a direct call of the scheduler.

        A worker answers while it computes, since the call of a point leaves its other threads free.
        """
        scheduler = self._client.scheduler
        if scheduler is None:
            return False
        try:
            return not self._client.sync(scheduler.call_stack, keys=None, callback_timeout=RESULT_SECONDS)
        except TimeoutError:
            return True
        except OSError:
            return False

    def _restart(self) -> None:
        """Connect anew and send all work again; a chunk computed twice gives the same part."""
        stalled = CampaignError(
            message(
                f"{self._where}: expected workers that compute, got some that wait, or do not answer, while work is "
                "there. Was a clock set back? The same ",
                CALL,
                " resumes.",
            )
        )
        if self._restarts == MOST_RESTARTS:
            raise stalled
        self._restarts += 1
        self._progress.note(
            f"{self._where}: nothing moves although work is there, as after a clock that was set back; "
            "connecting to the workers anew."
        )
        self.connection.__exit__(CampaignError, stalled, None)
        self._open()
        self.wait_for_workers()
        for ticket in self._calls:
            self._send(ticket)

    def cancel_all(self) -> None:
        """Withdraw all work that has not begun."""
        futures = list(self._futures.values())
        self._futures.clear()
        self._calls.clear()
        if futures:
            self._client.cancel(futures, force=True)

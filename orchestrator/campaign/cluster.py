"""The door to Dask: workers that take chunks of a campaign and hand back what became of them.

No other module imports dask or distributed. A campaign sees a `WorkerPool`: submit work, take finished work,
know when a worker was lost. Where the workers live (embedded in this machine or behind a scheduler's
address) makes no difference to it.

docs/clusters.md says where the time goes that two workers lose to two bare processes, and what `QUIET` is for.
"""

from __future__ import annotations

import logging
import os
import queue
import signal
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Set
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import dask
from distributed import CancelledError, Future, LocalCluster
from distributed import Client as Client
from distributed.comm.core import CommClosedError
from distributed.scheduler import KilledWorker
from distributed.security import Security

from vibroimpact.analysis.files.scratch import ScratchFolder
from vibroimpact.fmus.errors import CampaignError, UsageError
from vibroimpact.fmus.python_child import safe_module_path
from vibroimpact.fmus.wording import option, typed_or_called
from vibroimpact.orchestrator.campaign.dask_settings import QUIET
from vibroimpact.orchestrator.campaign.lone_process import interrupts_blocked
from vibroimpact.orchestrator.campaign.progress import Progress

CONNECT_SECONDS = 5.0
"""How long a scheduler may take to answer before it counts as absent."""

WORKERLESS_SECONDS = 30.0
"""How long a campaign waits for a first or a new worker before it gives up, s."""

STOP_SECONDS = 3.0
"""How long a worker may take to stop by itself before it is killed, s."""

LOOK_SECONDS = 1.0
"""How often the pool looks which workers are there, s."""

ASK_SECONDS = 0.05
"""How often the pool looks for workers and answers while they get ready, s."""

RESULT_SECONDS = 10.0
"""How long the answer of a finished call may take to arrive; after that its worker counts as gone, s."""

SUSPENDED_SECONDS = 10.0
"""Time between two looks, which come every second or so, above which this process was suspended meanwhile, s."""

DEAD_SECONDS = 5.0
"""How long one of our own workers may be dead before another one is started in its place, s."""

STALL_SECONDS = 10.0
"""How long nothing may end before the pool asks whether anything is being computed, s."""

IDLE_LOOKS = 3
"""How often in a row the answer must be no, before the connections count as stalled."""

MOST_RESTARTS = 3
"""Stalls in a row, without a piece of work that ended, that end the campaign."""

MOST_REPLACEMENTS = 50
"""How often in a campaign workers are started in place of dead ones; then the others go on alone."""

MOST_STARTS = 5
"""How often the workers of this machine are started before a start that fails is an error."""

MOST_DEATHS = 5
"""Deaths for each worker, while all get ready, at which the scene counts as what kills them."""


@dataclass(frozen=True, slots=True)
class Finished:
    """A piece of work that ended: its ticket, and its result or its error."""

    ticket: int
    result: Any = None
    error: BaseException | None = None
    worker_lost: bool = False


@dataclass(frozen=True, slots=True)
class _Cluster:
    """A client and, where the workers are our own, their number and what replaces those that stay dead."""

    client: Client
    size: int = 0
    replace_dead: Callable[[], None] = lambda: None


class WorkerPool:
    """Workers of one Dask cluster, one piece of work at a time on each.

    Parameters
    ----------
    connect : callable
        Opens a connection to the workers.
    where : str
        Where the workers are, for messages.
    progress : Progress
        Told of workers that were lost.

    Attributes
    ----------
    lost_workers : int
        How many died so far.
    is_local : bool
        Whether the workers are processes of this command.
    connection : ExitStack
        What closes the connection; a pool that connects anew goes on with it.
    """

    def __init__(
        self, connect: Callable[[], AbstractContextManager[_Cluster]], where: str, progress: Progress
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
        """Return the addresses of the workers that are there now; take note of those that are not any more.

        Raises
        ------
        CampaignError
            When no worker, or no scheduler, has been there for `WORKERLESS_SECONDS`.
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
            raise CampaignError(
                f"{self._where}: expected at least one worker, got none for {WORKERLESS_SECONDS:.0f} s. "
                f"Start workers; then the same {typed_or_called('command', 'call')} resumes."
            )
        return tuple(sorted(there or ()))

    def _workers_there(self) -> frozenset[str] | None:
        """Return the addresses of the workers that the scheduler has; None where it does not answer.

        What `Client.scheduler_info` returns may be the answer to another call of the client, which has no workers.
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
        """Count as no waiting what passed while this process was stopped: Ctrl-Z, or a computer that slept."""
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
        """Wait until a worker is there."""
        while not self.worker_addresses():
            time.sleep(ASK_SECONDS)

    def call_everywhere(self, function: Callable[..., Any], *arguments: Any) -> dict[str, Any]:
        """Call a function once on each worker, in the thread that will also do the work.

        A worker that dies meanwhile is not waited for; the one that comes in its place is asked too.

        Returns
        -------
        dict of str to object
            What each worker, named by its address, returned.

        Raises
        ------
        CampaignError
            When workers die again and again.
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
            if waiting and self._is_stalled(partial(_any_is_done, waiting)):
                self._restart()
                calls, answers = {}, {}

    def _new_answers(self, calls: dict[str, Future[Any]], waiting: Set[str]) -> dict[str, Any]:
        """Return the answers that are there after a while; a call that was lost is taken out of `calls`."""
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
        return answers

    def _is_complete(self, began: float) -> bool:
        """Return whether all workers are there, or those that are missing have been waited for."""
        return len(self._present) >= self._cluster.size or time.monotonic() - began > WORKERLESS_SECONDS

    def _refuse_deadly_start(self, deaths: int) -> None:
        if deaths > MOST_DEATHS * max(self._cluster.size, len(self._present), 1):
            raise CampaignError(
                f"{self._where}: expected workers that live until the first point, got {deaths} that died while "
                "they loaded the components. `vibroimpact run` shows whether a component of the scene ends its "
                "process; a lack of memory does it too."
            )

    def submit(self, function: Callable[..., Any], *arguments: Any) -> int:
        """Queue a call on whichever worker is free first; return the ticket of its `Finished`."""
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
        """Wait for the next piece of work to end.

        Raises
        ------
        CampaignError
            When no worker, or no scheduler, has been there for `WORKERLESS_SECONDS`.
        """
        while True:
            if time.monotonic() - self._looked > LOOK_SECONDS:
                self.worker_addresses()
            try:
                ticket = self._ended.get(timeout=LOOK_SECONDS)
            except queue.Empty:
                if self._is_stalled(lambda: not self._ended.empty()):
                    self._restart()
                continue
            self._last_moved = time.monotonic()
            finished = self._finished_work(ticket, self._futures[ticket])
            if finished is not None:
                del self._futures[ticket], self._calls[ticket]
                self._moved()
                return finished

    def _moved(self) -> None:
        """Take note of a piece of work that ended: nothing stalls."""
        self._last_moved = time.monotonic()
        self._restarts = 0

    def _finished_work(self, ticket: int, future: Future[Any]) -> Finished | None:
        """Return what became of a piece of work; None when it is under way again."""
        try:
            if future.status != "lost":
                return Finished(ticket, result=future.result(timeout=RESULT_SECONDS))
        except KilledWorker as error:
            return Finished(ticket, error=error, worker_lost=True)
        except (CancelledError, CommClosedError) as error:
            raise CampaignError(
                f"{self._where}: expected a scheduler that stays up, got none any more. "
                f"The same {typed_or_called('command', 'call')} resumes."
            ) from error
        except Exception as error:
            # Whatever the work raised; who asked for the work knows what to make of it.
            if future.status == "error" or not isinstance(error, TimeoutError):
                return Finished(ticket, error=error)
        # Its worker died with the result in its memory; another one works on it already.
        self._announce(ticket)
        return None

    def _is_stalled(self, some_has_ended: Callable[[], bool]) -> bool:
        """Return whether no worker computes although work is out: messages about it were not sent, or one hangs.

        Dask sends a message when the wall clock has passed a deadline; where the clock was set back, that is
        never. A worker that loads may not answer for long and have ended its work when it does: `some_has_ended`
        tells.
        """
        if time.monotonic() - self._last_moved < STALL_SECONDS or not self._present:
            return False
        for _ in range(IDLE_LOOKS):
            if not self._is_idle():
                self._last_moved = time.monotonic()
                return False
            time.sleep(LOOK_SECONDS)
        return not some_has_ended()

    def _is_idle(self) -> bool:
        """Return whether no worker computes, or one does not answer; asked on a way of its own.

        A worker answers while it computes: what it calls for a point leaves its other threads free.
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
        """Connect anew and send all work again; a chunk that is computed twice gives the same part."""
        stalled = CampaignError(
            f"{self._where}: expected workers that compute, got some that wait, or do not answer, while work is there. "
            f"Was a clock set back? The same {typed_or_called('command', 'call')} resumes."
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


@contextmanager
def open_workers(
    *, workers: int | None = None, scheduler: str | Client | None = None, progress: Progress | None = None
) -> Iterator[WorkerPool]:
    """Open workers for one campaign and leave no process behind, whatever ends it.

    Parameters
    ----------
    workers : int, optional
        Number of worker processes on this machine; one for each processor by default.
    scheduler : str or Client, optional
        Address of a Dask scheduler (`tcp://host:8786`), or a client of one, to use instead; its workers outlive the
        campaign, and the client stays as it is.
    progress : Progress, optional
        Told of workers that were lost.

    Raises
    ------
    UsageError
        When nothing listens at `scheduler`.
    CampaignError
        When the workers cannot be started.
    """
    # Its warnings about workers that end are about what is meant here, or said better by an error.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    with warnings.catch_warnings(), dask.config.set(QUIET), ExitStack() as stack:
        # Ctrl-C may come between the making of a coroutine of Dask and its start.
        warnings.filterwarnings("ignore", "coroutine .* was never awaited", RuntimeWarning)
        if scheduler is None:
            stack.enter_context(safe_module_path())
            scratch = stack.enter_context(ScratchFolder("workers"))
            stack.enter_context(dask.config.set({"temporary-directory": scratch.name}))
            connect = partial(_embedded_cluster, workers or processor_count(), Path(scratch.name))
            where = "this machine"
        else:
            address, security = _reached_by(scheduler)
            connect, where = partial(_remote_cluster, address, security), address
        pool = WorkerPool(connect, where, progress or Progress())
        stack.push(pool.connection)
        pool.wait_for_workers()
        yield pool


def _any_is_done(calls: Iterable[Future[Any]]) -> bool:
    return any(call.done() for call in calls)


def processor_count() -> int:
    """Return how many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _reached_by(scheduler: str | Client) -> tuple[str, Security | None]:
    """Return the address of a scheduler, and the certificates of the client that knows it."""
    if isinstance(scheduler, str):
        return scheduler, None
    if not isinstance(scheduler, Client):
        raise UsageError(
            f"scheduler: expected an address or a dask.distributed.Client, got {type(scheduler).__name__}."
        )
    if scheduler.asynchronous or scheduler.scheduler is None or scheduler.status != "running":
        raise UsageError(
            "scheduler: expected a client that is connected and not asynchronous, got another. Make one: Client()."
        )
    address = str(scheduler.scheduler.address)
    if address.startswith("inproc:"):
        raise UsageError(
            f"scheduler: expected workers in processes of their own, got threads of this one ({address}). "
            "Make the client with Client(processes=True), or leave it out."
        )
    return address, scheduler.security


@contextmanager
def _remote_cluster(address: str, security: Security | None) -> Iterator[_Cluster]:
    expected = f"{option('scheduler')} {address}: expected a Dask scheduler that listens there"
    try:
        security = security or Security()
        certified = security.get_connection_args("client")["ssl_context"] is not None
    except OSError as error:
        raise UsageError(
            f"{expected}, and certificates that can be read, got {error}. See docs/clusters.md."
        ) from error
    if address.startswith("tls:") and not certified:
        raise UsageError(f"{expected}, and certificates for TLS, got none. See docs/clusters.md.")
    try:
        client = Client(address, timeout=CONNECT_SECONDS, set_as_default=False, security=security)
    except (OSError, ValueError) as error:
        raise UsageError(
            f"{expected}, got no answer within {CONNECT_SECONDS:.0f} s. "
            "Start one with `dask scheduler`, or leave the option out."
            + (" Are the certificates those of the scheduler?" if certified else "")
        ) from error
    try:
        yield _Cluster(client)
    finally:
        with suppress(TimeoutError):
            client.close(timeout=STOP_SECONDS)


@contextmanager
def _embedded_cluster(workers: int, scratch: Path) -> Iterator[_Cluster]:
    cluster = _started_workers(workers, scratch)
    try:
        with Client(cluster, set_as_default=False) as client:
            yield _Cluster(client, workers, lambda: _replace_dead_workers(cluster, workers))
    except BaseException:
        # A worker may be deep in a long call; what it computes is not wanted any more.
        _kill_workers(cluster)
        raise
    finally:
        with suppress(TimeoutError):
            cluster.close(timeout=STOP_SECONDS)
        _kill_workers(cluster)


def _started_workers(workers: int, scratch: Path) -> LocalCluster:
    """Start workers on this machine, again where one of them died before it was up."""
    for _ in range(MOST_STARTS):
        try:
            with interrupts_blocked():
                return LocalCluster(
                    n_workers=workers,
                    threads_per_worker=1,
                    processes=True,
                    host="127.0.0.1",
                    # None would still open the usual port of a Dask dashboard, to the whole network.
                    dashboard_address="127.0.0.1:0",
                    scheduler_kwargs={"dashboard": False},
                    protocol="tls://",
                    security=_own_certificates(scratch),
                    memory_limit=0,
                    silence_logs=logging.CRITICAL,
                )
        except RuntimeError as error:
            failure = error
    raise CampaignError(
        f"this machine: expected {workers} workers that start, got a failure {MOST_STARTS} times: {failure}. "
        f"Is there memory for them? With {option('workers')} there are fewer; "
        f"the same {typed_or_called('command', 'call')} tries again."
    ) from failure


def _own_certificates(folder: Path) -> Security:
    """Return a key made for this cluster: Dask runs what it is sent, so other users must not reach it.

    Key and certificate are files in `folder`, which nobody else may read: one that Dask holds in memory it writes to a
    temporary folder for each connection, which stays where a process is killed meanwhile.
    """
    try:
        made = Security.temporary()
    except ImportError as error:
        raise UsageError(
            "this machine: expected the package cryptography, which keeps other users of this machine away from the "
            "workers, got none. Install it: `pip install cryptography`."
        ) from error
    certificate, key = folder / "certificate.pem", folder / "key.pem"
    certificate.write_text(made.tls_client_cert)
    key.write_text(made.tls_client_key)
    names = {f"tls_{role}_cert": str(certificate) for role in ("client", "scheduler", "worker")}
    names |= {f"tls_{role}_key": str(key) for role in ("client", "scheduler", "worker")}
    return Security(require_encryption=True, tls_ca_file=str(certificate), **names)


def _replace_dead_workers(cluster: LocalCluster, workers: int) -> None:
    """Start as many new workers as are dead for good: those killed while they were started again."""
    living = sum(nanny.is_alive() for nanny in cluster.workers.values())
    if living < workers:
        cluster.scale(len(cluster.worker_spec) + workers - living)


def _kill_workers(cluster: LocalCluster) -> None:
    for nanny in cluster.workers.values():
        nanny.auto_restart = False
        if nanny.pid is not None:
            with suppress(ProcessLookupError):
                os.kill(nanny.pid, signal.SIGKILL)

"""The door to Dask: workers that take chunks of a campaign and hand back what became of them.

No other module imports dask or distributed. A campaign sees a `WorkerPool`: submit work, take finished work,
know when a worker was lost. Where the workers live (embedded in this machine or behind a scheduler's
address) makes no difference to it.

Where two workers on two processors lose time to two bare processes, measured on chunks of 0.6 s of work:

- Timers. With Dask's defaults an idle worker spends 20 ms of each second in its event loop and the process
  with scheduler and nannies 27 ms; under load this is 6 % and 3 % of the machine. Half of it is the
  statistical profiler (100 samples/s, each needs the interpreter lock of the working thread), most of the rest
  the `tick` that watches the event loop (50/s), then the system and memory monitors. With `QUIET` it is 3 ms
  and 8 ms.
- The first dataset a process builds loads libraries for 0.4 s. `chunks.get_ready` does that, and loads the
  components, before the first chunk.
- The end: chunks of one size leave a worker idle for half a chunk. `schedule` makes them shorter.
- Waiting: a worker with an empty queue waits some 5 ms for the next chunk, so there are always more queued.

What stays is about 10 ms of processor time for each chunk and each part, and these timers: 2 to 4 %.
"""

from __future__ import annotations

import logging
import os
import queue
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import resource_tracker
from typing import Any

import dask
from distributed import CancelledError, Client, Future, LocalCluster
from distributed.comm.core import CommClosedError
from distributed.scheduler import KilledWorker

from vibroimpact.fmus.errors import CampaignError, UsageError
from vibroimpact.fmus.python_child import safe_module_path

CONNECT_SECONDS = 5.0
"""How long a scheduler may take to answer before it counts as absent."""

WORKERLESS_SECONDS = 30.0
"""How long a campaign waits for a first or a new worker before it gives up, s."""

STOP_SECONDS = 3.0
"""How long a worker may take to stop by itself before it is killed, s."""

QUIET = {
    "distributed.worker.profile.enabled": False,
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.terminate": False,
    "distributed.admin.system-monitor.interval": "10s",
    "distributed.admin.system-monitor.gil.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.tick.limit": "1h",
    "distributed.scheduler.active-memory-manager.start": False,
    "distributed.scheduler.work-stealing-interval": "100ms",
    "distributed.client.scheduler-info-interval": "10s",
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
    # A chunk whose worker died twice is handed back, so that the campaign can find the point that kills.
    "distributed.scheduler.allowed-failures": 1,
    "logging": {"distributed": "critical"},
}
"""Settings of Dask: what it does beside the work is switched off or slowed down, see above."""


@dataclass(frozen=True, slots=True)
class Finished:
    """A piece of work that ended: its ticket, and its result or its error."""

    ticket: int
    result: Any = None
    error: BaseException | None = None
    worker_lost: bool = False


class WorkerPool:
    """Workers of one Dask cluster, one piece of work at a time on each.

    Parameters
    ----------
    client : distributed.Client
        Connected to the cluster.
    where : str
        Where the workers are, for messages.
    """

    def __init__(self, client: Client, where: str) -> None:
        self._client = client
        self._where = where
        self._ended: queue.SimpleQueue[int] = queue.SimpleQueue()
        self._futures: dict[int, Future[Any]] = {}
        self._tickets = 0

    def worker_addresses(self) -> tuple[str, ...]:
        """Return the addresses of the workers that are there now."""
        return tuple(self._client.scheduler_info(n_workers=-1)["workers"])

    def call_everywhere(self, function: Callable[..., Any], *arguments: Any) -> dict[str, Any]:
        """Call a function once on each worker, in the thread that will also do the work.

        Returns
        -------
        dict of str to object
            What each worker, named by its address, returned.
        """
        calls = {
            address: self._client.submit(function, *arguments, workers=[address], pure=False)
            for address in self.worker_addresses()
        }
        try:
            return {address: call.result() for address, call in calls.items()}
        except KilledWorker as error:
            raise CampaignError(
                f"{self._where}: expected workers that live, got one that died while it got ready: {error}"
            ) from error

    def submit(self, function: Callable[..., Any], *arguments: Any) -> int:
        """Queue a call on whichever worker is free first; return the ticket of its `Finished`."""
        self._tickets += 1
        ticket = self._tickets
        future = self._client.submit(function, *arguments, pure=False)
        self._futures[ticket] = future
        self._announce(ticket, future)
        return ticket

    def _announce(self, ticket: int, future: Future[Any]) -> None:
        future.add_done_callback(lambda _future: self._ended.put(ticket))

    def next_finished(self) -> Finished:
        """Wait for the next piece of work to end.

        Raises
        ------
        CampaignError
            When no worker, or no scheduler, has been there for `WORKERLESS_SECONDS`.
        """
        while True:
            ticket = self._wait_for_ticket()
            future = self._futures[ticket]
            if future.status == "lost":
                # Its worker died with the result in its memory; another one works on it already.
                self._announce(ticket, future)
                continue
            del self._futures[ticket]
            return self._finished_work(ticket, future)

    def _finished_work(self, ticket: int, future: Future[Any]) -> Finished:
        try:
            return Finished(ticket, result=future.result())
        except KilledWorker as error:
            return Finished(ticket, error=error, worker_lost=True)
        except (CancelledError, CommClosedError) as error:
            raise CampaignError(
                f"{self._where}: expected a scheduler that stays up, got none any more. "
                "The same command resumes."
            ) from error
        except Exception as error:
            # Whatever the work raised; who asked for the work knows what to make of it.
            return Finished(ticket, error=error)

    def _wait_for_ticket(self) -> int:
        last_seen = time.monotonic()
        while True:
            try:
                return self._ended.get(timeout=5.0)
            except queue.Empty:
                if self._has_workers():
                    last_seen = time.monotonic()
                elif time.monotonic() - last_seen > WORKERLESS_SECONDS:
                    raise CampaignError(
                        f"{self._where}: expected at least one worker, got none for "
                        f"{WORKERLESS_SECONDS:.0f} s. Start workers; then the same command resumes."
                    ) from None

    def _has_workers(self) -> bool:
        try:
            return bool(self.worker_addresses())
        except OSError:
            return False

    def cancel_all(self) -> None:
        """Withdraw all work that has not begun."""
        futures = list(self._futures.values())
        self._futures.clear()
        if futures:
            self._client.cancel(futures, force=True)


@contextmanager
def open_workers(*, workers: int | None = None, scheduler: str | None = None) -> Iterator[WorkerPool]:
    """Open workers for one campaign and leave no process behind, whatever ends it.

    Parameters
    ----------
    workers : int, optional
        Number of worker processes on this machine; one for each processor by default.
    scheduler : str, optional
        Address of a Dask scheduler (`tcp://host:8786`) to use instead; its workers outlive the campaign.

    Raises
    ------
    UsageError
        When nothing listens at `scheduler`.
    """
    # Its warnings about workers that end are about what is meant here, or said better by an error.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    with dask.config.set(QUIET):
        if scheduler is not None:
            with _remote_client(scheduler) as client:
                yield _ready_pool(client, scheduler)
        else:
            with safe_module_path(), _embedded_client(workers or processor_count()) as client:
                yield _ready_pool(client, "this machine")


def processor_count() -> int:
    """Return how many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _ready_pool(client: Client, where: str) -> WorkerPool:
    pool = WorkerPool(client, where)
    deadline = time.monotonic() + WORKERLESS_SECONDS
    while not pool.worker_addresses():
        if time.monotonic() > deadline:
            raise CampaignError(
                f"{where}: expected at least one worker, got none for {WORKERLESS_SECONDS:.0f} s. "
                "Start workers first."
            )
        time.sleep(0.1)
    return pool


@contextmanager
def _remote_client(address: str) -> Iterator[Client]:
    try:
        client = Client(address, timeout=CONNECT_SECONDS, set_as_default=False)
    except (OSError, ValueError) as error:
        raise UsageError(
            f"--scheduler {address}: expected a Dask scheduler that listens there, got no answer within "
            f"{CONNECT_SECONDS:.0f} s. Start one with `dask scheduler`, or leave the option out."
        ) from error
    try:
        yield client
    finally:
        with suppress(TimeoutError):
            client.close(timeout=STOP_SECONDS)


@contextmanager
def _embedded_client(workers: int) -> Iterator[Client]:
    with _deaf_children():
        cluster = LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            # None would still open the usual port of a Dask dashboard, to the whole network.
            dashboard_address="127.0.0.1:0",
            scheduler_kwargs={"dashboard": False},
            memory_limit=0,
            silence_logs=logging.CRITICAL,
        )
    try:
        with Client(cluster, set_as_default=False) as client:
            yield client
    except BaseException:
        # A worker may be deep in a long call; what it computes is not wanted any more.
        _kill_workers(cluster)
        raise
    finally:
        # What does not end in time dies with this process.
        with suppress(TimeoutError):
            cluster.close(timeout=STOP_SECONDS)


def _kill_workers(cluster: LocalCluster) -> None:
    for nanny in cluster.workers.values():
        nanny.auto_restart = False
        if nanny.pid is not None:
            with suppress(ProcessLookupError):
                os.kill(nanny.pid, signal.SIGKILL)


@contextmanager
def _deaf_children() -> Iterator[None]:
    """Let the threads and processes that begin here not hear Ctrl-C: it is for this thread alone.

    A terminal sends the signal to every process of the command. A blocked signal is inherited by threads and
    by the processes they start, also by those that replace a dead worker later. Here it only waits.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    # Started here, since its start would open the ears of the thread that needs it first.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)

"""The cluster of a campaign's workers: processes of this machine, or the workers of a Dask scheduler.

Only this module and `pool` import dask or distributed. docs/scaling.md has the effect of the settings `QUIET`.
"""

from __future__ import annotations

import logging
import os
import signal
import sys
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from multiprocessing import resource_tracker
from pathlib import Path
from typing import Any

import dask
from distributed import Client as Client
from distributed import LocalCluster
from distributed.security import Security
from distributed.utils import get_mp_context

from vibroimpact.analysis.files.scratch import ScratchFolder
from vibroimpact.fmus.errors import CampaignError, UsageError
from vibroimpact.fmus.messages import CALL, Argument, Either, message
from vibroimpact.fmus.processes.python_child import no_library_warns, safe_module_path
from vibroimpact.fmus.surroundings import (
    LOOPBACK,
    leave_removed_folder,
    refuse_few_descriptors,
    refuse_no_loopback,
)
from vibroimpact.orchestrator.campaign.workers.computation import Computation
from vibroimpact.orchestrator.campaign.workers.pool import Cluster, WorkerPool
from vibroimpact.orchestrator.campaign.workers.processors import processor_count
from vibroimpact.orchestrator.run.progress import Progress

CONNECT_SECONDS = 5.0
"""Time to answer, s, after which a scheduler counts as absent."""

STOP_SECONDS = 3.0
"""Time to stop, s, after which a worker is killed."""

MOST_STARTS = 5
"""Number of failed starts of the workers of this machine, from which on the failure is an error."""

START = "distributed.worker.multiprocessing-method"
"""Dask's setting for the start of workers: `spawn` one by one, or forks of a `forkserver`."""

QUIET: dict[str, Any] = {
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
    # A chunk whose worker died twice comes back, so that the campaign can find the point that kills workers.
    "distributed.scheduler.allowed-failures": 1,
    "logging": {"distributed": "critical"},
}
"""Settings of Dask that switch off or slow down its activity besides the work."""

OWN_DESCRIPTORS = 32
"""File descriptors of a campaign and Dask's scheduler: 18 were measured on Linux, with 1 and 2 workers."""

WORKER_DESCRIPTORS = 12
"""File descriptors of a campaign for each worker: 11 were measured on Linux, with 1 and 2 workers."""

LONGEST_TEMPORARY = 75
"""Longest path of a temporary folder in which a socket can have a name, bytes: Linux allows 107 for the socket."""


@contextmanager
def open_workers(
    *, workers: int | None = None, scheduler: str | Client | None = None, progress: Progress | None = None
) -> Iterator[WorkerPool]:
    """Open workers for one campaign and leave no process behind, whatever ends it; `progress` gets lost workers.

    One worker runs for each processor by default. `scheduler` is the address of a Dask scheduler (`tcp://host:8786`) or
    a client, to use instead. Its workers outlive the campaign, and the client stays as it is. UsageError: nothing
    listens there, or this machine lacks descriptors or loopback for workers. CampaignError: workers cannot be started.
    """
    # Dask warns of workers that end: this is intended, or an error explains it better.
    for name in ("distributed", "distributed.client"):  # these loggers have their own levels
        logging.getLogger(name).setLevel(logging.CRITICAL)
    with warnings.catch_warnings(), dask.config.set(QUIET), ExitStack() as stack:
        # Ctrl-C may come between the creation of a coroutine of Dask and its start.
        warnings.filterwarnings("ignore", "coroutine .* was never awaited", RuntimeWarning)
        if scheduler is None:
            number = workers or processor_count()
            _refuse_poor_surroundings(number)
            stack.enter_context(safe_module_path())
            stack.enter_context(no_library_warns())
            scratch = stack.enter_context(ScratchFolder("workers"))
            leave_removed_folder(Path(scratch.name))
            stack.enter_context(
                dask.config.set({"temporary-directory": scratch.name, START: _prepare_start()})
            )
            connect = partial(_embedded_cluster, number, Path(scratch.name))
            where = "this machine"
        else:
            address, security = _reached_by(scheduler)
            connect, where = partial(_remote_cluster, address, security), address
        pool = WorkerPool(connect, where, progress or Progress())
        stack.push(pool.connection)
        pool.wait_for_workers()
        yield pool


def _reached_by(scheduler: str | Client) -> tuple[str, Security | None]:
    """Return the address of a scheduler, and the certificates of its client."""
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
def _remote_cluster(address: str, security: Security | None) -> Iterator[Cluster]:
    expected = message(Argument("scheduler"), f" {address}: expected a Dask scheduler that listens there")
    try:
        security = security or Security()
        certified = security.get_connection_args("client")["ssl_context"] is not None
    except OSError as error:
        raise UsageError(
            message(expected, f", and certificates that can be read, got {error}. See docs/scaling.md.")
        ) from error
    if address.startswith("tls:") and not certified:
        raise UsageError(message(expected, ", and certificates for TLS, got none. See docs/scaling.md."))
    try:
        client = _connected(address, security)
    except (OSError, ValueError) as error:
        raise UsageError(
            message(
                expected,
                f", got no answer within {CONNECT_SECONDS:.0f} s. "
                "Start one with `dask scheduler`, or leave the option out."
                + (" Are the certificates those of the scheduler?" if certified else ""),
            )
        ) from error
    try:
        yield Cluster(client)
    finally:
        with suppress(TimeoutError):
            client.close(timeout=STOP_SECONDS)


def _connected(address: str, security: Security) -> Client:
    """Return a client of a scheduler; try again where Dask's client could not take its first message."""
    for _ in range(MOST_STARTS - 1):
        # a busy scheduler may send two messages as one, where Dask's client asserts a single first message
        with suppress(AssertionError):
            return Client(address, timeout=CONNECT_SECONDS, set_as_default=False, security=security)
    return Client(address, timeout=CONNECT_SECONDS, set_as_default=False, security=security)


@contextmanager
def _embedded_cluster(workers: int, scratch: Path) -> Iterator[Cluster]:
    cluster = _started_workers(workers, scratch)
    try:
        with Client(cluster, set_as_default=False) as client:
            yield Cluster(client, workers, lambda: _replace_dead_workers(cluster, workers, scratch))
    except BaseException:
        # A worker may be in a long call, whose result is no longer needed.
        _kill_workers(cluster)
        raise
    finally:
        with suppress(TimeoutError):
            cluster.close(timeout=STOP_SECONDS)
        _kill_workers(cluster)


@contextmanager
def _interrupts_blocked() -> Iterator[None]:
    """Block Ctrl-C in the threads and processes that begin in the block: only this thread handles it.

    A terminal sends the signal to every process of the command. Threads inherit the blocked signal, and so do their
    processes, including later replacements of dead workers. In this thread the signal waits for the end of the block.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    # The start of the tracker unblocks SIGINT in the calling thread, so it comes first.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _started_workers(workers: int, scratch: Path) -> LocalCluster:
    """Start workers on this machine; start again if a worker dies during its start."""
    for _ in range(MOST_STARTS):
        try:
            with _interrupts_blocked():
                return LocalCluster(
                    n_workers=workers,
                    threads_per_worker=1,
                    processes=True,
                    host=LOOPBACK,
                    # With None, Dask would still open its usual dashboard port to the whole network.
                    dashboard_address=f"{LOOPBACK}:0",
                    scheduler_kwargs={"dashboard": False},
                    protocol="tls://",
                    security=_own_certificates(scratch),
                    memory_limit=0,
                    silence_logs=logging.CRITICAL,
                    # The fork server has the environment of the time of its start.
                    env=dict(os.environ),
                )
        except RuntimeError as error:
            failure = error
            # The fork server may be out of reach, if the folder of its socket was cleaned.
            dask.config.set({START: "spawn"})
    raise CampaignError(
        message(
            f"this machine: expected {workers} workers that start, got a failure {MOST_STARTS} times: {failure}. "
            "Is there memory for them? With ",
            *(Argument("workers"), " there are fewer; the same ", CALL, " tries again."),
        )
    ) from failure


def _prepare_start() -> str:
    """Return the start method of workers; a fork server gets the modules to import for all workers."""
    # On other systems than Linux, system libraries may not survive a fork.
    if sys.platform != "linux" or len(os.fsencode(tempfile.gettempdir())) > LONGEST_TEMPORARY:
        return "spawn"
    with dask.config.set({START: "forkserver"}):
        # Dask sets its own modules on the first call; these replace them.
        get_mp_context().set_forkserver_preload([Computation.__module__])
    return "forkserver"


def _own_certificates(folder: Path) -> Security:
    """Return a new key for this cluster: Dask runs any code it receives, so other users must not reach it.

    Key and certificate are files in `folder`, which other users cannot read. Dask would write a key in memory to a
    temporary folder for each connection, and a killed process would leave that folder behind.
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


def _refuse_poor_surroundings(workers: int) -> None:
    """Raise UsageError unless workers of this machine can be started and reached."""
    fewer = message("ask for fewer workers with ", Argument("workers")) if workers > 1 else ""
    whose = f"{workers} worker{'s' if workers > 1 else ''}"
    refuse_few_descriptors(OWN_DESCRIPTORS + workers * WORKER_DESCRIPTORS, whose, fewer)
    instead = message("use ", Either("vi.run", "`vibroimpact run`"), ", which needs none")
    refuse_no_loopback("workers are reached", instead)


def _replace_dead_workers(cluster: LocalCluster, workers: int, scratch: Path) -> None:
    """Start a new worker for each worker that is dead for good, killed during its restart."""
    leave_removed_folder(scratch)
    living = sum(nanny.is_alive() for nanny in cluster.workers.values())
    if living < workers:
        cluster.scale(len(cluster.worker_spec) + workers - living)


def _kill_workers(cluster: LocalCluster) -> None:
    for nanny in cluster.workers.values():
        nanny.auto_restart = False
        if nanny.pid is not None:
            with suppress(ProcessLookupError):
                os.kill(nanny.pid, signal.SIGKILL)

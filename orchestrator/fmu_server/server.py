"""The server of one FMU: each stream of an importer has an instance of its own, in a process of its own."""

from __future__ import annotations

import hmac
import math
import threading
import time
from collections.abc import Iterator
from concurrent import futures
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

from vibroimpact.fmus.errors import ComponentFileError, UsageError
from vibroimpact.fmus.packaging.archive import UnpackedFmu, unpack
from vibroimpact.fmus.safe_xml import root_of
from vibroimpact.orchestrator.fmi.capabilities import CO_SIMULATION
from vibroimpact.orchestrator.fmu_server.process import FmuProcess, ProcessEnded
from vibroimpact.orchestrator.remote.address import Address
from vibroimpact.orchestrator.remote.channel import grpc
from vibroimpact.orchestrator.remote.protocol import (
    DESCRIBE,
    HASH_KEY,
    LARGEST_ANSWER,
    LARGEST_REQUEST,
    PROTOCOL,
    PROTOCOL_KEY,
    RUN,
    TOKEN_KEY,
    Description,
)

MOST_INSTANCES = 16
"""Instances at a time; a further importer is refused."""
IDLE_SECONDS = 600.0
"""Time without a call after which an instance ends, s."""
OTHER_CALLS = 8
"""Concurrent calls beside those of the instances: descriptions, and refusals."""
STOP_SECONDS = 0.2
OPTIONS = [
    ("grpc.max_receive_message_length", LARGEST_REQUEST),
    ("grpc.max_send_message_length", LARGEST_ANSWER),
    ("grpc.max_metadata_size", 8192),
    ("grpc.so_reuseport", 0),
    ("grpc.max_concurrent_streams", MOST_INSTANCES + OTHER_CALLS),
    # the loss of an importer's machine ends its instance
    ("grpc.keepalive_time_ms", 30_000),
    ("grpc.keepalive_timeout_ms", 20_000),
    ("grpc.keepalive_permit_without_calls", 1),
    ("grpc.http2.min_recv_ping_interval_without_data_ms", 20_000),
]


@dataclass(frozen=True, slots=True)
class Tls:
    """Certificate and private key of a server, PEM."""

    certificate: bytes
    key: bytes


class _Stream:
    """An instance that runs, as seen by the thread that ends idle ones."""

    def __init__(self, context: Any) -> None:
        self.context = context
        self.last = math.inf  # time of the last answer, s; infinite during a call


class Server:
    """A server of one FMU at an address, until it is closed.

    Parameters
    ----------
    file : Path
        The FMU, for co-simulation.
    address : Address
        Port 0: any free port.
    token : str
    tls : Tls or None
        None: plain text, on this machine alone.
    idle : float
        Time without a call after which an instance ends, s.

    Attributes
    ----------
    address : Address
        The address with its port.

    Raises
    ------
    ComponentFileError
        The FMU cannot be served.
    UsageError
        The port is taken, or an address beyond this machine has no certificate.
    """

    def __init__(
        self, file: Path, address: Address, token: str, tls: Tls | None = None, *, idle: float = IDLE_SECONDS
    ) -> None:
        self._expected, self._idle = f"Bearer {token}".encode(), idle
        self.fmu = served_fmu(file)
        xml = (self.fmu.folder / "modelDescription.xml").read_bytes()
        version = metadata.version("vibroimpact")
        self._described = Description(version=version, name=file.name, sha256=self.fmu.sha256, xml=xml)
        self._streams: set[_Stream] = set()
        self._lock = threading.Lock()
        self._is_closed = threading.Event()
        self._server = grpc.server(
            futures.ThreadPoolExecutor(MOST_INSTANCES + OTHER_CALLS, thread_name_prefix="fmu"),
            handlers=(_Handler(self),),
            options=OPTIONS,
            maximum_concurrent_rpcs=MOST_INSTANCES + OTHER_CALLS,
        )
        self.address = Address(address.host, self._bound(address, tls))
        self._server.start()
        threading.Thread(target=self._end_idle, name="fmu idle", daemon=True).start()

    def _bound(self, address: Address, tls: Tls | None) -> int:
        if tls is None and not address.is_loopback:
            raise UsageError(
                f"--listen: expected --certificate and --key for {address}, which other machines reach, got none."
            )
        try:
            if tls is None:
                port = self._server.add_insecure_port(str(address))
            else:
                pair = grpc.ssl_server_credentials([(tls.key, tls.certificate)])
                port = self._server.add_secure_port(str(address), pair)
        except RuntimeError:
            port = 0
        if not port:
            raise UsageError(
                f"--listen: expected an address of this machine with a free port, got {address}."
            )
        return int(port)

    def wait(self) -> None:
        """Serve until the process is interrupted."""
        self._server.wait_for_termination()

    def close(self) -> None:
        """End all instances and the server."""
        self._is_closed.set()
        self._server.stop(STOP_SECONDS).wait()
        while self._streams:  # each ends its process
            time.sleep(0.01)

    @property
    def instances(self) -> int:
        """Number of running instances."""
        return len(self._streams)

    # ---- calls ----

    def refusal(self, metadata: dict[str, Any]) -> tuple[Any, str] | None:
        """Return status and reason for refusing a call by its metadata; None if it is accepted."""
        given = metadata.get(TOKEN_KEY, "")
        if not hmac.compare_digest(given.encode() if isinstance(given, str) else given, self._expected):
            return grpc.StatusCode.UNAUTHENTICATED, "expected the token of this server, got none or another."
        if (other := metadata.get(PROTOCOL_KEY)) != PROTOCOL:
            version = self._described.version
            got = f"version {str(other)[:20]!r} of the messages"
            return (
                grpc.StatusCode.FAILED_PRECONDITION,
                f"expected version {PROTOCOL!r} of the messages (vibroimpact {version}), got {got}.",
            )
        wanted = metadata.get(HASH_KEY, self.fmu.sha256)
        if wanted != self.fmu.sha256:
            name = f"{self._described.name} with {self.fmu.sha256}"
            return (
                grpc.StatusCode.FAILED_PRECONDITION,
                f"expected the FMU with SHA-256 {str(wanted)[:64]}, got {name}.",
            )
        return None

    def describe(self, request: bytes, context: Any) -> bytes:
        """Return the description of the FMU."""
        data: bytes = self._described.SerializeToString()
        return data

    def run(self, batches: Iterator[bytes], context: Any) -> Iterator[bytes]:
        """Answer the batches of one importer, in an instance of its own."""
        with self._counted(context) as stream:
            process = FmuProcess(self.fmu)
            try:
                context.add_callback(process.abandon)
                for batch in batches:
                    stream.last = math.inf
                    answer, goes_on = process.ask(batch)
                    stream.last = time.monotonic()
                    yield answer
                    if not goes_on:
                        return
            except ProcessEnded as end:
                context.abort(grpc.StatusCode.ABORTED, f"{end}.")
            except grpc.RpcError:
                return  # the importer is gone
            finally:
                process.end()

    @contextmanager
    def _counted(self, context: Any) -> Iterator[_Stream]:
        stream = _Stream(context)
        with self._lock:
            is_full = len(self._streams) >= MOST_INSTANCES or self._is_closed.is_set()
            if not is_full:
                self._streams.add(stream)
        if is_full:
            why = f"expected at most {MOST_INSTANCES} instances at a time, got another."
            context.abort(grpc.StatusCode.RESOURCE_EXHAUSTED, why)
        try:
            yield stream
        finally:
            self._streams.discard(stream)

    def _end_idle(self) -> None:
        while not self._is_closed.wait(min(self._idle / 4.0, 5.0)):
            latest = time.monotonic() - self._idle
            for stream in list(self._streams):
                if stream.last < latest:
                    stream.context.cancel()


class _Handler(grpc.GenericRpcHandler):  # type: ignore[misc]  # grpc carries no types
    """Finds the function that answers a call; a call without the token meets a refusal alone."""

    def __init__(self, server: Server) -> None:
        self._server = server

    def service(self, handler_call_details: Any) -> Any:
        """Return the handler of a call; None for an unknown method."""
        details = handler_call_details
        refusal = self._server.refusal(dict(details.invocation_metadata))
        if details.method not in (DESCRIBE, RUN) and refusal is None:
            return None
        if refusal is not None:
            # a stream: nothing is waited for, which a stranger may never send
            return grpc.stream_unary_rpc_method_handler(lambda requests, context: context.abort(*refusal))
        if details.method == DESCRIBE:
            return grpc.unary_unary_rpc_method_handler(self._server.describe)
        return grpc.stream_stream_rpc_method_handler(self._server.run)


def served_fmu(file: Path) -> UnpackedFmu:
    """Return an FMU that can be served.

    Raises
    ------
    ComponentFileError
        It is not intact, or not for co-simulation.
    """
    fmu = unpack(file)
    root = root_of((fmu.folder / "modelDescription.xml").read_bytes(), f"{file}: modelDescription.xml")
    if root.find(CO_SIMULATION) is None:
        raise ComponentFileError(
            f"{file}: expected an FMU for co-simulation, got one without it: model exchange is integrated where the "
            "scene runs."
        )
    return fmu

"""The only importer of nidaqmx: NI's client, the messages of its protocol, and gRPC, in the extra `hardware`.

The messages are in a private folder of nidaqmx; therefore pyproject.toml bounds its version.
"""

from __future__ import annotations

import os
from typing import Any

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.surroundings import in_a_folder_that_exists

# gRPC's own log lines would stand beside the one line of this package
os.environ.setdefault("GRPC_VERBOSITY", "NONE")

try:
    with in_a_folder_that_exists():  # nidaqmx looks for a file of settings in the current folder
        import grpc
        import nidaqmx
        from nidaqmx import constants, stream_readers, stream_writers
        from nidaqmx._stubs import nidaqmx_pb2
        from nidaqmx.error_codes import DAQmxErrors, DAQmxWarnings
        from nidaqmx.errors import DaqError, DaqNotFoundError, RpcError
        from nidaqmx.system import System
except ImportError as _missing:
    raise UsageError(
        f"rig: expected the package nidaqmx with gRPC, got none ({_missing}). "
        "Install it: pip install 'vibroimpact[hardware]', or in a clone pip install '.[hardware]'."
    ) from None

#: Name of NI's service in calls of the client.
SERVICE = "nidaqmx_grpc.NiDAQmx"
METHODS: dict[str, Any] = dict(nidaqmx_pb2.DESCRIPTOR.services_by_name["NiDAQmx"].methods_by_name)
"""Descriptor of each method of the service, by its name."""

#: The default of gRPC, 4 MiB, loses the samples of larger reads.
LARGEST_MESSAGE = 256 * 2**20
CHANNEL_OPTIONS = [
    ("grpc.max_receive_message_length", LARGEST_MESSAGE),
    ("grpc.max_send_message_length", LARGEST_MESSAGE),
]

__all__ = [
    "CHANNEL_OPTIONS",
    "METHODS",
    "SERVICE",
    "DAQmxErrors",
    "DAQmxWarnings",
    "DaqError",
    "DaqNotFoundError",
    "RpcError",
    "System",
    "constants",
    "grpc",
    "message_class",
    "nidaqmx",
    "open_channel",
    "stream_readers",
    "stream_writers",
    "with_deadline",
]


def message_class(descriptor: Any) -> Any:
    """Return the class of a message of the protocol."""
    return getattr(nidaqmx_pb2, descriptor.name)


def open_channel(address: str) -> Any:
    """Return a gRPC channel to `host:port`, for large reads."""
    return grpc.insecure_channel(address, options=CHANNEL_OPTIONS)


class _Deadline(grpc.UnaryUnaryClientInterceptor):  # type: ignore[misc]  # grpc carries no types
    def __init__(self, seconds: float) -> None:
        self._seconds = seconds

    def intercept_unary_unary(self, continuation: Any, details: Any, request: Any) -> Any:
        """Give a call a deadline."""
        return continuation(_Details(details, self._seconds), request)


class _Details(grpc.ClientCallDetails):  # type: ignore[misc]  # grpc carries no types
    def __init__(self, details: Any, seconds: float) -> None:
        self.method, self.metadata, self.credentials = details.method, details.metadata, details.credentials
        self.wait_for_ready, self.compression = details.wait_for_ready, details.compression
        self.timeout = seconds


def with_deadline(channel: Any, seconds: float) -> Any:
    """Return a channel whose calls fail after `seconds` without an answer; NI's client waits for ever."""
    return grpc.intercept_channel(channel, _Deadline(seconds))

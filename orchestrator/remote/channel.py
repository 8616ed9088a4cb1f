"""The only importer of gRPC in this package, the extra `remote`: channels to servers of FMUs."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from vibroimpact.fmus.errors import ComponentError, ComponentFileError, LateComponentError, LostComponentError
from vibroimpact.fmus.surroundings import in_a_folder_that_exists
from vibroimpact.orchestrator.remote.address import SCHEME, Address, token_for

# gRPC's own log lines would stand beside the one line of this package
os.environ.setdefault("GRPC_VERBOSITY", "NONE")

try:
    with in_a_folder_that_exists():
        import grpc

        from vibroimpact.orchestrator.remote.protocol import (
            LARGEST_ANSWER,
            LARGEST_REQUEST,
            PROTOCOL,
            PROTOCOL_KEY,
            TOKEN_KEY,
        )
except ImportError as _missing:
    raise ComponentFileError(
        f"FMUs elsewhere: expected the packages grpcio and protobuf, got none ({_missing}). "
        "Install them: pip install 'vibroimpact[remote]', or in a clone pip install '.[remote]'."
    ) from None

CONNECT_SECONDS = 5.0
"""Longest time for a server to be there, s: it may just be starting again."""
RETRY_SECONDS = 0.2
OPTIONS = [
    ("grpc.max_send_message_length", LARGEST_REQUEST),
    ("grpc.max_receive_message_length", LARGEST_ANSWER),
    ("grpc.initial_reconnect_backoff_ms", int(1e3 * RETRY_SECONDS)),
    ("grpc.min_reconnect_backoff_ms", int(1e3 * RETRY_SECONDS)),
    ("grpc.max_reconnect_backoff_ms", int(1e3 * RETRY_SECONDS)),
    ("grpc.use_local_subchannel_pool", 1),
    ("grpc.enable_http_proxy", 0),
    ("grpc.keepalive_time_ms", 30_000),  # the loss of a machine shows without an answer of its own
]
#: Words of gRPC's reports of a certificate that was refused, by this end or by the other.
_TLS = ("CERTIFICATE", "SSL", "handshake")

__all__ = ["CONNECT_SECONDS", "RETRY_SECONDS", "grpc", "is_absent", "loss_of", "metadata_for", "open_channel"]


def open_channel(address: Address, certificate: Path | None) -> Any:
    """Return a channel to a server: TLS with a certificate, else plain text on this machine alone.

    Raises
    ------
    ComponentFileError
        The certificate cannot be read, or is absent for a server beyond this machine.
    """
    if certificate is None:
        if not address.is_loopback:
            raise ComponentFileError(
                f"{SCHEME}{address}: expected a certificate for a server beyond this machine, got none. "
                'Write certificate = "FILE.pem" beside fmu.'
            )
        return grpc.insecure_channel(str(address), options=OPTIONS)
    try:
        roots = certificate.read_bytes()
    except OSError as error:
        raise ComponentFileError(
            f"{certificate}: expected a certificate (PEM), got {error.strerror}."
        ) from error
    if b"-----BEGIN CERTIFICATE-----" not in roots:
        raise ComponentFileError(f"{certificate}: expected a certificate (PEM), got a file without one.")
    return grpc.secure_channel(str(address), grpc.ssl_channel_credentials(roots), options=OPTIONS)


def metadata_for(address: Address, *more: tuple[str, str]) -> list[tuple[str, str]]:
    """Return the metadata of a call: the token of this server, and the version of the messages."""
    return [(TOKEN_KEY, f"Bearer {token_for(address)}"), (PROTOCOL_KEY, PROTOCOL), *more]


def is_absent(error: Any) -> bool:
    """Return whether a call failed since no server was there: it may come back."""
    refused_tls = any(word in (error.details() or "") for word in _TLS)
    return error.code() is grpc.StatusCode.UNAVAILABLE and not refused_tls


def loss_of(error: Any, where: str, late: float = 0.0) -> ComponentError:
    """Return the error of a call that failed.

    Parameters
    ----------
    error : grpc.RpcError
    where : str
        Component, function and server, at the start of the message.
    late : float
        Time after which the call was given up, s; 0: it was not.
    """
    code, details = error.code(), " ".join((error.details() or "no reason").split())[:500]
    status = grpc.StatusCode
    if late:
        return LateComponentError(f"{where}: expected an answer within {late:g} s, got none.")
    if code in (status.UNAVAILABLE, status.CANCELLED):
        return LostComponentError(f"{where}: expected a server that answers, got none: {details}.")
    if code is status.ABORTED:
        return LostComponentError(f"{where}: {details}")
    return ComponentError(f"{where}: {details}")

"""The description of an FMU from its server, kept in the cache as an FMU file without binaries."""

from __future__ import annotations

import hashlib
import re
import time
from pathlib import Path
from typing import Any

from vibroimpact.fmus.errors import ComponentFileError
from vibroimpact.fmus.packaging.fmu_zip import write_fmu
from vibroimpact.fmus.private_folder import UnsafeFolderError, private_folder
from vibroimpact.fmus.safe_xml import refuse_large
from vibroimpact.orchestrator.remote.address import SCHEME, Address, FmuServer
from vibroimpact.orchestrator.remote.channel import (
    CONNECT_SECONDS,
    RETRY_SECONDS,
    grpc,
    is_absent,
    loss_of,
    metadata_for,
    open_channel,
)
from vibroimpact.orchestrator.remote.protocol import DESCRIBE, Batch, Description

FOLDER = "served-fmus"
ANSWER_SECONDS = 10.0
"""Longest time for a description, s."""
_HASH = re.compile(r"[0-9a-f]{64}")
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.+\-]{0,99}\.fmu")


def served_fmu(address: Address, certificate: Path | None) -> tuple[Path, str]:
    """Return a file with the description of the FMU that a server has, and the SHA-256 of that FMU.

    Raises
    ------
    ComponentError
        The server is not there, refuses the token, or has no description that can be read.
    """
    found = _described(address, certificate)
    where = f"{SCHEME}{address}"
    if not _HASH.fullmatch(found.sha256):
        raise ComponentFileError(f"{where}: expected a SHA-256, got {found.sha256[:80]!r}.")
    refuse_large(len(found.xml), f"{where}: modelDescription.xml")
    name = found.name if _NAME.fullmatch(found.name) else "served.fmu"
    return _kept(found.xml, name), found.sha256


def described_fmu(server: FmuServer, known: Path) -> Path:
    """Return a file with the description of a component's FMU: the known file, else one made anew from its server.

    A scene travels to other machines without the file.
    """
    if known.is_file():
        return known
    path, sha256 = served_fmu(server.address, server.certificate)
    if sha256 != server.sha256:
        raise ComponentFileError(
            f"{SCHEME}{server.address}: expected the FMU with SHA-256 {server.sha256}, got {path.name} with {sha256}."
        )
    return path


def _described(address: Address, certificate: Path | None) -> Any:
    end = time.monotonic() + CONNECT_SECONDS
    with open_channel(address, certificate) as channel:
        call = channel.unary_unary(
            DESCRIBE, lambda message: message.SerializeToString(), Description.FromString
        )
        metadata = metadata_for(address)
        while True:
            try:
                return call(Batch(), timeout=ANSWER_SECONDS, metadata=metadata)
            except grpc.RpcError as error:
                if is_absent(error) and time.monotonic() < end:
                    time.sleep(RETRY_SECONDS)
                    continue
                late = ANSWER_SECONDS if error.code() is grpc.StatusCode.DEADLINE_EXCEEDED else 0.0
                raise loss_of(error, f"{SCHEME}{address}", late) from None


def _kept(xml: bytes, name: str) -> Path:
    """Return an FMU file with this description alone, by its content."""
    try:
        path = private_folder(FOLDER) / hashlib.sha256(xml).hexdigest() / name
    except (UnsafeFolderError, OSError) as error:
        raise ComponentFileError(f"{name}: its description was not kept: {error}") from error
    if not path.is_file():
        write_fmu(path, {"modelDescription.xml": xml})
    return path

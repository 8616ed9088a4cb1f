"""Addresses of servers of FMUs, `grpc://HOST:PORT`, and the tokens for them."""

from __future__ import annotations

import ipaddress
import os
import re
from dataclasses import dataclass
from pathlib import Path

from vibroimpact.fmus.access_token import token_at
from vibroimpact.fmus.errors import ComponentError, UsageError
from vibroimpact.fmus.private_folder import UnsafeFolderError, private_folder

SCHEME = "grpc://"
TOKENS_VARIABLE = "VIBROIMPACT_FMU_TOKENS"
"""Environment variable of tokens: `HOST:PORT=TOKEN`, several divided by blanks."""
FOLDER = "fmu-servers"
#: A name or an address of a host, in brackets if it has colons, and a port.
_PLACE = re.compile(
    r"(\[[0-9a-fA-F:.]+\]|[A-Za-z0-9]([A-Za-z0-9.\-]{0,252}[A-Za-z0-9])?):([0-9]{1,5})", re.ASCII
)


@dataclass(frozen=True, slots=True)
class Address:
    """Host and port of a server; `host` has no brackets."""

    host: str
    port: int

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{host}:{self.port}"

    @property
    def is_loopback(self) -> bool:
        """Whether only this machine reaches it."""
        try:
            return self.host == "localhost" or ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False

    @property
    def token_file(self) -> Path:
        """The file with the token of a server that this user has started on this machine; it may be absent.

        Raise ComponentError if others may write its folder.
        """
        host = "127.0.0.1" if self.host == "localhost" else self.host
        try:
            return private_folder(FOLDER) / f"{host.replace(':', '_')}_{self.port}.token"
        except (UnsafeFolderError, OSError) as error:
            raise ComponentError(f"token of {SCHEME}{self}: {error}") from error


def read_address(text: str) -> Address | None:
    """Return the address `HOST:PORT`; None for another text.

    >>> str(read_address("127.0.0.1:31800")), read_address("lab"), read_address("../etc:1")
    ('127.0.0.1:31800', None, None)
    """
    found = _PLACE.fullmatch(text)
    if found is None or not 0 <= int(found[3]) <= 65535:
        return None
    host = found[1].lower()
    if host.startswith("["):
        try:
            return Address(str(ipaddress.IPv6Address(host[1:-1])), int(found[3]))
        except ValueError:
            return None
    return Address(host, int(found[3]))


def token_for(address: Address) -> str:
    """Return the token for a server: of the environment, or of the file that its server has made on this machine.

    A token is given to the server whose address stands beside it, and to no other.

    Raises
    ------
    ComponentError
        Neither has a token for this address.
    """
    for entry in os.environ.get(TOKENS_VARIABLE, "").split():
        place, _, token = entry.partition("=")
        if read_address(place) == address and token:
            return token
    file = address.token_file
    if address.is_loopback and file.is_file():
        try:
            return token_at(file)
        except UsageError as error:
            raise ComponentError(str(error)) from error
    raise ComponentError(
        f"{SCHEME}{address}: expected a token for this server, got none. "
        f"Write it into the variable {TOKENS_VARIABLE}, as {address}=TOKEN."
    )


@dataclass(frozen=True, slots=True)
class FmuServer:
    """The server of one component, and the FMU that a scene has found there.

    Attributes
    ----------
    address : Address
    certificate : Path or None
        File (PEM) of the certificate that the server must show, or of the authority that has signed it; None: plain
        text, on this machine alone.
    sha256 : str
        Hash of the served FMU file.
    seconds : float
        Longest time for an answer, s.
    """

    address: Address
    certificate: Path | None
    sha256: str
    seconds: float

"""Servers of FMUs in the process of the tests, and components that run there."""

from __future__ import annotations

import datetime
import ipaddress
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from vibroimpact.orchestrator.fmu_server.server import Server, Tls
from vibroimpact.orchestrator.importer.specification import ComponentSpec
from vibroimpact.orchestrator.remote.address import TOKENS_VARIABLE, Address, FmuServer
from vibroimpact.orchestrator.remote.description import served_fmu

TOKEN = "token-of-the-tests"
HERE = Address("127.0.0.1", 0)
SECONDS = 60.0


class Servers:
    """One server for each FMU file, at free ports; all have the token `TOKEN`."""

    def __init__(self) -> None:
        self._running: dict[Path, Server] = {}

    def of(self, file: Path) -> Server:
        """Return the server of an FMU file."""
        if file not in self._running:
            self._running[file] = Server(file, HERE, TOKEN)
            know(self._running[file])
        return self._running[file]

    def there(self, spec: ComponentSpec, seconds: float = SECONDS) -> ComponentSpec:
        """Return a component that runs on the server of its FMU."""
        return elsewhere(spec, self.of(spec.fmu), seconds)

    def close(self) -> None:
        """End all servers."""
        for server in self._running.values():
            server.close()


def know(server: Server, token: str = TOKEN) -> None:
    """Let this process know the token of a server."""
    os.environ[TOKENS_VARIABLE] = f"{server.address}={token} {os.environ.get(TOKENS_VARIABLE, '')}"


def elsewhere(spec: ComponentSpec, server: Server, seconds: float = SECONDS) -> ComponentSpec:
    """Return a component that runs on a server."""
    file, sha256 = served_fmu(server.address, None)
    return replace(spec, fmu=file, server=FmuServer(server.address, None, sha256, seconds))


@contextmanager
def servers() -> Iterator[Servers]:
    """Serve FMUs for the duration of the block."""
    before = os.environ.get(TOKENS_VARIABLE)
    found = Servers()
    try:
        yield found
    finally:
        found.close()
        if before is None:
            os.environ.pop(TOKENS_VARIABLE, None)
        else:
            os.environ[TOKENS_VARIABLE] = before


def certificate(name: str = "127.0.0.1") -> Tls:
    """Return a self-signed certificate of an address or a name, with its key."""
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec

    key = ec.generate_private_key(ec.SECP256R1())
    subject = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "tests of vibroimpact")])
    now = datetime.datetime.now(datetime.UTC)
    place: x509.GeneralName
    try:
        place = x509.IPAddress(ipaddress.ip_address(name))
    except ValueError:
        place = x509.DNSName(name)
    made = (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(subject)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - datetime.timedelta(days=1))
        .not_valid_after(now + datetime.timedelta(days=1))
        .add_extension(x509.SubjectAlternativeName([place]), critical=False)
        .add_extension(x509.BasicConstraints(ca=True, path_length=None), critical=True)
        .sign(key, hashes.SHA256())
    )
    pem = serialization.Encoding.PEM
    private = key.private_bytes(pem, serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
    return Tls(made.public_bytes(pem), private)

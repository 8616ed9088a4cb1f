"""The command `vibroimpact fmu serve`."""

from __future__ import annotations

from pathlib import Path

from vibroimpact.fmus.access_token import token_at
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.terminal import say
from vibroimpact.orchestrator.fmu_server.server import Server, Tls
from vibroimpact.orchestrator.operations.fmu_serve import ServeFmu
from vibroimpact.orchestrator.remote.address import SCHEME, TOKENS_VARIABLE, Address, read_address


def serve_fmu(options: ServeFmu) -> None:
    """Serve an FMU until Ctrl-C."""
    address = read_address(options.listen)
    if address is None:
        raise UsageError(f"--listen: expected HOST:PORT, got {options.listen[:200]!r}.")
    tls = _tls(options)
    if tls is None and not address.is_loopback:
        raise UsageError(
            f"--listen: expected --certificate and --key for {address}, which other machines reach, got none."
        )
    file = options.token_file or address.token_file
    server = Server(options.file, address, token_at(file), tls)
    try:
        _say_how(server, options, file)
        server.wait()
    except KeyboardInterrupt:
        say("Ended.")
    finally:
        server.close()


def _tls(options: ServeFmu) -> Tls | None:
    """Return certificate and key; raise UsageError unless both or none are given."""
    if options.certificate is None and options.key is None:
        return None
    if options.certificate is None or options.key is None:
        given = "--key" if options.certificate is None else "--certificate"
        raise UsageError(f"--certificate: expected it with --key, got {given} alone.")
    return Tls(_pem(options.certificate, "--certificate"), _pem(options.key, "--key"))


def _pem(path: Path, option: str) -> bytes:
    try:
        content = path.read_bytes()
    except OSError as error:
        raise UsageError(f"{option}: {path}: expected a file (PEM), got {error.strerror}.") from None
    if b"-----BEGIN " not in content:
        raise UsageError(f"{option}: {path}: expected a file (PEM), got another.")
    return content


def _say_how(server: Server, options: ServeFmu, file: Path) -> None:
    """Print the address, and the lines by which a scene reaches the FMU."""
    address: Address = server.address
    say(f"{options.file.name} (SHA-256 {server.fmu.sha256[:16]}...) at {SCHEME}{address}. Ctrl-C ends it.")
    more = "" if options.certificate is None else '   certificate = "FILE.pem"'
    say(f'In a scene: fmu = "{SCHEME}{address}"{more}')
    if options.token_file is None and address.is_loopback and options.listen.endswith(f":{address.port}"):
        say(f"Its token is in {file}, where scenes of this user find it.")
    else:
        say(f"Its token is in {file}; scenes find it in {TOKENS_VARIABLE}, as {address}=TOKEN.")

"""`vibroimpact serve`: one service on one folder and one port, from its first look at both to its end."""

from __future__ import annotations

import ipaddress
import logging
import socket
from pathlib import Path

import uvicorn

from vibroimpact.analysis.files.folder_lock import locked_folder, make_folder
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.terminal import say
from vibroimpact.fmus.wording import option
from vibroimpact.service.api import application
from vibroimpact.service.fmus import FmuStore
from vibroimpact.service.logs import write_lines
from vibroimpact.service.recordings import RecordingStore
from vibroimpact.service.scenes import Shelf
from vibroimpact.service.security import Guarded, token_of
from vibroimpact.service.sessions import Sessions
from vibroimpact.service.store import DATABASE, Store
from vibroimpact.service.supervisor import Supervisor

BACKLOG = 128
"""Connections that wait to be taken."""
LAST_SECONDS = 2
"""For answers that are under way when the service is told to end."""


def serve(
    folder: Path,
    *,
    host: str,
    port: int,
    scheduler: str | None,
    allow_remote: bool,
    allow_fmu_upload: bool = False,
) -> None:
    """Serve until a signal ends it.

    Raises
    ------
    UsageError
        The folder or the port is taken, or the address is not of this machine alone and nobody allowed that.
    """
    _refuse_remote(host, allow_remote)
    _make_own(folder)
    with locked_folder(folder, "service"):
        token = token_of(folder)
        sessions = Sessions(token)
        with _bound(host, port) as listening:
            write_lines()
            store = Store(folder)
            shelf = Shelf(RecordingStore(store), FmuStore(folder / "fmus", allow_fmu_upload))
            supervisor = Supervisor(store, scheduler)
            supervisor.start()
            try:
                address = f"http://{f'[{host}]' if ':' in host else host}:{listening.getsockname()[1]}"
                say(f"Serving {folder} on {address}; the token is in {folder / 'token'}.")
                logging.getLogger("uvicorn.access").disabled = True
                config = uvicorn.Config(
                    Guarded(application(store, supervisor, shelf, sessions), token, sessions),
                    log_config=None,
                    timeout_graceful_shutdown=LAST_SECONDS,
                    server_header=False,
                )
                uvicorn.Server(config).run(sockets=[listening])
            finally:
                supervisor.close()
                store.close()
    say("Stopped. What was running goes on at the next start.")


def _make_own(folder: Path) -> None:
    """Make the folder of a service, which nobody else reads; one with other things in it is refused."""
    if folder.is_dir() and not (folder / DATABASE).exists() and any(folder.iterdir()):
        raise UsageError(
            f"{folder}: expected the folder of a service, or an empty one, got one with other things in it."
        )
    make_folder(folder)
    folder.chmod(0o700)


def _refuse_remote(host: str, allow_remote: bool) -> None:
    try:
        address = ipaddress.ip_address("127.0.0.1" if host == "localhost" else host)
    except ValueError:
        raise UsageError(f"{option('host')}: expected an address such as 127.0.0.1, got {host!r}.") from None
    if not address.is_loopback and not allow_remote:
        raise UsageError(
            f"{option('host')}: expected an address of this machine alone, got {host}. With {option('allow-remote')} "
            "whoever reaches it can try tokens and, with the right one, run simulations here; what is sent is not "
            "encrypted: put a proxy with TLS in front of it."
        )


def _bound(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # with its protocol said, asyncio sends without delay: else an answer of two writes waits 40 ms for the client's ACK
    listening = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((host, port))
        listening.listen(BACKLOG)  # who reads the address below may ask at once
    except OSError as error:
        listening.close()
        raise UsageError(
            f"{option('port')}: expected a free port, got {port}: {error.strerror or error}. Choose another."
        ) from None
    return listening

"""`vibroimpact serve`: one service on one folder and one port, from the first checks to its end."""

from __future__ import annotations

import asyncio
import ipaddress
import logging
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import uvicorn

from vibroimpact.analysis.files.atomic import write_atomically
from vibroimpact.analysis.files.folder_lock import locked_folder, make_folder
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.messages import Argument, message
from vibroimpact.fmus.packaging.unpacked_cache import hold_at_most
from vibroimpact.fmus.surroundings import refuse_no_loopback
from vibroimpact.fmus.terminal import say
from vibroimpact.service.api import application
from vibroimpact.service.connections import Connections, limited, most_connections
from vibroimpact.service.fmus import FmuStore
from vibroimpact.service.hosts import Hosts
from vibroimpact.service.logs import write_lines
from vibroimpact.service.operations.serve import Serve
from vibroimpact.service.ownership import URL_FILE, refuse_foreign_folder
from vibroimpact.service.recordings import RecordingStore
from vibroimpact.service.scenes import Shelf
from vibroimpact.service.security import Guarded, token_of
from vibroimpact.service.sessions import Sessions
from vibroimpact.service.store import DATABASE, LOG, Store
from vibroimpact.service.supervisor import Supervisor

_HOST = Argument("host")
FMUS_HELD = 8
"""Number of unpacked FMUs that the service keeps in the cache: it reads their descriptions, its jobs run them."""
BACKLOG = 128
"""Number of connections accepted in one turn of the event loop."""
MOST_UNTAKEN = 4096
"""Number of connections waiting to be accepted; beyond it the system drops one, whose client retries after 1 s."""
LAST_SECONDS = 2
"""Time for answers in progress when the service is told to end, s."""


def serve(options: Serve) -> None:
    """Serve until a signal ends it.

    Raise UsageError if the folder or the port is in use, if the address is public without permission, or if connections
    over loopback fail.
    """
    folder, host = options.data, options.host
    _refuse_remote(host, options.allow_remote)
    refuse_no_loopback("the service and its jobs are reached")
    hosts = Hosts(host, options.allow_host or ())
    _make_own(folder)
    with locked_folder(folder, "service"):
        token = token_of(folder)
        sessions = Sessions(token)
        hold_at_most(FMUS_HELD)
        with _bound(host, options.port) as listening:
            write_lines()
            store = Store(folder)
            shelf = Shelf(RecordingStore(store), FmuStore(folder / "fmus", options.allow_fmu_upload))
            supervisor = Supervisor(store, options.scheduler)
            supervisor.start()
            try:
                port = listening.getsockname()[1]
                app = Guarded(application(store, supervisor, shelf, sessions), token, sessions, hosts)
                with _written_url(folder / URL_FILE, _url(reached(host), port)):
                    say(f"Serving {folder} on {_url(host, port)}; the token is in {folder / 'token'}.")
                    _Server(app).run(sockets=[listening])
            finally:
                supervisor.close()
                store.close()
    say("Stopped. What was running goes on at the next start.")


class _Server(uvicorn.Server):
    """Server of an application on limited connections."""

    def __init__(self, app: Guarded) -> None:
        logging.getLogger("uvicorn.access").disabled = True
        self._connections = Connections(*most_connections())
        config = uvicorn.Config(
            app,
            http=limited(self._connections),
            ws="none",
            backlog=BACKLOG,
            log_config=None,
            timeout_graceful_shutdown=LAST_SECONDS,
            server_header=False,
        )
        super().__init__(config)

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Begin to listen."""
        asyncio.get_running_loop().set_exception_handler(self._connections.on_loop_error)
        await super().startup(sockets)
        for listening in sockets or ():
            listening.listen(MOST_UNTAKEN)  # asyncio has set the number of its own turns


def _make_own(folder: Path) -> None:
    """Make the folder of a service, private to its user; raise UsageError for a folder with other contents."""
    refuse_foreign_folder(folder, DATABASE)
    if folder.is_dir() and not (folder / DATABASE).exists() and any(folder.iterdir()):
        raise UsageError(
            f"{folder}: expected the folder of a service, or an empty one, got one with other things in it."
        )
    make_folder(folder)
    folder.chmod(0o700)


def reached(host: str) -> str:
    """Return the address by which this machine reaches a service that listens on an address.

    >>> reached("0.0.0.0"), reached("::"), reached("127.0.0.1")
    ('127.0.0.1', '::1', '127.0.0.1')
    """
    return {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(host, host)


@contextmanager
def _written_url(path: Path, url: str) -> Iterator[None]:
    """Keep the address of a running service in its folder for clients; they can also be given it otherwise."""
    try:
        write_atomically(path, f"{url}\n".encode())
    except OSError as error:
        LOG.warning("its address is not written", extra={"why": str(error)})
        yield
        return
    try:
        yield
    finally:
        path.unlink(missing_ok=True)


def _url(host: str, port: int) -> str:
    return f"http://{f'[{host}]' if ':' in host else host}:{port}"


def _refuse_remote(host: str, allow_remote: bool) -> None:
    try:
        address = ipaddress.ip_address("127.0.0.1" if host == "localhost" else host)
    except ValueError:
        raise UsageError(message(_HOST, f": expected an address such as 127.0.0.1, got {host!r}.")) from None
    if not address.is_loopback and not allow_remote:
        raise UsageError(
            message(
                *(_HOST, f": expected an address of this machine alone, got {host}. With "),
                Argument("allow_remote"),
                " whoever reaches it can try tokens and, with the right one, run simulations here; what is sent is not "
                "encrypted: put a proxy with TLS in front of it.",
            )
        )


def _bound(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # without the protocol, asyncio delays small packets: an answer of two writes would wait 40 ms for the client's ACK
    listening = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((host, port))
        listening.listen(MOST_UNTAKEN)  # a reader of the address below may connect at once
    except OSError as error:
        listening.close()
        raise UsageError(
            message(
                Argument("port"),
                f": expected a free port, got {port}: {error.strerror or error}. Choose another.",
            )
        ) from None
    return listening

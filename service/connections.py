"""Connections of the service: limits of their number, of the size of a head, and of the time for a request to arrive.

Anybody who reaches the port can open connections, with or without the token. These limits need no knowledge of the
sender.
"""

from __future__ import annotations

import asyncio
import json
import logging
import sys
import time
from collections.abc import Iterator, Sequence
from http import HTTPStatus
from itertools import islice, takewhile
from typing import Any

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

from vibroimpact.service.passing import SHORT
from vibroimpact.service.problems import MEDIA_TYPE, problem
from vibroimpact.service.turns import Turns

MOST_CONNECTIONS = 500
"""Largest number of open connections; one more closes old unauthenticated ones, those without a whole request first."""
YOUNG_SECONDS = 1.0
"""Age, s, below which a connection is closed only beyond `MOST_YOUNG`: its request may be on the way."""
MOST_YOUNG = 4
"""Largest number of open connections together with young ones, relative to `MOST_CONNECTIONS`."""
SHARE_CLOSED = 1 / 16
"""Share of the connections that is closed at a time; closing many at once makes the search for candidates rare."""
MOST_HEAD = 16 * 2**10
"""Largest size of request line and headers, byte; a longer head is refused (431)."""
HEAD_SECONDS = 10.0
"""Time for a whole head to arrive, s; then the connection is closed."""
CREDIT_SECONDS = 30.0
"""Silence of a body that should arrive, or of an answer's reader, after which the connection is closed, s."""
LEAST_RATE = 10_000.0
"""Mean rate of a body, or of reading an answer, byte/s, below which the credit of `CREDIT_SECONDS` is used up."""
SWEEP_SECONDS = 1.0
"""Interval between two checks of all connections, s."""
DESCRIPTORS = 4096
"""Number of open files that the service allows itself, if the system does."""
RESERVED = 200
"""Number of open files for other uses: database, pipes, files that are sent, new connections."""
FEWEST_CONNECTIONS = 16
"""Number of connections allowed even where the system allows few open files."""
CLOSED_IN_SHORTAGE = 32
"""Number of unauthenticated connections to close when the system runs out of open files."""
LOG_INTERVAL = 60.0
"""Interval at which a lasting shortage is logged again, s."""
LOG = logging.getLogger("vibroimpact.service")
KNOWN = "vibroimpact.known"
"""Extension of an ASGI scope. `tell` reports that the sender of the request has the token, `turn` waits for the turn of
a sender without it."""


def most_connections() -> tuple[int, int]:
    """Raise this process's limit of open files as far as allowed; return the numbers of connections that fit.

    The first number excludes connections that were just opened, the second includes them.
    """
    most, with_young = MOST_CONNECTIONS, MOST_YOUNG * MOST_CONNECTIONS
    if sys.platform == "win32":
        return most, most  # `select` handles 512
    import resource

    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    allowed = DESCRIPTORS if hard == resource.RLIM_INFINITY else min(hard, DESCRIPTORS)
    if soft != resource.RLIM_INFINITY and soft < allowed:
        resource.setrlimit(resource.RLIMIT_NOFILE, (allowed, hard))
        soft = allowed
    if soft == resource.RLIM_INFINITY:
        return most, with_young
    room = max(soft - RESERVED, FEWEST_CONNECTIONS)
    return min(most, room), min(with_young, room)


class Connections:
    """The open connections of one service, the oldest first.

    At most `most` are open at a time, or `most_with_young` with those just opened. `turns` are the turns of
    unauthenticated requests.
    """

    def __init__(self, most: int, most_with_young: int) -> None:
        self._most, self._most_with_young = most, most_with_young
        self.turns = Turns()
        self._open: dict[LimitedProtocol, None] = {}
        self._sweep: asyncio.TimerHandle | None = None
        self._swept, self._logged = 0.0, -LOG_INTERVAL

    def __len__(self) -> int:
        """Return the number of open connections."""
        return len(self._open)

    def add(self, connection: LimitedProtocol) -> None:
        """Add a connection; above the limit, close the oldest expendable ones, else the new one."""
        self._open[connection] = None
        if len(self._open) > self._most:
            expendable = list(islice(self._expendable(self._old()), max(1, int(SHARE_CLOSED * self._most))))
            if not expendable and len(self._open) > self._most_with_young:
                expendable = next(([one] for one in self._expendable(self._others(connection))), [connection])
            for one in expendable:
                self._close(one)
        if self._sweep is None and self._open:
            self._swept = time.monotonic()
            self._sweep = asyncio.get_running_loop().call_later(SWEEP_SECONDS, self._look)

    def discard(self, connection: LimitedProtocol) -> None:
        """Remove a closed connection."""
        self.turns.leave(connection)
        self._open.pop(connection, None)

    def on_loop_error(self, loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        """Handle an error of the event loop: a shortage of open files closes unauthenticated connections."""
        error = context.get("exception")
        if not (isinstance(error, OSError) and error.errno in SHORT):
            loop.default_exception_handler(context)
            return
        for connection in list(islice(self._expendable(list(self._open)), CLOSED_IN_SHORTAGE)):
            self._close(connection)
        if time.monotonic() - self._logged >= LOG_INTERVAL:
            self._logged = time.monotonic()
            LOG.warning("no connection can be taken now", extra={"why": str(error)})

    def _old(self) -> list[LimitedProtocol]:
        """Return unauthenticated connections that are old enough for their request to have arrived."""
        latest = time.monotonic() - YOUNG_SECONDS
        return [one for one in takewhile(lambda one: one.taken <= latest, self._open) if not one.is_known]

    def _others(self, new: LimitedProtocol) -> list[LimitedProtocol]:
        return [one for one in self._open if one is not new]

    def _expendable(self, among: Sequence[LimitedProtocol]) -> Iterator[LimitedProtocol]:
        """Yield connections in the order of closing: unauthenticated ones first, those with a whole request later."""
        yield from (one for one in among if not one.is_known and not one.is_whole())
        yield from (one for one in among if not one.is_known and one.is_whole())
        yield from (one for one in among if one.is_known and not one.is_whole())

    def _close(self, connection: LimitedProtocol) -> None:
        self.discard(connection)
        connection.transport.abort()

    def spend(self, seconds: float) -> None:
        """Charge elapsed time (s) to each connection that keeps the service waiting; close those without credit."""
        for connection in list(self._open):
            connection.spend(seconds)

    def _look(self) -> None:
        now = time.monotonic()
        # delays of the service itself are not charged
        self.spend(min(now - self._swept, 2.0 * SWEEP_SECONDS))
        self._sweep, self._swept = None, now
        if self._open:
            self._sweep = asyncio.get_running_loop().call_later(SWEEP_SECONDS, self._look)


class _BoundedHead(h11.Connection):
    """Parser that refuses a head above `MOST_HEAD` before it is parsed, in any number of pieces."""

    is_too_long = False

    def next_event(self) -> Any:
        """Return the next event; raise RemoteProtocolError for a head that is too long or is not HTTP."""
        if self.their_state is h11.IDLE:
            waiting, _ = self.trailing_data
            if len(waiting) > MOST_HEAD and not _ends_in(waiting[:MOST_HEAD]):
                self.is_too_long = True
                raise h11.RemoteProtocolError("head too long", HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE)
        return super().next_event()


def _ends_in(head: bytes) -> bool:
    """Return whether a head ends within these bytes."""
    return b"\n\r\n" in head or b"\n\n" in head


class LimitedProtocol(H11Protocol):
    """One connection: its head has a deadline and a size limit, its body and its reader a least rate."""

    all_open: Connections

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Register the connection."""
        super().connection_made(transport)
        self.conn = _BoundedHead(h11.SERVER, MOST_HEAD)
        self.is_known = False
        self.taken = time.monotonic()
        self._requests = 0
        self._received = 0
        self._unsent = 0
        self._phase: tuple[str, object] = ("head", None)
        self._credit = HEAD_SECONDS
        self.all_open.add(self)

    def connection_lost(self, exc: Exception | None) -> None:
        """Discard the connection."""
        self.all_open.discard(self)
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Take the received bytes."""
        self._received += len(data)
        super().data_received(data)

    def handle_events(self) -> None:
        """Begin the requests that have arrived."""
        before = self.cycle
        super().handle_events()
        if self.cycle is not before:  # its task has not begun yet
            self._requests += 1
            self.scope.setdefault("extensions", {})[KNOWN] = {"tell": self._become_known, "turn": self._turn}

    def _become_known(self) -> None:
        self.is_known = True

    async def _turn(self, is_brief: bool) -> bool:
        """Wait for the turn of an unauthenticated request; return whether the connection is still open.

        A brief request does not wait if it is the first of its connection.
        """
        return (is_brief and self._requests == 1) or await self.all_open.turns.wait(self)

    def resume_writing(self) -> None:
        """Restore the credit: the answer is being read."""
        self._credit = CREDIT_SECONDS
        super().resume_writing()

    def is_whole(self) -> bool:
        """Return whether a whole request has arrived whose answer is not complete."""
        return self.conn.their_state not in (h11.IDLE, h11.SEND_BODY) and not self.transport.is_closing()

    def spend(self, seconds: float) -> None:
        """Charge elapsed time (s) to the credit of the present phase; close the connection when none is left."""
        phase = (self._waits_for(), self.cycle)
        if phase != self._phase:
            self._phase = phase
            self._credit = CREDIT_SECONDS if phase[0] in ("body", "reader") else HEAD_SECONDS
        earned = self._earned()
        self._credit = min(self._credit - seconds + earned, CREDIT_SECONDS)
        if self._credit < 0.0:
            self._give_up()

    def _waits_for(self) -> str:
        """Return the present phase: the service waits for the end, a head, a body, a reader, or for itself."""
        theirs, ours = self.conn.their_state, self.conn.our_state
        is_answered = theirs is h11.IDLE or ours is h11.DONE or self.transport.is_closing()
        if self.flow.write_paused or (is_answered and self.transport.get_write_buffer_size()):
            return "reader"
        if self.transport.is_closing() or (theirs is h11.SEND_BODY and ours is h11.DONE):
            return "end"  # the rest of a body is useless once its answer is complete
        if theirs is h11.IDLE:
            return "head"
        return "body" if theirs is h11.SEND_BODY and not self.flow.read_paused else "itself"

    def _earned(self) -> float:
        """Return the credit for the bytes received, or sent, since the last check, s."""
        received, self._received = self._received, 0
        unsent = self.transport.get_write_buffer_size()
        sent, self._unsent = max(self._unsent - unsent, 0), unsent
        return {
            "body": received / LEAST_RATE,
            "reader": sent / LEAST_RATE,
            "itself": CREDIT_SECONDS,
        }.get(self._phase[0], 0.0)

    def _give_up(self) -> None:
        phase = self._phase[0]
        began = self.conn.their_state is h11.SEND_BODY or bool(self.conn.trailing_data[0])
        if phase not in ("head", "body") or not began:
            self.transport.abort()
            return
        rule = (
            f"a head within {HEAD_SECONDS:.0f} s"
            if phase == "head"
            else f"a body of {LEAST_RATE / 1000.0:.0f} kB/s or faster"
        )
        self._refuse(HTTPStatus.REQUEST_TIMEOUT, f"expected {rule}, got a slower one.")

    def send_400_response(self, msg: str) -> None:
        """Refuse a request that is not HTTP/1.1, or whose head is too long."""
        if isinstance(self.conn, _BoundedHead) and self.conn.is_too_long:
            status = HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE
            self._refuse(status, f"expected a head of at most {MOST_HEAD} byte, got a longer one.")
        else:
            self._refuse(HTTPStatus.BAD_REQUEST, "expected a request of HTTP/1.1, got something else.")

    def _refuse(self, status: HTTPStatus, detail: str) -> None:
        """Answer in place of the application, and close."""
        if self.cycle is not None:
            self.cycle.disconnected = True  # the application's further output is dropped
            self.cycle.message_event.set()
        if self.conn.our_state not in (h11.IDLE, h11.SEND_RESPONSE):
            self.transport.abort()
            return
        body = json.dumps(problem(status, detail)).encode()
        headers = [
            ("content-type", MEDIA_TYPE),
            ("content-length", str(len(body))),
            ("connection", "close"),
        ]
        parts = (
            h11.Response(status_code=status, headers=headers, reason=status.phrase.encode()),
            h11.Data(data=body),
            h11.EndOfMessage(),
        )
        for part in parts:
            self.transport.write(self.conn.send(part) or b"")
        self.transport.close()


def limited(within: Connections) -> type[LimitedProtocol]:
    """Return the protocol class whose connections are counted in `within`."""

    class Limited(LimitedProtocol):
        all_open = within

    return Limited

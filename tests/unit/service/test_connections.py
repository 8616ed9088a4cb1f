"""Unauthenticated connections are limited: in number, in the size of a head, in the time for head, body and answer."""

from __future__ import annotations

import asyncio
import errno
import logging
import select
import socket
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from typing import Any

import pytest
import uvicorn

from vibroimpact.service import connections as module
from vibroimpact.service.connections import (
    CREDIT_SECONDS,
    HEAD_SECONDS,
    KNOWN,
    LEAST_RATE,
    Connections,
    limited,
)

MOST, MOST_WITH_YOUNG = 6, 20
SILENT = b""
HALF = b"GET / HTTP/1.1\r\nHost: a\r\nX: "
ASKED = b"GET / HTTP/1.1\r\nHost: a\r\n\r\n"
OWN = ASKED.replace(b"/ ", b"/own ")
"""A request of a client with the token."""
LARGE = ASKED.replace(b"/ ", b"/large ")
BODY = b"POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 400000\r\n\r\n"
CHUNKED = BODY.replace(b"Content-Length: 400000", b"Transfer-Encoding: chunked")
REFUSED = BODY.replace(b"/ ", b"/refused ")
HELD = ASKED.replace(b"/ ", b"/held ")
LENGTH = 16_000_000
"""Size of the large answer, byte: more than the buffers of a connection hold."""


async def answering(scope: Any, receive: Any, send: Any) -> None:
    """Answer a whole request: `/refused` at once, `/held` never, `/large` with more than a socket holds."""
    if scope["path"] == "/own":
        scope["extensions"][KNOWN]["tell"]()
    while scope["path"] != "/refused":
        message = await receive()
        if message["type"] == "http.disconnect":
            return
        if not message["more_body"] and scope["path"] != "/held":
            break
    body = bytes(LENGTH if scope["path"] == "/large" else 2)
    head = [(b"content-length", str(len(body)).encode())]
    await send({"type": "http.response.start", "status": 200, "headers": head})
    await send({"type": "http.response.body", "body": body})


class Listening(uvicorn.Server):
    """A limited server in a thread of this process; the test controls its time."""

    def __init__(self) -> None:
        self.connections = Connections(MOST, MOST_WITH_YOUNG)
        self.socket = socket.create_server(("127.0.0.1", 0))
        protocol = limited(self.connections)
        super().__init__(
            uvicorn.Config(
                answering, http=protocol, ws="none", lifespan="off", log_config=None, timeout_keep_alive=600
            )
        )
        self.thread = threading.Thread(target=self.run, args=([self.socket],), daemon=True)
        self.opened: list[socket.socket] = []

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        self.loop = asyncio.get_running_loop()
        await super().startup(sockets)

    def open(self, sent: bytes) -> socket.socket:
        """Connect, send bytes, and wait until the server has them."""
        connection = socket.create_connection(self.socket.getsockname(), 20.0)
        self.opened.append(connection)
        connection.sendall(sent)
        self.turns()
        return connection

    def turns(self) -> None:
        """Let the server do its pending work."""
        for _ in range(6):  # accept, begin, read, answer
            self.call(lambda: None)

    def call(self, what: Callable[[], object]) -> None:
        """Call a function in the thread of the server."""
        done: Future[None] = Future()
        self.loop.call_soon_threadsafe(lambda: done.set_result(what() and None))
        done.result(20.0)

    def pass_time(self, seconds: float) -> None:
        """Advance the server's time in steps of a second."""
        while seconds > 0.0:
            self.call(lambda: self.connections.spend(1.0))
            seconds -= 1.0


@pytest.fixture
def listening(monkeypatch: pytest.MonkeyPatch) -> Iterator[Listening]:
    monkeypatch.setattr(module, "SWEEP_SECONDS", 1e6)
    monkeypatch.setattr(module, "YOUNG_SECONDS", 0.0)
    server = Listening()
    server.thread.start()
    while not server.started:
        server.thread.join(0.01)
    yield server
    for connection in server.opened:
        connection.close()
    server.should_exit = True
    server.thread.join()


def end_of(connection: socket.socket) -> bytes:
    """Return all bytes of the answer until the connection ends."""
    answer = bytearray()
    try:
        while block := connection.recv(65536):
            answer += block
    except ConnectionResetError:
        pass
    return bytes(answer)


@pytest.mark.parametrize(
    ("sent", "seconds", "answer"),
    [
        (SILENT, HEAD_SECONDS, b""),
        (HALF, HEAD_SECONDS, b" 408 "),
        (BODY, CREDIT_SECONDS, b" 408 "),
        (REFUSED, HEAD_SECONDS, b" 200 "),
        (ASKED, HEAD_SECONDS, b" 200 "),
    ],
    ids=["silent", "half a head", "half a body", "a body that nobody waits for", "kept alive"],
)
def test_no_connection_stays_that_does_not_ask(
    listening: Listening, sent: bytes, seconds: float, answer: bytes
) -> None:
    connection = listening.open(sent)
    listening.pass_time(seconds - 1.0)
    assert len(listening.connections) == 1
    listening.pass_time(3.0)
    found = end_of(connection)
    assert answer in found.split(b"\r\n")[0]
    assert (b"problem+json" in found) == (answer == b" 408 ")
    listening.turns()
    assert not len(listening.connections)


@pytest.mark.parametrize("sent", [HALF, BODY, REFUSED], ids=["head", "body", "body that nobody waits for"])
def test_a_byte_now_and_then_buys_no_time(listening: Listening, sent: bytes) -> None:
    connection = listening.open(sent)
    for _ in range(int(CREDIT_SECONDS) + 2):
        try:
            connection.sendall(b"x")
        except OSError:
            break
        listening.turns()
        listening.pass_time(1.0)
    listening.turns()
    assert not len(listening.connections)


def test_a_body_that_arrives_fast_enough_is_taken_however_long_it_takes(listening: Listening) -> None:
    connection, block = listening.open(BODY), bytes(int(LEAST_RATE))
    for _ in range(40):
        connection.sendall(block)
        listening.turns()
        listening.pass_time(1.0)
    assert b" 200 " in connection.recv(100)


def test_an_answer_that_nobody_reads_is_given_up_and_one_that_is_read_is_not(listening: Listening) -> None:
    reader, idle = listening.open(LARGE), listening.open(LARGE)
    read = 0
    for _ in range(8):
        while read < LENGTH and select.select([reader], [], [], 0.0)[0]:
            read += len(reader.recv(2**20))
        listening.turns()
        listening.pass_time(CREDIT_SECONDS / 4.0)
    assert len(end_of(idle)) < LENGTH
    assert read + len(end_of(reader)) > LENGTH


def test_one_who_asks_at_once_is_answered_among_any_number_who_do_not(listening: Listening) -> None:
    for sent in (SILENT, HALF, BODY, LARGE, REFUSED) * MOST:
        listening.open(sent)
        assert len(listening.connections) <= MOST
    assert listening.open(ASKED).recv(12).endswith(b" 200")


def test_one_whose_request_is_on_the_way_is_answered_among_any_number_who_come_meanwhile(
    listening: Listening, monkeypatch: pytest.MonkeyPatch
) -> None:
    for _ in range(MOST):
        listening.open(HELD)
    monkeypatch.setattr(module, "YOUNG_SECONDS", 1e6)
    late = listening.open(SILENT)
    for _ in range(MOST_WITH_YOUNG - MOST - 1):
        listening.open(SILENT)
    late.sendall(ASKED)
    assert late.recv(12).endswith(b" 200")
    for _ in range(3 * MOST_WITH_YOUNG):
        listening.open(SILENT)
    assert len(listening.connections) == MOST_WITH_YOUNG
    assert listening.open(ASKED).recv(12).endswith(b" 200")


def test_connections_that_come_together_are_read_before_one_of_them_is_closed(
    listening: Listening, monkeypatch: pytest.MonkeyPatch
) -> None:
    for _ in range(MOST):
        listening.open(HELD)  # whole requests, which are closed last
    monkeypatch.setattr(module, "YOUNG_SECONDS", 1e6)
    busy = threading.Event()
    listening.loop.call_soon_threadsafe(busy.wait)
    together = [socket.create_connection(listening.socket.getsockname(), 20.0) for _ in range(MOST)]
    listening.opened += together
    for one in together:
        one.sendall(ASKED)
    busy.set()
    assert all(one.recv(12).endswith(b" 200") for one in together)


def test_who_has_the_token_keeps_the_connection_while_strangers_come(listening: Listening) -> None:
    own = listening.open(OWN)
    assert own.recv(4096).endswith(bytes(2))
    own.sendall(BODY)  # the rest of the request is slow
    for _ in range(3 * MOST):
        listening.open(SILENT)
    own.sendall(bytes(400_000))
    assert b" 200 " in own.recv(100)


@pytest.mark.parametrize("step", [1000, 10**9], ids=["in pieces", "at once"])
@pytest.mark.parametrize(
    "head",
    [
        b"GET / HTTP/1.1\r\nHost: a\r\nCookie: " + b"x" * 20_000 + b"\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: a\r\n" + b"a:b\r\n" * 50_000 + b"\r\n",
        b"GET /" + b"x" * 20_000 + b" HTTP/1.1\r\nHost: a\r\n\r\n",
        ASKED + b"GET / HTTP/1.1\r\nHost: a\r\nCookie: " + b"x" * 20_000 + b"\r\n\r\n",
    ],
    ids=["one header", "many", "the target", "of the second request"],
)
def test_a_long_head_is_refused_however_it_arrives(listening: Listening, head: bytes, step: int) -> None:
    connection = listening.open(b"")
    threading.Thread(target=_send, args=(connection, head, step), daemon=True).start()
    assert b" 431 " in end_of(connection)


def _send(connection: socket.socket, content: bytes, step: int) -> None:
    try:
        for place in range(0, len(content), step):
            connection.sendall(content[place : place + step])
    except OSError:
        return  # refused before its end


def test_a_head_of_all_that_is_allowed_is_taken(listening: Listening) -> None:
    head = b"GET / HTTP/1.1\r\nHost: a\r\nCookie: " + b"x" * 16_000 + b"\r\n\r\n"
    assert listening.open(head).recv(12).endswith(b" 200")


@pytest.mark.parametrize(
    "sent", [b"\x16\x03\x01\r\n\r\n", b"GET\r\n\r\n", b"\r\n\r\n\r\n", CHUNKED + b"zz\r\n\r\n"]
)
def test_what_is_no_http_is_one_short_answer_and_no_traceback(
    listening: Listening, caplog: pytest.LogCaptureFixture, sent: bytes
) -> None:
    found = end_of(listening.open(sent))
    assert found.startswith(b"HTTP/1.1 400")
    assert b"problem+json" in found
    assert not [record for record in caplog.records if record.exc_info]


def test_a_system_without_descriptors_is_said_once_and_strangers_make_room(
    listening: Listening, caplog: pytest.LogCaptureFixture
) -> None:
    for _ in range(MOST):
        listening.open(HALF)
    assert len(listening.connections) == MOST
    full = {"message": "accept", "exception": OSError(errno.EMFILE, "Too many open files")}
    with caplog.at_level(logging.WARNING):
        for _ in range(40):
            listening.call(lambda: listening.connections.on_loop_error(listening.loop, full))
    assert len(caplog.records) == 1
    assert not len(listening.connections)

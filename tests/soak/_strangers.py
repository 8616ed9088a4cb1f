"""Attacks of a stranger without the token on a port: each way runs until its time is over."""

from __future__ import annotations

import os
import random
import resource
import socket
import time
from collections.abc import Callable, Iterator, MutableSequence

NOBODY = 65534
"""User and group of strangers, where the current user may become another."""
MOST_OPEN = 1500
"""Connections that one stranger keeps open."""
DESCRIPTORS = 4096
"""Open files that a stranger allows itself, where the system permits."""
WAY_SECONDS = 3.0
"""Time after which a stranger goes on to the next way, s."""
Place = tuple[str, int]
HOST = b"Host: 127.0.0.1\r\n"
ANYTHING = b"GET /api/v1/campaigns HTTP/1.1\r\n" + HOST + b"\r\n"


def attack(place: Place, ways: list[str], seed: int, seconds: float, opened: MutableSequence[int]) -> None:
    """Attack in the given ways for a number of seconds, as another user where the system permits.

    `opened` counts the connections of each of `WAYS`, in their order.
    """
    _become_a_stranger()
    chance, end = random.Random(seed), time.monotonic() + seconds
    while time.monotonic() < end:
        for way in ways:
            opened[list(WAYS).index(way)] += WAYS[way](
                place, chance, min(end, time.monotonic() + WAY_SECONDS)
            )


def _become_a_stranger() -> None:
    if os.geteuid() == 0:
        os.setgroups([])
        os.setgid(NOBODY)
        os.setuid(NOBODY)
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(hard, DESCRIPTORS), hard))


def _opened(place: Place, count: int, end: float) -> Iterator[socket.socket]:
    for _ in range(count):
        if time.monotonic() > end:
            return
        connection = socket.socket()
        connection.settimeout(1.0)
        try:
            connection.connect(place)
        except OSError:
            connection.close()
            continue
        yield connection


def _sent(connection: socket.socket, content: bytes) -> bool:
    try:
        connection.sendall(content)
    except OSError:
        return False
    return True


def idle(place: Place, chance: random.Random, end: float) -> int:
    """Open as many connections as possible, and send nothing or half a request."""
    kept = []
    for connection in _opened(place, MOST_OPEN, end):
        kept.append(connection)
        _sent(connection, chance.choice([b"", b"G", ANYTHING[:-2], HOST]))
    time.sleep(max(end - time.monotonic(), 0.0))
    return _closed(kept)


def _closed(connections: list[socket.socket]) -> int:
    for connection in connections:
        connection.close()
    return len(connections)


def slow(place: Place, chance: random.Random, end: float) -> int:
    """Send heads and bodies byte by byte."""
    body = b"POST /api/v1/recordings?name=a.txt HTTP/1.1\r\n" + HOST + b"Content-Length: 100000000\r\n\r\n"
    kept = list(_opened(place, 100, end))
    for connection in kept:
        _sent(connection, chance.choice([ANYTHING[:20], body]))
    while time.monotonic() < end:
        for connection in kept:
            _sent(connection, b"x")
        time.sleep(0.2)
    return _closed(kept)


def huge(place: Place, chance: random.Random, end: float) -> int:
    """Send heads, cookies and bodies of megabytes."""
    heads = [
        b"GET / HTTP/1.1\r\n" + HOST + b'Cookie: x="' + b"\\" * 60_000 + b'"\r\n\r\n',
        b"GET / HTTP/1.1\r\n" + HOST + b"a:b\r\n" * 200_000 + b"\r\n",
        b"GET /" + b"%41" * 1_000_000 + b" HTTP/1.1\r\n" + HOST + b"\r\n",
        b"POST /api/v1/campaigns HTTP/1.1\r\n" + HOST + b"Content-Length: 4000000\r\n\r\n" + b"[" * 4_000_000,
        b"POST / HTTP/1.1\r\n" + HOST + b"Transfer-Encoding: chunked\r\n\r\nffffff\r\n" + b"x" * 4_000_000,
    ]
    count = 0
    while time.monotonic() < end:
        for connection in _opened(place, 8, end):
            with connection:
                _sent(connection, chance.choice(heads))
            count += 1
    return count


def many(place: Place, chance: random.Random, end: float) -> int:
    """Send many requests on one connection, without reading an answer."""
    paths = [b"/", b"/page/main.js", b"/api/v1/campaigns", b"/metrics", b"/nothing/%00"]
    kept: list[socket.socket] = []
    count = 0
    while time.monotonic() < end:
        for connection in _opened(place, 20, end):
            kept.append(connection)
            _sent(connection, ANYTHING.replace(b"/api/v1/campaigns", chance.choice(paths)) * 20)
        time.sleep(0.05)
        count += _closed(kept[:-200])
        kept = kept[-200:]
    return count + _closed(kept)


def half_closed(place: Place, chance: random.Random, end: float) -> int:
    """Close one direction after a part of a request, or noise, and keep the other."""
    kept = []
    for connection in _opened(place, 300, end):
        kept.append(connection)
        _sent(connection, chance.choice([ANYTHING, ANYTHING[:30], chance.randbytes(2000), b""]))
        try:
            connection.shutdown(chance.choice([socket.SHUT_WR, socket.SHUT_RD]))
        except OSError:
            continue  # the service was faster
    time.sleep(min(max(end - time.monotonic(), 0.0), 1.0))
    return _closed(kept)


WAYS: dict[str, Callable[[Place, random.Random, float], int]] = {
    one.__name__: one for one in (idle, slow, huge, many, half_closed)
}

"""Requests without the token take turns, and none of them holds a thread: others do not wait behind them."""

from __future__ import annotations

import asyncio
import inspect
import socket
import threading
import time
from typing import Any

import pytest
from fastapi import FastAPI
from fastapi.routing import APIRoute

from vibroimpact.service.connections import KNOWN
from vibroimpact.service.hosts import Hosts
from vibroimpact.service.page_files import serve_page
from vibroimpact.service.security import HEALTH, Guarded
from vibroimpact.service.serving import _Server
from vibroimpact.service.sessions import Sessions
from vibroimpact.service.turns import PAUSE_RATIO, Turns

STRANGERS = 6
TURN_SECONDS = 0.01
WAITING = 300
"""Number of connections to a busy service: more than it accepts in one pass."""


def test_strangers_take_turns_in_their_order_and_leave_half_of_the_time_to_others() -> None:
    order: list[int] = []

    async def stranger(turns: Turns, place: int) -> None:
        assert await turns.wait(place)
        order.append(place)
        time.sleep(TURN_SECONDS)

    async def all_of_them() -> float:
        turns, began = Turns(), time.monotonic()
        await asyncio.gather(*(stranger(turns, place) for place in range(STRANGERS)))
        return time.monotonic() - began

    taken = asyncio.run(all_of_them())
    assert order == list(range(STRANGERS))
    assert taken > (STRANGERS + (STRANGERS - 1) * PAUSE_RATIO) * TURN_SECONDS


def test_a_connection_that_is_closed_gives_its_turn_to_the_next() -> None:
    async def two() -> list[bool]:
        turns = Turns()
        waiting = [asyncio.ensure_future(turns.wait(name)) for name in "ab"]
        await asyncio.sleep(0)
        turns.leave("a")
        turns.leave("none")
        found = await asyncio.gather(*waiting)
        assert not len(turns)
        return found

    assert asyncio.run(two()) == [False, True]


def test_a_task_that_is_cancelled_holds_no_turn() -> None:
    async def two() -> bool:
        turns = Turns()
        first, second = (asyncio.ensure_future(turns.wait(name)) for name in "ab")
        await asyncio.sleep(0)
        first.cancel()
        return await asyncio.wait_for(second, 5.0)

    assert asyncio.run(two())


@pytest.mark.parametrize(
    ("path", "token", "expected", "turn", "is_answered"),
    [
        ("/inside", "secret", [], False, True),
        ("/inside", "wrong", [False], True, True),
        ("/inside", "wrong", [False], False, False),
        (HEALTH, "wrong", [True], True, True),
    ],
    ids=["with the token", "a stranger", "a stranger who left", "health"],
)
def test_only_requests_without_the_token_wait_for_a_turn(
    path: str, token: str, expected: list[bool], turn: bool, is_answered: bool
) -> None:
    waited: list[bool] = []
    sent: list[Any] = []

    async def wait(is_brief: bool) -> bool:
        waited.append(is_brief)
        return turn

    async def inside(scope: Any, receive: Any, send: Any) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": []})

    async def send(message: Any) -> None:
        sent.append(message)

    async def receive() -> Any:
        return {"type": "http.request", "body": b"", "more_body": False}

    scope = {
        **{
            "type": "http",
            "method": "GET",
            "path": path,
            "headers": [(b"authorization", f"Bearer {token}".encode())],
        },
        "extensions": {KNOWN: {"tell": lambda: None, "turn": wait}},
    }
    guarded = Guarded(inside, "secret", Sessions("secret"), Hosts("127.0.0.1"))
    asyncio.run(guarded(scope, receive, send))
    assert waited == expected
    assert bool(sent) is is_answered


def test_what_is_open_to_strangers_takes_no_thread() -> None:
    app = FastAPI()
    serve_page(app)
    routes = [route for route in app.routes if isinstance(route, APIRoute)]
    assert routes
    assert all(inspect.iscoroutinefunction(route.endpoint) for route in routes)


def test_a_busy_service_drops_no_connection_that_waits_to_be_taken() -> None:
    async def nothing(scope: Any, receive: Any, send: Any) -> None:
        """Answer nothing."""

    server = _Server(Guarded(nothing, "secret", Sessions("secret"), Hosts("127.0.0.1")))
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM, socket.IPPROTO_TCP) as listening:
        listening.bind(("127.0.0.1", 0))
        thread = threading.Thread(target=server.run, args=([listening],), daemon=True)
        thread.start()
        while not server.started:
            thread.join(0.01)
        busy = threading.Event()
        server.servers[0].get_loop().call_soon_threadsafe(busy.wait)
        try:
            # a dropped connection is retried after 1 s
            waiting = [socket.create_connection(listening.getsockname(), 0.5) for _ in range(WAITING)]
            assert {one.getpeername() for one in waiting} == {listening.getsockname()}
        finally:
            busy.set()
            server.should_exit = server.force_exit = True
        for one in waiting:
            one.close()
        thread.join()

"""Turns of requests without the token: one at a time, so that requests with the token do not wait behind them."""

from __future__ import annotations

import asyncio

INTERVAL_SECONDS = 0.001
"""Least time between the end of an unauthenticated request's turn and the next turn, s."""
PAUSE_RATIO = 1.0
"""Least time between two turns, relative to the duration of a turn: half of the event loop is free for others."""
PASSES = 2
"""Number of passes of the event loop in which the request of a turn is answered."""


class Turns:
    """Gives turns to waiting connections, first come, first served.

    The event loop is free for others between two turns, for any number of waiting connections.

    >>> async def waited():
    ...     turns = Turns()
    ...     return await asyncio.gather(turns.wait("a"), turns.wait("b"), turns.wait("c"))
    >>> asyncio.run(waited())
    [True, True, True]
    """

    def __init__(self) -> None:
        self._waiting: dict[object, asyncio.Future[bool]] = {}
        self._is_planned = False
        self._due = 0.0

    def __len__(self) -> int:
        """Return the number of waiting connections."""
        return len(self._waiting)

    async def wait(self, connection: object) -> bool:
        """Wait for the turn of a connection; return whether it came before the connection left."""
        turn: asyncio.Future[bool] = asyncio.get_running_loop().create_future()
        self._waiting[connection] = turn
        if not self._is_planned:
            self._plan()
        return await turn

    def leave(self, connection: object) -> None:
        """End the wait of a closed connection."""
        turn = self._waiting.pop(connection, None)
        if turn is not None and not turn.done():
            turn.set_result(False)

    def _plan(self) -> None:
        self._is_planned = bool(self._waiting)
        if self._waiting:
            asyncio.get_running_loop().call_at(self._due, self._give)

    def _give(self) -> None:
        loop = asyncio.get_running_loop()
        given, is_given = loop.time(), False
        while self._waiting and not is_given:
            turn = self._waiting.pop(next(iter(self._waiting)))
            is_given = not turn.done()
            if is_given:
                turn.set_result(True)
        loop.call_soon(self._pass, PASSES, given)

    def _pass(self, passes: int, given: float) -> None:
        """Wait until the turn is over, then plan the next one."""
        loop = asyncio.get_running_loop()
        if passes:
            loop.call_soon(self._pass, passes - 1, given)
            return
        self._due = loop.time() + max(INTERVAL_SECONDS, PAUSE_RATIO * (loop.time() - given))
        self._plan()

"""Turns of requests without the token: one at a time, so that those with the token do not wait behind them."""

from __future__ import annotations

import asyncio

INTERVAL_SECONDS = 0.001
"""Least time between the end of a stranger's turn and the next one, s."""
REST = 1.0
"""Time between two turns over the time that a turn takes, where that is more: half of the event loop is for others."""
PASSES = 2
"""Passes of the event loop in which the request whose turn it is is answered."""


class Turns:
    """Gives turns to connections that wait for one, the first first.

    The event loop is free for others between two turns, however many connections wait.

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
        """Return how many connections wait."""
        return len(self._waiting)

    async def wait(self, connection: object) -> bool:
        """Wait for the turn of a connection; return whether it came before the connection left."""
        turn: asyncio.Future[bool] = asyncio.get_running_loop().create_future()
        self._waiting[connection] = turn
        if not self._is_planned:
            self._plan()
        return await turn

    def leave(self, connection: object) -> None:
        """End the wait of a connection that is closed."""
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
        self._due = loop.time() + max(INTERVAL_SECONDS, REST * (loop.time() - given))
        self._plan()

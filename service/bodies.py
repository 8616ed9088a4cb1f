"""Bodies of requests in JSON, limited to few values, so that checking them costs no more than reading them."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Coroutine
from http import HTTPStatus
from typing import Any

from fastapi import Request, Response
from fastapi.routing import APIRoute
from starlette.exceptions import HTTPException

MOST_VALUES = 1000
"""Largest number of values in a body, with those in lists and objects; the largest requests have about 250."""
_TEXTS = re.compile(r'"(?:[^"\\]|\\.)*+"?+', re.DOTALL)
"""Texts in JSON, the last one perhaps unfinished; no character is matched twice."""


class BoundedRequest(Request):
    """A request whose body holds a limited number of values."""

    async def json(self) -> Any:
        """Return the body; raise HTTPException if it holds more values than any request needs."""
        if not hasattr(self, "_json"):
            text = (await self.body()).decode("utf-8-sig")
            if not is_small(text):
                raise HTTPException(
                    HTTPStatus.UNPROCESSABLE_ENTITY,
                    f"expected at most {MOST_VALUES} values in a body, got more.",
                )
            self._json = json.loads(text)
        return self._json


def is_small(text: str) -> bool:
    """Return whether a text of JSON holds at most `MOST_VALUES` values, by one pass over it.

    >>> is_small('{"scene": "[,,"}'), is_small("[" + "0," * 1000 + "0]")
    (True, False)
    """
    outside = _TEXTS.sub("", text)
    return sum(outside.count(sign) for sign in ",[{") <= MOST_VALUES


class BoundedRoute(APIRoute):
    """A route with bounded bodies: without the bound each unknown key would become a problem, in the event loop."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Return the handler that answers a request."""
        handler = super().get_route_handler()

        async def bounded(request: Request) -> Response:
            return await handler(BoundedRequest(request.scope, request.receive))

        return bounded

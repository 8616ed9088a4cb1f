"""Access to the service, and headers for browsers: the token, the size of requests, headers of answers."""

from __future__ import annotations

import hmac
import logging
import re
import time
from collections.abc import Awaitable, Callable, MutableMapping
from http import HTTPStatus
from pathlib import Path
from typing import Any

from vibroimpact.fmus.access_token import token_at
from vibroimpact.service.connections import KNOWN
from vibroimpact.service.hosts import Hosts
from vibroimpact.service.page_files import page_files
from vibroimpact.service.problems import answer
from vibroimpact.service.sessions import Sessions

HEALTH = "/healthz"
OPEN_PATHS = (HEALTH, *page_files())
"""Paths that are answered without a token."""
MOST_BYTES = 4 * 2**20
"""Largest size of a request, byte."""
MOST_UPLOADED = {"/api/v1/recordings": 256 * 2**20, "/api/v1/fmus": 64 * 2**20}
"""Largest size of a request that uploads a file, byte, by path."""
LOG = logging.getLogger("vibroimpact.service")
HEADERS = (
    (b"x-content-type-options", b"nosniff"),
    (b"x-frame-options", b"DENY"),
    (b"content-security-policy", b"default-src 'none'; frame-ancestors 'none'"),
    (b"referrer-policy", b"no-referrer"),
    (b"cache-control", b"no-store"),
)

_LENGTH = re.compile(rb"[0-9]{1,15}")
_JOB = re.compile(r"/campaigns/([0-9a-f]{32})")

Scope = MutableMapping[str, Any]
Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
Application = Callable[[Scope, Receive, Send], Awaitable[None]]


def token_of(folder: Path) -> str:
    """Return the token of a service: see `token_at`."""
    return token_at(folder / "token")


class Guarded:
    """An ASGI application that requires the token, limits the size of requests, and adds headers to all answers.

    A session of the page replaces the token; the hosts are the valid names of the service.
    """

    def __init__(self, app: Application, token: str, sessions: Sessions, hosts: Hosts) -> None:
        self._app, self._expected, self._sessions, self._hosts = app, token.encode(), sessions, hosts

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        began = time.monotonic()

        async def with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                _note(scope, message["status"], time.monotonic() - began, is_known)
                known = {name for name, _ in message["headers"]}
                extra = [(name, value) for name, value in HEADERS if name not in known]
                message["headers"] = [*message["headers"], *extra]
            await send(message)

        headers = dict(scope["headers"])
        is_known = self._is_known(headers, scope["method"])
        refused = self._refused(scope, headers, is_known)
        if connection := scope.get("extensions", {}).get(KNOWN):
            if is_known:
                connection["tell"]()
            elif not await connection["turn"](scope["path"] == HEALTH):
                return
        await (refused or self._app)(scope, receive, with_headers)

    def _refused(self, scope: Scope, headers: dict[bytes, bytes], is_known: bool) -> Application | None:
        """Return the refusal of a request by its head alone; None if it is accepted."""
        if why := self._hosts.why_not(headers.get(b"host"), (scope.get("server") or ("",))[0]):
            return answer(HTTPStatus.MISDIRECTED_REQUEST, why)
        if scope["path"] not in OPEN_PATHS and not is_known:
            return answer(
                HTTPStatus.UNAUTHORIZED,
                "Authorization: expected Bearer and the token of this service, which is in the file `token` of its "
                "folder.",
                {"WWW-Authenticate": "Bearer"},
            )
        length = headers.get(b"content-length", b"0")
        most = MOST_UPLOADED.get(scope["path"], MOST_BYTES) if scope["method"] == "POST" else MOST_BYTES
        if _LENGTH.fullmatch(length) and int(length) <= most and b"transfer-encoding" not in headers:
            return None
        got = "a body in chunks" if b"transfer-encoding" in headers else repr(length[:40].decode("latin-1"))
        return answer(
            HTTPStatus.REQUEST_ENTITY_TOO_LARGE,
            f"expected a request of at most {most} byte with its Content-Length, got {got}.",
        )

    def _is_known(self, headers: dict[bytes, bytes], method: str) -> bool:
        scheme, _, given = headers.get(b"authorization", b"").partition(b" ")
        has_token = hmac.compare_digest(given.strip(b" "), self._expected) and scheme.lower() == b"bearer"
        return has_token or self._sessions.are_in(headers, method)


def _note(scope: Scope, status: int, seconds: float, is_known: bool) -> None:
    """Log a request that changes something or is refused; mere reads are too many."""
    if scope["method"] in ("GET", "HEAD") and status < HTTPStatus.BAD_REQUEST:
        return
    job = _JOB.search(scope["path"])
    client = (scope.get("client") or ("",))[0]
    facts = {"method": scope["method"], "path": scope["path"][:200], "status": status, "client": client}
    level = logging.ERROR if status >= HTTPStatus.INTERNAL_SERVER_ERROR else logging.INFO
    facts |= {"job": job[1] if job else "", "seconds": round(seconds, 4)}
    LOG.log(level, "request", extra=facts | ({} if is_known else {"alike": f"request {status}"}))

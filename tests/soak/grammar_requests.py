"""Requests to the application of a service, in this process: drawn heads, queries and bodies are answered or refused.

No answer is an error of the service, each refusal is a short problem detail, and no drawn head opens anything. The
network around it has kinds of its own: `service_requests` and `service_strangers`.
"""

from __future__ import annotations

import asyncio
import functools
import json
import os
import random
from http import HTTPStatus
from pathlib import Path
from typing import Any
from urllib.parse import quote

from soak import _drawn_files as files
from soak.grammar_toml import Spelling, drawn_tables
from soak.scenes import LINES
from vibroimpact.service.api import application
from vibroimpact.service.fmus import FmuStore
from vibroimpact.service.hosts import Hosts
from vibroimpact.service.recordings import RecordingStore
from vibroimpact.service.routes.described import PREFIX
from vibroimpact.service.scenes import Shelf
from vibroimpact.service.security import OPEN_PATHS, Guarded
from vibroimpact.service.sessions import Sessions
from vibroimpact.service.store import Store
from vibroimpact.service.supervisor import Supervisor

CASES, SAMPLE, SECONDS = files.CASES, files.SAMPLE, files.SECONDS

TOKEN = "a-token-of-this-kind"
BODY = {"mass": 1.0, "stiffness": 1.0}
SCENE = "[body]\nmass = 1\nstiffness = 1\n[record]\nrecorded_time = 0.1\n"
LONGEST_ANSWER = 2_000_000
ANSWER_SECONDS = 20.0
PATHS = (
    *("/", "/healthz", "/metrics", f"{PREFIX}/openapi.json", f"{PREFIX}/campaigns", f"{PREFIX}/recordings"),
    *(f"{PREFIX}/fmus", f"{PREFIX}/examples", f"{PREFIX}/scenes/validate", f"{PREFIX}/session"),
    *(
        f"{PREFIX}/campaigns/ID",
        f"{PREFIX}/campaigns/ID/scene",
        f"{PREFIX}/campaigns/ID/log",
        f"{PREFIX}/campaigns/ID/events",
    ),
    *(f"{PREFIX}/campaigns/ID/dataset", f"{PREFIX}/campaigns/ID/slice", f"{PREFIX}/campaigns/ID/cancel"),
    *(
        f"{PREFIX}/recordings/ID",
        f"{PREFIX}/recordings/ID/figure",
        f"{PREFIX}/recordings/ID/file",
        f"{PREFIX}/fmus/ID",
    ),
)
QUERY = (
    "limit",
    "after",
    "before",
    "at",
    "within",
    "variable",
    "name",
    "settings",
    "wait",
    "state",
    "most",
    "since",
    "format",
)
HEADERS = (
    "range",
    "if-none-match",
    "if-modified-since",
    "accept",
    "cookie",
    "origin",
    "sec-fetch-site",
    "content-type",
    "idempotency-key",
    "last-event-id",
    "x-forwarded-for",
    "if-range",
    "authorization",
    "host",
    "content-length",
    "transfer-encoding",
)
RANGES = (
    "bytes=0-1",
    "bytes=-1",
    "bytes=5-2",
    "bytes=0-",
    "bytes=" + "0-1," * 400,
    "bytes=-",
    "words=0-1",
    "bytes=99999999999999999999-",
)
TEXTS = (
    *files.WORDS,
    "body.mass:1",
    "body.mass:1:2",
    "a:nan:inf",
    "1",
    "-1",
    "0",
    "50",
    "9" * 30,
    "true",
    "%00",
    "..%2f..",
    "*",
    "127.0.0.1:80",
    "evil.example",
    "[::1]",
    "localhost",
    "same-origin",
    "cross-site",
    "Bearer",
    f"Bearer {TOKEN}",
    "Bearer x",
    "bearer",
)


def _home() -> Path:
    """Return a folder that outlives a case, if there is one."""
    return Path(os.environ.get("VIBROIMPACT_CACHE", "."))


@functools.cache
def service() -> tuple[Guarded, Sessions, Store]:
    """Return an application without workers, its sessions, and its store."""
    folder = _home().absolute() / f"service-{os.getpid()}"
    folder.mkdir(parents=True)
    store, sessions = Store(folder), Sessions(TOKEN)
    shelf = Shelf(RecordingStore(store), FmuStore(folder / "fmus", False))
    app = application(store, Supervisor(store), shelf, sessions)
    return Guarded(app, TOKEN, sessions, Hosts("127.0.0.1")), sessions, store


def drawn_json(draw: random.Random, depth: int = 3) -> Any:
    """Return any JSON."""
    match draw.randrange(7 if depth else 5):
        case 0:
            return draw.choice(TEXTS)
        case 1:
            return draw.choice(files.NUMBERS)
        case 2:
            return draw.choice((None, True, False, 0.5))
        case 3 | 4:
            return draw.choice((SCENE, *LINES))
        case 5:
            return [drawn_json(draw, depth - 1) for _ in range(draw.randrange(5))]
        case _:
            keys = ("scene", "recordings", "title", "name", "changes", "token", "settings", "x" * 400)
            return {key: drawn_json(draw, depth - 1) for key in draw.sample(keys, draw.randint(1, 5))}


def _body(draw: random.Random) -> bytes:
    match draw.randrange(6):
        case 0:
            return b""
        case 1:
            return draw.choice(
                (
                    b"[" * 9000,
                    b'{"scene": "',
                    b"\xff\xfe",
                    b"nan",
                    b"1e999",
                    b"{}",
                    b"[]",
                    b'"' * 99,
                    b"0" * 9000,
                )
            )
        case 2:
            return json.dumps({"scene": Spelling(draw).text(drawn_tables(draw))}).encode()
        case 3:
            return json.dumps({"scene": draw.choice((SCENE, SCENE + draw.choice(LINES)))}).encode(
                "utf-8", "surrogatepass"
            )
        case _:
            return json.dumps(drawn_json(draw)).encode("utf-8", "surrogatepass")


def _heads(draw: random.Random, body: bytes, sessions: Sessions) -> list[tuple[bytes, bytes]]:
    given = {"host": "127.0.0.1:8737", "content-length": str(len(body)), "content-type": "application/json"}
    way = draw.random()
    if way < 0.7:
        given["authorization"] = f"Bearer {TOKEN}"
    elif way < 0.85:
        given["cookie"] = f"{sessions.cookie}={sessions.made()}"
    for name in draw.sample(HEADERS[:12] if draw.random() < 0.7 else HEADERS, draw.randrange(4)):
        given[name] = draw.choice(RANGES) if name in ("range", "if-range") else draw.choice(TEXTS)
    return [(name.encode(), value.encode("utf-8", "surrogatepass")) for name, value in given.items()]


async def _answered(
    app: Guarded, scope: dict[str, Any], body: bytes
) -> tuple[int, dict[bytes, bytes], bytes]:
    """Return status, headers and content of an answer."""
    waiting = [{"type": "http.request", "body": body, "more_body": False}]
    status, headers, content = 0, dict[bytes, bytes](), bytearray()

    async def receive() -> dict[str, Any]:
        return waiting.pop() if waiting else {"type": "http.disconnect"}

    async def send(message: Any) -> None:
        nonlocal status
        if message["type"] == "http.response.start":
            status = message["status"]
            headers.update(dict(message["headers"]))
        else:
            content.extend(message.get("body", b""))

    await asyncio.wait_for(app(scope, receive, send), ANSWER_SECONDS)
    return status, headers, bytes(content)


def check(seed: int) -> str | None:
    """Send one request."""
    draw = random.Random(seed)
    app, sessions, _ = service()
    path = draw.choice(PATHS).replace("ID", draw.choice(("0" * 32, *TEXTS)))
    query = "&".join(
        f"{draw.choice(QUERY)}={quote(draw.choice(TEXTS), errors='replace')}"
        for _ in range(draw.choice((0, 1, 1, 4)))
    )
    method = draw.choice(("GET", "GET", "POST", "DELETE", "HEAD", "PUT", "OPTIONS"))
    body = _body(draw) if method == "POST" else b""
    heads = _heads(draw, body, sessions)
    scope = {
        "type": "http",
        "asgi": {"version": "3.0"},
        "http_version": "1.1",
        "method": method,
        "scheme": "http",
        "path": path,
        "raw_path": quote(path, errors="replace").encode(),
        "query_string": query.encode(),
        "headers": heads,
        "server": ("127.0.0.1", 8737),
        "client": ("127.0.0.1", 5000),
        "root_path": "",
        "extensions": {},
    }
    with files.bounded_memory() as grown:
        status, headers, content = asyncio.run(_answered(app, scope, body))
    problem = _wrong(status, headers, content, method) or _opened(status, path, dict(heads))
    return (problem and f"{method} {path[:80]}?{query[:80]}: {problem}") or grown()


def _wrong(status: int, headers: dict[bytes, bytes], content: bytes, method: str) -> str | None:
    """Return the problem of an answer; None without one."""
    if not 200 <= status < 600 or (status >= 500 and status != HTTPStatus.SERVICE_UNAVAILABLE):
        return f"status {status}: {content[:300]!r}"
    if len(content) > LONGEST_ANSWER:
        return f"an answer of {len(content)} bytes"
    if status < 400 or method == "HEAD":
        return None
    if headers.get(b"content-type") != b"application/problem+json":
        return f"status {status} as {headers.get(b'content-type')!r}: {content[:200]!r}"
    detail = json.loads(content)
    return None if detail.get("status") == status and detail.get("detail") else f"problem {content[:200]!r}"


def _opened(status: int, path: str, heads: dict[bytes, bytes]) -> str | None:
    """Return a problem if a request without token and session was let in."""
    token = heads.get(b"authorization", b"").strip().lower() == f"bearer {TOKEN}".encode()
    if token or b"cookie" in heads or path in OPEN_PATHS:
        return None
    return f"status {status} without the token" if status < 400 else None

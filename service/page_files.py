"""The static files of the page: open to everybody, since there is nothing in them but the page."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from functools import cache
from importlib.resources import files
from pathlib import Path

from fastapi import FastAPI
from starlette.responses import Response

TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}
INDEX = "index.html"
POLICY = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        "img-src 'self'",
        "connect-src 'self'",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
    )
)
"""What the page may load: its own files alone, and nothing that is written into it."""


@cache
def page_files() -> dict[str, Path]:
    """Return the files of the page by the path that they are served at."""
    folder = Path(str(files("vibroimpact.service"))) / "page"
    found = {f"/page/{path.name}": path for path in sorted(folder.iterdir()) if path.suffix in TYPES}
    return {"/": folder / INDEX, **found}


def serve_page(app: FastAPI) -> None:
    """Add the files of the page to an application; they are no part of the API that it describes."""
    for address, path in page_files().items():
        app.add_api_route(address, _sender(path), methods=["GET"], include_in_schema=False)


def _sender(path: Path) -> Callable[[], Awaitable[Response]]:
    async def send() -> Response:  # without a thread: strangers would hold all of them
        # a checkout is edited while it is served
        headers = {"Content-Security-Policy": POLICY, "Cache-Control": "no-cache"}
        return Response(path.read_bytes(), media_type=TYPES[path.suffix], headers=headers)

    return send

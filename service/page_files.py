"""The static files of the page: open to everybody, since they hold no data."""

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
"""Content-Security-Policy: the page may load its own files alone, and no inline scripts or styles."""


@cache
def page_files() -> dict[str, Path]:
    """Return the files of the page by the path at which they are served."""
    folder = Path(str(files("vibroimpact.service"))) / "page"
    found = {f"/page/{path.name}": path for path in sorted(folder.iterdir()) if path.suffix in TYPES}
    return {"/": folder / INDEX, **found}


def serve_page(app: FastAPI) -> None:
    """Add the files of the page to an application, outside of its described API."""
    for address, path in page_files().items():
        app.add_api_route(address, _sender(path), methods=["GET"], include_in_schema=False)


def _sender(path: Path) -> Callable[[], Awaitable[Response]]:
    async def send() -> Response:  # needs no thread: unauthenticated clients could hold all of them
        # a checkout may be edited while it is served
        headers = {"Content-Security-Policy": POLICY, "Cache-Control": "no-cache"}
        return Response(path.read_bytes(), media_type=TYPES[path.suffix], headers=headers)

    return send

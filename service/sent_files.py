"""Files as answers, whole or a range; an invalid range is refused in the usual form."""

from __future__ import annotations

from http import HTTPStatus

from fastapi.responses import FileResponse
from starlette.types import Message, Receive, Scope, Send

from vibroimpact.service.problems import answer

_RULES = {
    HTTPStatus.BAD_REQUEST: "Range: expected bytes=FIRST-LAST, got another form.",
    HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE: "Range: expected a range within the file, got one beyond its end.",
}


class SentFile(FileResponse):
    """A file; the refusals 400 and 416 of a range are problem details."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send the file, or the refusal of the requested range."""
        refused: Message | None = None

        async def watched(message: Message) -> None:
            nonlocal refused
            if message["type"] == "http.response.start" and message["status"] in _RULES:
                refused = message
            if refused is None:
                await send(message)

        await super().__call__(scope, receive, watched)
        if refused is not None:
            status = HTTPStatus(refused["status"])
            length = {
                name.decode(): value.decode()
                for name, value in refused["headers"]
                if name == b"content-range"
            }
            await answer(status, _RULES[status], length)(scope, receive, send)

"""What happens to a job, told while it happens: server-sent events."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from http import HTTPStatus
from typing import Annotated

from fastapi import APIRouter, Header, Request
from fastapi.responses import StreamingResponse

from vibroimpact.service.routes.described import known_job, problems
from vibroimpact.service.store import ENDED, Event, Store

LOOKS = 0.2
"""Seconds between two looks for new events."""
HEARTBEAT = 15.0
"""Seconds of silence after which a stream of events says that it is alive."""


def events_router(store: Store) -> APIRouter:
    """Return the route of the events of a job."""
    router = APIRouter(tags=["campaigns"])

    @router.get(
        "/campaigns/{name}/events",
        response_class=StreamingResponse,
        responses={
            200: {"content": {"text/event-stream": {}}},
            **problems(HTTPStatus.NOT_FOUND, HTTPStatus.UNPROCESSABLE_ENTITY),
        },
        summary="Follow a campaign: server-sent events, until it has ended",
    )
    async def events(
        name: str,
        request: Request,
        last_event_id: Annotated[int | None, Header(alias="Last-Event-ID", ge=0, le=2**62)] = None,
    ) -> StreamingResponse:
        known_job(store, name)
        lines = _stream(store, name, last_event_id or 0, request)
        return StreamingResponse(lines, media_type="text/event-stream")

    return router


async def _stream(store: Store, name: str, last: int, request: Request) -> AsyncIterator[str]:
    """Yield the events of a job after one of them, those to come as well, until it has ended."""
    silent = 0.0
    while not await request.is_disconnected():
        try:
            found, ended = await asyncio.to_thread(_news, store, name, last)
        except KeyError:
            return  # it was deleted
        for event in found:
            last, silent = event.id, 0.0
            yield _event_lines(event)
        if ended and not found:
            return
        if not found:
            await asyncio.sleep(LOOKS)
            silent += LOOKS
            if silent >= HEARTBEAT:
                silent = 0.0
                yield ": alive\n\n"


def _news(store: Store, name: str, last: int) -> tuple[list[Event], bool]:
    """Return the events after one of them, and whether the job had ended before they were read: then they are all."""
    ended = store.job(name).state in ENDED
    return store.events(name, after=last), ended


def _event_lines(event: Event) -> str:
    data = json.dumps(event.data | {"at": event.at})
    return f"id: {event.id}\nevent: {event.kind}\ndata: {data}\n\n"

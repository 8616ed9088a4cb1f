"""Events of a job as they happen: server-sent events."""

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
"""Interval between two checks for new events, s."""
HEARTBEAT = 15.0
"""Silence after which a stream of events sends a sign of life, s."""


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
    """Yield the events of a job after a given one, including future ones, until the job has ended."""
    silent = 0.0
    while not await request.is_disconnected():
        try:
            found, ended = await asyncio.to_thread(_news, store, name, last)
        except KeyError:
            return  # the job was deleted
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
    """Return the events after a given one, and whether the job had ended before the read: then none will follow."""
    ended = store.job(name).state in ENDED
    return store.events(name, after=last), ended


def _event_lines(event: Event) -> str:
    data = json.dumps(event.data | {"at": event.at})
    return f"id: {event.id}\nevent: {event.kind}\ndata: {data}\n\n"

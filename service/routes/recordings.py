"""Recordings: uploaded, listed, drawn, deleted."""

from __future__ import annotations

import asyncio
import hashlib
import json
from http import HTTPStatus
from pathlib import Path
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query, Request, Response
from pydantic import BaseModel

from vibroimpact.fmus.errors import UsageError
from vibroimpact.service.drawing import DRAWN, MEDIA, drawn
from vibroimpact.service.problems import ProblemError
from vibroimpact.service.recordings import NAME, RecordingStore, StoredRecording, stored_name
from vibroimpact.service.routes.described import MOST_PAGE, PREFIX, problems
from vibroimpact.service.routes.uploads import Upload, Uploads
from vibroimpact.service.sent_files import SentFile

MOST_SETTINGS = 4000
"""Largest number of characters of import settings."""


class ChannelAnswer(BaseModel):
    """A channel of a recording, with its samples; or a train of events, with their number."""

    name: str
    units: str
    samples: int | None = None
    events: int | None = None


class RecordingAnswer(BaseModel):
    """A recording of the service."""

    id: str
    name: str
    bytes: int
    channels: list[ChannelAnswer]
    created: float


class RecordingPage(BaseModel):
    """Recordings, the newest first, and the start of the next page."""

    items: list[RecordingAnswer]
    next: int | None


def known_recording(recordings: RecordingStore, name: str) -> StoredRecording:
    """Return a recording by its id or its name; answer 404 for an unknown one."""
    try:
        return recordings.find(name)
    except KeyError:
        raise ProblemError(
            HTTPStatus.NOT_FOUND, f"{name}: expected the name or the id of a recording, got an unknown one."
        ) from None


def file_of(recordings: RecordingStore, recording: StoredRecording) -> Path:
    """Return the file of a recording; answer 409 if it has gone."""
    try:
        return recordings.file(recording)
    except UsageError as error:
        raise ProblemError(HTTPStatus.CONFLICT, str(error)) from None


def recordings_router(recordings: RecordingStore, uploads: Uploads) -> APIRouter:
    """Return the routes of recordings."""
    router = APIRouter(tags=["recordings"])
    absent = problems(HTTPStatus.NOT_FOUND, HTTPStatus.CONFLICT, HTTPStatus.UNPROCESSABLE_ENTITY)

    @router.post(
        "/recordings",
        status_code=HTTPStatus.CREATED,
        responses=problems(
            HTTPStatus.REQUEST_TIMEOUT, HTTPStatus.UNPROCESSABLE_ENTITY, HTTPStatus.INSUFFICIENT_STORAGE
        ),
        openapi_extra={
            "requestBody": {
                "required": True,
                "content": {"application/octet-stream": {"schema": {"type": "string"}}},
            }
        },
        summary="Upload a recording",
    )
    async def upload(
        request: Request,
        response: Response,
        name: Annotated[
            str, Query(pattern=NAME, description="Name of the file; its extension helps to find its format.")
        ],
        settings: Annotated[
            str,
            Query(
                max_length=MOST_SETTINGS, description="Settings of the import as JSON: name, unit, rate, ..."
            ),
        ] = "{}",
    ) -> RecordingAnswer:
        """Accept a file of a measuring system, import it as `vibroimpact import` does, and keep the recording.

        The same file with the same name again gives the same recording.
        """
        checked = _settings(settings)
        try:
            stored_name(name)
            await asyncio.to_thread(recordings.refuse_more)
            async with uploads.received(request, name) as given, uploads.turn:
                found = await asyncio.to_thread(_added, recordings, given, checked)
        except UsageError as error:
            raise ProblemError(HTTPStatus.UNPROCESSABLE_ENTITY, str(error)) from None
        response.headers["Location"] = f"{PREFIX}/recordings/{found.id}"
        return _answer(found)

    @router.get("/recordings", responses=absent, summary="List, the newest first")
    def listed(
        limit: Annotated[int, Query(ge=1, le=MOST_PAGE)] = 50,
        cursor: Annotated[int | None, Query(ge=0, le=2**62, description="`next` of the page before")] = None,
    ) -> RecordingPage:
        found = recordings.page(before=cursor, most=limit + 1)
        more = found[limit - 1].number if len(found) > limit else None
        return RecordingPage(items=[_answer(one) for one in found[:limit]], next=more)

    @router.get("/recordings/{name}", responses=absent)
    def one(name: str) -> RecordingAnswer:
        """Return a description of a recording, by its id or its name."""
        return _answer(known_recording(recordings, name))

    @router.get(
        "/recordings/{name}/file",
        response_class=SentFile,
        responses={
            200: {"content": {"application/x-netcdf": {}}},
            206: {"description": "Partial Content", "content": {"application/x-netcdf": {}}},
            **problems(HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE),
            **absent,
        },
    )
    def file(name: str) -> SentFile:
        """Return a recording as NetCDF, whole or a range of it."""
        found = known_recording(recordings, name)
        path = file_of(recordings, found)
        return SentFile(path, media_type="application/x-netcdf", filename=found.name)

    @router.get("/recordings/{name}/figure", response_class=Response, responses={200: DRAWN, **absent})
    def figure(
        name: str, file_format: Annotated[Literal["png", "svg"], Query(alias="format")] = "png"
    ) -> Response:
        """Draw the channels of a recording."""
        path = file_of(recordings, known_recording(recordings, name))
        return Response(drawn(path, file_format), media_type=MEDIA[file_format])

    @router.delete("/recordings/{name}", status_code=HTTPStatus.NO_CONTENT, responses=absent)
    def delete(name: str) -> None:
        """Delete a recording; jobs that were submitted with it keep its data."""
        recordings.delete(known_recording(recordings, name))

    return router


def _answer(recording: StoredRecording) -> RecordingAnswer:
    return RecordingAnswer.model_validate(recording, from_attributes=True)


def _settings(text: str) -> str:
    """Return import settings in the form that is compared and passed on."""
    try:
        given: Any = json.loads(text)
    except (ValueError, RecursionError):
        given = None
    if not isinstance(given, dict):
        raise ProblemError(
            HTTPStatus.UNPROCESSABLE_ENTITY, "settings: expected a JSON object, got something else."
        )
    return json.dumps(given, sort_keys=True)


def _added(recordings: RecordingStore, given: Upload, settings: str) -> StoredRecording:
    source = hashlib.sha256(f"{given.sha256} {settings}".encode()).hexdigest()
    return recordings.add(given.file, source, settings)

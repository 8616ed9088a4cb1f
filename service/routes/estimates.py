"""Estimates from a recording, or from the results of a campaign: jobs like any other."""

from __future__ import annotations

from http import HTTPStatus
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, Response
from pydantic import BaseModel, ConfigDict, Field

from vibroimpact.service.bodies import BoundedRoute
from vibroimpact.service.problems import ProblemError
from vibroimpact.service.recordings import RecordingStore
from vibroimpact.service.requests import Estimate
from vibroimpact.service.routes.accepting import IdempotencyKey, accepted
from vibroimpact.service.routes.described import JobAnswer, problems
from vibroimpact.service.routes.recordings import file_of, known_recording
from vibroimpact.service.routes.results import dataset_of
from vibroimpact.service.store import Kind, NewJob, Store

Reference = Annotated[str | None, Field(min_length=1, max_length=200)]


class EstimateRequest(BaseModel):
    """An estimate and its data: either a recording or a job."""

    model_config = ConfigDict(extra="forbid")

    recording: Annotated[Reference, Field(description="Name or id of a recording.")] = None
    campaign: Annotated[Reference, Field(description="Id of a finished job.")] = None
    estimate: Estimate


def estimates_router(store: Store, recordings: RecordingStore) -> APIRouter:
    """Return the route that accepts an estimate."""
    router = APIRouter(tags=["estimates"], route_class=BoundedRoute)

    @router.post(
        "/estimates",
        status_code=HTTPStatus.ACCEPTED,
        responses=problems(
            HTTPStatus.NOT_FOUND,
            HTTPStatus.CONFLICT,
            HTTPStatus.UNPROCESSABLE_ENTITY,
            HTTPStatus.TOO_MANY_REQUESTS,
        ),
        summary="Estimate from a signal",
    )
    def estimate(
        given: EstimateRequest, response: Response, idempotency_key: IdempotencyKey = None
    ) -> JobAnswer:
        """Accept an estimate, as `vibroimpact estimate` or `spikes` makes it: a job, with dataset, figure and log."""
        name, file = _data_of(given, store, recordings)
        estimate = given.estimate.model_dump(mode="json")
        options = {"data": name, "asked": estimate}
        title = f"{estimate['kind']} of {name}"
        new_job = NewJob(Kind.estimate, title, files={name: file}, options=options)
        return accepted(store, new_job, given, response, idempotency_key)

    return router


def _data_of(given: EstimateRequest, store: Store, recordings: RecordingStore) -> tuple[str, Path]:
    """Return the data of an estimate: their name in the folder of the job, and their file."""
    if given.recording is not None and given.campaign is None:
        recording = known_recording(recordings, given.recording)
        return recording.name, file_of(recordings, recording)
    if given.campaign is not None and given.recording is None:
        job, path = dataset_of(store, given.campaign)
        return f"{job.id}.nc", path
    raise ProblemError(
        HTTPStatus.UNPROCESSABLE_ENTITY, "expected a recording or a campaign, got both or none. Name one."
    )

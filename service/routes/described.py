"""What all routes say alike: a job, a problem, and how a refusal is described."""

from __future__ import annotations

from http import HTTPStatus
from typing import Any

from pydantic import BaseModel

from vibroimpact.service.problems import MEDIA_TYPE, ProblemError
from vibroimpact.service.store import Job, Kind, State, Store

PREFIX = "/api/v1"
"""Of the paths of all routes but those that are no part of the API."""
MOST_PAGE = 200
"""Items on one page of a list."""


class JobAnswer(BaseModel):
    """A job: a campaign, one run, replays of recordings, or an estimate."""

    id: str
    title: str
    state: State
    kind: Kind
    workers: int | None
    created: float
    started: float | None
    ended: float | None
    total: int
    done: int
    attempts: int
    message: str
    options: dict[str, Any]
    outcomes: dict[str, int]


class ProblemAnswer(BaseModel):
    """RFC 9457."""

    type: str
    title: str
    status: int
    detail: str


def problems(*statuses: HTTPStatus) -> dict[int | str, dict[str, Any]]:
    """Return how a route is described to refuse."""
    content = {MEDIA_TYPE: {"schema": ProblemAnswer.model_json_schema()}}
    always = (
        *(HTTPStatus.BAD_REQUEST, HTTPStatus.UNAUTHORIZED, HTTPStatus.REQUEST_ENTITY_TOO_LARGE),
        HTTPStatus.SERVICE_UNAVAILABLE,
    )
    return {int(one): {"description": one.phrase, "content": content} for one in (*always, *statuses)}


def job_answer(job: Job) -> JobAnswer:
    """Return a job as it is told."""
    return JobAnswer(**{name: getattr(job, name) for name in JobAnswer.model_fields})


def known_job(store: Store, name: str) -> Job:
    """Return a job; 404 where there is none of this id."""
    try:
        return store.job(name)
    except KeyError:
        raise ProblemError(
            HTTPStatus.NOT_FOUND, f"{name}: expected the id of a campaign, got an unknown one."
        ) from None

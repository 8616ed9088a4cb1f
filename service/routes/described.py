"""Common parts of all routes: a job, a problem, and the description of a refusal."""

from __future__ import annotations

from http import HTTPStatus
from typing import Any

from pydantic import BaseModel

from vibroimpact.service.problems import MEDIA_TYPE, ProblemError
from vibroimpact.service.store import Job, Kind, State, Store

PREFIX = "/api/v1"
"""Prefix of all paths of the API."""
MOST_PAGE = 200
"""Largest number of items on one page of a list."""


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
    """Problem details of RFC 9457."""

    type: str
    title: str
    status: int
    detail: str


def problems(*statuses: HTTPStatus) -> dict[int | str, dict[str, Any]]:
    """Return the OpenAPI description of a route's refusals."""
    content = {MEDIA_TYPE: {"schema": ProblemAnswer.model_json_schema()}}
    always = (
        *(HTTPStatus.BAD_REQUEST, HTTPStatus.UNAUTHORIZED, HTTPStatus.REQUEST_ENTITY_TOO_LARGE),
        HTTPStatus.SERVICE_UNAVAILABLE,
    )
    return {int(one): {"description": one.phrase, "content": content} for one in (*always, *statuses)}


def job_answer(job: Job) -> JobAnswer:
    """Return a job as clients see it."""
    return JobAnswer(**{name: getattr(job, name) for name in JobAnswer.model_fields})


def known_job(store: Store, name: str) -> Job:
    """Return a job; answer 404 for an unknown id."""
    try:
        return store.job(name)
    except KeyError:
        raise ProblemError(
            HTTPStatus.NOT_FOUND, f"{name}: expected the id of a campaign, got an unknown one."
        ) from None

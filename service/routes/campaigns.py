"""Jobs: submitted, listed, cancelled, resumed, deleted."""

from __future__ import annotations

from http import HTTPStatus
from typing import Annotated, Any

from fastapi import APIRouter, Query, Response
from pydantic import BaseModel, ConfigDict, Field

from vibroimpact.fmus.errors import SceneError
from vibroimpact.service.bodies import BoundedRoute
from vibroimpact.service.problems import ProblemError
from vibroimpact.service.routes.accepting import IdempotencyKey, accepted
from vibroimpact.service.routes.described import (
    MOST_PAGE,
    JobAnswer,
    job_answer,
    known_job,
    problems,
)
from vibroimpact.service.routes.scenes import refused_scene
from vibroimpact.service.scenes import SOURCE, Shelf, Taken, linked, taken_scene, title_of
from vibroimpact.service.store import ENDED, Kind, NewJob, State, Store
from vibroimpact.service.supervisor import Supervisor

MOST_WORKERS = 256
"""Largest number of processes for one campaign."""
Reference = Annotated[str, Field(min_length=1, max_length=200)]


class Submission(BaseModel):
    """A scene to run."""

    model_config = ConfigDict(extra="forbid")

    scene: Annotated[str, Field(min_length=1, max_length=2**20, description="The scene file, TOML.")]
    workers: Annotated[int | None, Field(ge=1, le=MOST_WORKERS, description="Worker processes.")] = None
    recordings: Annotated[
        list[Reference],
        Field(max_length=100, description="Names or ids, for a scene with [replay] that names none."),
    ] = []
    fit: Annotated[
        str | None,
        Field(min_length=1, max_length=2000, description="Numbers of a replay to fit, by key, with commas."),
    ] = None
    score: Annotated[
        list[Reference], Field(max_length=100, description="Recordings to score without fitting.")
    ] = []


class JobPage(BaseModel):
    """Jobs, the newest first, and the start of the next page."""

    items: list[JobAnswer]
    next: int | None


def campaigns_router(store: Store, supervisor: Supervisor, shelf: Shelf) -> APIRouter:
    """Return the routes of jobs: submitted, listed, cancelled, resumed, deleted."""
    router = APIRouter(tags=["campaigns"], route_class=BoundedRoute)

    @router.post(
        "/campaigns",
        status_code=HTTPStatus.ACCEPTED,
        responses=problems(HTTPStatus.UNPROCESSABLE_ENTITY, HTTPStatus.TOO_MANY_REQUESTS),
        summary="Submit a scene",
    )
    def submit(given: Submission, response: Response, idempotency_key: IdempotencyKey = None) -> JobAnswer:
        """Accept a scene, to run after those before it. The same `Idempotency-Key` again gives the same job."""
        try:
            taken = taken_scene(given.scene, shelf, given.recordings)
            new_job = _new_job(given, taken, shelf)
        except SceneError as error:
            raise refused_scene(error, given.scene) from None
        return accepted(store, new_job, given, response, idempotency_key)

    @router.get(
        "/campaigns", responses=problems(HTTPStatus.UNPROCESSABLE_ENTITY), summary="List, the newest first"
    )
    def campaigns(
        limit: Annotated[int, Query(ge=1, le=MOST_PAGE)] = 50,
        cursor: Annotated[int | None, Query(ge=0, le=2**62, description="`next` of the page before")] = None,
    ) -> JobPage:
        found = store.jobs(before=cursor, most=limit + 1)
        more = found[limit - 1].number if len(found) > limit else None
        return JobPage(items=[job_answer(job) for job in found[:limit]], next=more)

    @router.get(
        "/campaigns/{name}", responses=problems(HTTPStatus.NOT_FOUND, HTTPStatus.UNPROCESSABLE_ENTITY)
    )
    def status(name: str) -> JobAnswer:
        """Return the state of a campaign."""
        return job_answer(known_job(store, name))

    @router.post(
        "/campaigns/{name}/cancel",
        status_code=HTTPStatus.ACCEPTED,
        responses=problems(HTTPStatus.NOT_FOUND, HTTPStatus.CONFLICT, HTTPStatus.UNPROCESSABLE_ENTITY),
    )
    def cancel(name: str) -> JobAnswer:
        """Cancel a waiting or running campaign; its results so far stay, and it can be resumed."""
        job = known_job(store, name)
        if not supervisor.cancel(name) and known_job(store, name).state in ENDED:
            raise ProblemError(
                HTTPStatus.CONFLICT,
                f"{name}: expected a campaign that waits or runs, got one that is {job.state}.",
            )
        return job_answer(known_job(store, name))

    @router.post(
        "/campaigns/{name}/resume",
        status_code=HTTPStatus.ACCEPTED,
        responses=problems(HTTPStatus.NOT_FOUND, HTTPStatus.CONFLICT, HTTPStatus.UNPROCESSABLE_ENTITY),
    )
    def resume(name: str) -> JobAnswer:
        """Resume a cancelled or failed campaign from its results so far."""
        job = known_job(store, name)
        again = {"state": State.queued, "message": "", "ended": None, "attempts": 0}
        if not store.change(name, only_from=[State.cancelled, State.failed], **again):
            raise ProblemError(
                HTTPStatus.CONFLICT,
                f"{name}: expected a campaign that was cancelled or has failed, got one that is {job.state}.",
            )
        return job_answer(known_job(store, name))

    @router.delete(
        "/campaigns/{name}",
        status_code=HTTPStatus.NO_CONTENT,
        responses=problems(HTTPStatus.NOT_FOUND, HTTPStatus.CONFLICT, HTTPStatus.UNPROCESSABLE_ENTITY),
    )
    def delete(name: str) -> None:
        """Delete a campaign that has ended, with its folder."""
        job = known_job(store, name)
        if not store.delete(name):
            raise ProblemError(
                HTTPStatus.CONFLICT,
                f"{name}: expected a campaign that has ended, got one that is {job.state}. Cancel it first.",
            )
        store.remove_folder(name)

    return router


def _new_job(given: Submission, taken: Taken, shelf: Shelf) -> NewJob:
    """Return the job for a submission."""
    files, options = dict(taken.files), dict[str, Any]()
    if taken.kind == Kind.replay:
        options = {"fit": given.fit, "score": given.score}
        problems = [line for name in given.score for line in linked("score", name, shelf, files)]
    else:
        unused = {"fit": given.fit, "score": given.score}
        problems = [
            f"{SOURCE}: {name}: expected a scene with [replay] that sweeps nothing but recordings, got another."
            for name, value in unused.items()
            if value
        ]
    if given.score and given.fit is None:
        problems.append(f"{SOURCE}: score: expected fit beside it: a recording is scored that is not fitted.")
    if problems:
        raise SceneError(problems)
    title = title_of(given.scene)
    return NewJob(taken.kind, title, taken.text, given.workers, files=files, options=options)

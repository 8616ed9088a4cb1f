"""Jobs: submitted, listed, cancelled, resumed, deleted."""

from __future__ import annotations

import hashlib
import shutil
from http import HTTPStatus
from typing import Annotated

from fastapi import APIRouter, Header, Query, Response
from pydantic import BaseModel, ConfigDict, Field

from vibroimpact.fmus.errors import SceneError
from vibroimpact.service.problems import ProblemError
from vibroimpact.service.routes.described import (
    MOST_PAGE,
    PREFIX,
    JobAnswer,
    job_answer,
    known_job,
    problems,
)
from vibroimpact.service.routes.scenes import refused_scene
from vibroimpact.service.scenes import taken_scene, title_of
from vibroimpact.service.store import ENDED, KeyReusedError, State, Store
from vibroimpact.service.supervisor import Supervisor

MOST_QUEUED = 100
"""Jobs that wait, above which no more are accepted."""
RETRY_AFTER = 30
"""Seconds after which a client that was refused may ask again."""
MOST_WORKERS = 256
"""Processes that one campaign may ask for."""
Key = Annotated[str | None, Header(alias="Idempotency-Key", min_length=1, max_length=200)]


class Submission(BaseModel):
    """A scene to be run."""

    model_config = ConfigDict(extra="forbid")

    scene: Annotated[str, Field(min_length=1, max_length=2**20, description="The scene file, TOML.")]
    workers: Annotated[int | None, Field(ge=1, le=MOST_WORKERS, description="Worker processes.")] = None


class JobPage(BaseModel):
    """Jobs, the newest first, and where the next page begins."""

    items: list[JobAnswer]
    next: int | None


def campaigns_router(store: Store, supervisor: Supervisor) -> APIRouter:
    """Return the routes of jobs: submitted, listed, cancelled, resumed, deleted."""
    router = APIRouter(tags=["campaigns"])

    @router.post(
        "/campaigns",
        status_code=HTTPStatus.ACCEPTED,
        responses=problems(HTTPStatus.UNPROCESSABLE_ENTITY, HTTPStatus.TOO_MANY_REQUESTS),
        summary="Submit a scene",
    )
    def submit(given: Submission, response: Response, idempotency_key: Key = None) -> JobAnswer:
        """Accept a scene, which is run after those before it. The same `Idempotency-Key` again is the same job."""
        try:
            scene = taken_scene(given.scene)
        except SceneError as error:
            raise refused_scene(error, given.scene) from None
        if store.counts()[State.queued] >= MOST_QUEUED:
            raise ProblemError(
                HTTPStatus.TOO_MANY_REQUESTS,
                f"expected fewer than {MOST_QUEUED} campaigns that wait, got a full queue. Come back later.",
                {"Retry-After": str(RETRY_AFTER)},
            )
        digest = hashlib.sha256(given.model_dump_json().encode()).hexdigest()
        try:
            job, _ = store.submit(
                given.scene,
                title=title_of(given.scene),
                sweeps=bool(scene.sweep),
                workers=given.workers,
                key=idempotency_key or "",
                digest=digest,
            )
        except KeyReusedError:
            raise ProblemError(
                HTTPStatus.UNPROCESSABLE_ENTITY,
                "Idempotency-Key: expected a new key, got that of another request.",
            ) from None
        response.headers["Location"] = f"{PREFIX}/campaigns/{job.id}"
        return job_answer(job)

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
        """Say where a campaign is."""
        return job_answer(known_job(store, name))

    @router.post(
        "/campaigns/{name}/cancel",
        status_code=HTTPStatus.ACCEPTED,
        responses=problems(HTTPStatus.NOT_FOUND, HTTPStatus.CONFLICT, HTTPStatus.UNPROCESSABLE_ENTITY),
    )
    def cancel(name: str) -> JobAnswer:
        """End a campaign that waits or runs; what it has computed stays, and can be resumed."""
        job = known_job(store, name)
        if not supervisor.cancel(name) and store.job(name).state in ENDED:
            raise ProblemError(
                HTTPStatus.CONFLICT,
                f"{name}: expected a campaign that waits or runs, got one that is {job.state}.",
            )
        return job_answer(store.job(name))

    @router.post(
        "/campaigns/{name}/resume",
        status_code=HTTPStatus.ACCEPTED,
        responses=problems(HTTPStatus.NOT_FOUND, HTTPStatus.CONFLICT, HTTPStatus.UNPROCESSABLE_ENTITY),
    )
    def resume(name: str) -> JobAnswer:
        """Go on with a campaign that was cancelled or has failed, from what is there."""
        job = known_job(store, name)
        again = {"state": State.queued, "message": "", "ended": None, "attempts": 0}
        if not store.change(name, only_from=[State.cancelled, State.failed], **again):
            raise ProblemError(
                HTTPStatus.CONFLICT,
                f"{name}: expected a campaign that was cancelled or has failed, got one that is {job.state}.",
            )
        return job_answer(store.job(name))

    @router.delete(
        "/campaigns/{name}",
        status_code=HTTPStatus.NO_CONTENT,
        responses=problems(HTTPStatus.NOT_FOUND, HTTPStatus.CONFLICT, HTTPStatus.UNPROCESSABLE_ENTITY),
    )
    def delete(name: str) -> None:
        """Forget a campaign that has ended, with its folder."""
        job = known_job(store, name)
        if job.state not in ENDED:
            raise ProblemError(
                HTTPStatus.CONFLICT,
                f"{name}: expected a campaign that has ended, got one that is {job.state}. Cancel it first.",
            )
        store.delete(name)
        shutil.rmtree(store.folder_of(name))

    return router

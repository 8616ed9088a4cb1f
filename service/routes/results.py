"""Results of a job: its scene, its log, its dataset, and figures of it."""

from __future__ import annotations

from http import HTTPStatus
from pathlib import Path
from typing import Annotated, Literal

from fastapi import APIRouter, Query, Response
from fastapi.responses import PlainTextResponse

from vibroimpact.analysis.figures import KINDS
from vibroimpact.service.drawing import DRAWN, MEDIA, drawn
from vibroimpact.service.problems import ProblemError
from vibroimpact.service.routes.described import known_job, problems
from vibroimpact.service.sent_files import SentFile
from vibroimpact.service.store import LOG_FILE, Job, State, Store

MOST_LOG = 2**20
"""Length of the shown end of a log, byte."""


def dataset_of(store: Store, name: str) -> tuple[Job, Path]:
    """Return a finished job and its dataset; answer 409 if the job is not finished."""
    job = known_job(store, name)
    path = store.dataset_of(job)
    if job.state != State.done:
        raise ProblemError(
            HTTPStatus.CONFLICT, f"{name}: expected a campaign that is done, got one that is {job.state}."
        )
    if not path.is_file():
        raise ProblemError(
            HTTPStatus.CONFLICT, f"{name}: expected its dataset, got none: somebody has removed it."
        )
    return job, path


def results_router(store: Store) -> APIRouter:
    """Return the routes of a job's results."""
    router = APIRouter(tags=["results"])
    absent = problems(HTTPStatus.NOT_FOUND, HTTPStatus.CONFLICT, HTTPStatus.UNPROCESSABLE_ENTITY)

    @router.get("/campaigns/{name}/scene", response_class=PlainTextResponse, responses=absent)
    def scene(
        name: str,
        fitted: Annotated[bool, Query(description="Whether to return the fitted numbers.")] = False,
    ) -> Response:
        """Return the submitted scene, or the fitted one."""
        known_job(store, name)
        path = store.folder_of(name) / "fitted.toml" if fitted else store.scene_of(name)
        if not path.is_file():
            raise ProblemError(
                HTTPStatus.CONFLICT,
                f"{name}: expected a job with a {'fitted ' * fitted}scene, got one without.",
            )
        return Response(path.read_bytes(), media_type="text/plain; charset=utf-8")

    @router.get("/campaigns/{name}/log", response_class=PlainTextResponse, responses=absent)
    def log(name: str) -> Response:
        """Return the end of the log of the job's process."""
        known_job(store, name)
        path = store.folder_of(name) / LOG_FILE
        content = path.read_bytes()[-MOST_LOG:] if path.is_file() else b""
        return Response(content, media_type="text/plain; charset=utf-8")

    @router.get(
        "/campaigns/{name}/dataset",
        response_class=SentFile,
        responses={
            200: {"content": {"application/x-netcdf": {}}},
            206: {"description": "Partial Content", "content": {"application/x-netcdf": {}}},
            **problems(HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE),
            **absent,
        },
    )
    def dataset(name: str) -> SentFile:
        """Return the dataset, whole or a range of it."""
        job, path = dataset_of(store, name)
        return SentFile(path, media_type="application/x-netcdf", filename=f"{job.id}.nc")

    @router.get(
        "/campaigns/{name}/figure",
        response_class=Response,
        responses={200: DRAWN, **absent},
    )
    def figure(
        name: str,
        kind: Annotated[str, Query(json_schema_extra={"enum": ["auto", *KINDS]})] = "auto",
        file_format: Annotated[Literal["png", "svg"], Query(alias="format")] = "png",
        run: Annotated[int | None, Query(ge=0, le=2**31)] = None,
    ) -> Response:
        """Draw the dataset."""
        _, path = dataset_of(store, name)
        return Response(drawn(path, file_format, kind, run), media_type=MEDIA[file_format])

    return router

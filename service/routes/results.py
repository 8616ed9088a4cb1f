"""What a job has left: its scene, its log, its dataset, figures of it."""

from __future__ import annotations

import io
from http import HTTPStatus
from pathlib import Path
from typing import Annotated, Literal

from fastapi import APIRouter, Query, Response
from fastapi.responses import FileResponse, PlainTextResponse

from vibroimpact.analysis import figures
from vibroimpact.analysis.dataset import open_dataset
from vibroimpact.analysis.figures import KINDS
from vibroimpact.fmus.errors import VibroimpactError
from vibroimpact.service.landed import READING
from vibroimpact.service.problems import ProblemError
from vibroimpact.service.routes.described import known_job, problems
from vibroimpact.service.store import Job, State, Store

MOST_LOG = 2**20
"""Of a log, the end that is shown, byte."""


def results_router(store: Store) -> APIRouter:
    """Return the routes of what a job has left."""
    router = APIRouter(tags=["results"])
    absent = problems(HTTPStatus.NOT_FOUND, HTTPStatus.CONFLICT, HTTPStatus.UNPROCESSABLE_ENTITY)

    def dataset_of(name: str) -> tuple[Job, Path]:
        job = known_job(store, name)
        path = store.dataset_of(job)
        if job.state != State.done or not path.is_file():
            raise ProblemError(
                HTTPStatus.CONFLICT, f"{name}: expected a campaign that is done, got one that is {job.state}."
            )
        return job, path

    @router.get("/campaigns/{name}/scene", response_class=PlainTextResponse, responses=absent)
    def scene(name: str) -> Response:
        """Return the scene as it was submitted."""
        known_job(store, name)
        return Response(store.scene_of(name).read_bytes(), media_type="text/plain; charset=utf-8")

    @router.get("/campaigns/{name}/log", response_class=PlainTextResponse, responses=absent)
    def log(name: str) -> Response:
        """Return the end of what its process said."""
        known_job(store, name)
        path = store.folder_of(name) / "log.txt"
        content = path.read_bytes()[-MOST_LOG:] if path.is_file() else b""
        return Response(content, media_type="text/plain; charset=utf-8")

    @router.get(
        "/campaigns/{name}/dataset",
        response_class=FileResponse,
        responses={
            200: {"content": {"application/x-netcdf": {}}},
            206: {"description": "Partial Content", "content": {"application/x-netcdf": {}}},
            416: {"description": "Range Not Satisfiable"},
            **absent,
        },
    )
    def dataset(name: str) -> FileResponse:
        """Return the dataset, whole or a range of it."""
        job, path = dataset_of(name)
        return FileResponse(path, media_type="application/x-netcdf", filename=f"{job.id}.nc")

    @router.get(
        "/campaigns/{name}/figure",
        response_class=Response,
        responses={200: {"content": {"image/png": {}, "image/svg+xml": {}}}, **absent},
    )
    def figure(
        name: str,
        kind: Annotated[str, Query(json_schema_extra={"enum": ["auto", *KINDS]})] = "auto",
        file_format: Annotated[Literal["png", "svg"], Query(alias="format")] = "png",
        run: Annotated[int | None, Query(ge=0, le=2**31)] = None,
    ) -> Response:
        """Draw the dataset."""
        _, path = dataset_of(name)
        try:
            buffer = io.BytesIO()
            with READING, open_dataset(path) as found:
                figures.draw(found, kind, run).savefig(buffer, format=file_format)
        except VibroimpactError as error:
            raise ProblemError(HTTPStatus.UNPROCESSABLE_ENTITY, str(error)) from None
        media = {"png": "image/png", "svg": "image/svg+xml"}[file_format]
        return Response(buffer.getvalue(), media_type=media)

    return router

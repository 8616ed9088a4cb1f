"""The routes of the service: everything below `/api/v1`, described by its own OpenAPI document."""

from __future__ import annotations

import asyncio
import hashlib
import io
import json
import shutil
from collections.abc import AsyncIterator
from http import HTTPStatus
from pathlib import Path
from typing import Annotated, Literal

from fastapi import APIRouter, FastAPI, Header, Query, Request, Response
from fastapi.responses import FileResponse, PlainTextResponse, StreamingResponse
from pydantic import BaseModel, ConfigDict, Field

from vibroimpact.analysis import figures
from vibroimpact.analysis.dataset import open_dataset
from vibroimpact.analysis.figures import KINDS
from vibroimpact.fmus.errors import SceneError, VibroimpactError
from vibroimpact.fmus.shipped import components, fmu_path
from vibroimpact.orchestrator.campaign.provenance import versions
from vibroimpact.service.landed import READING
from vibroimpact.service.metrics import CONTENT_TYPE, exposition
from vibroimpact.service.page_api import page_routes
from vibroimpact.service.page_files import serve_page
from vibroimpact.service.problems import ProblemError, answer_problems
from vibroimpact.service.problems import described as problems
from vibroimpact.service.scenes import located, taken_scene, title_of
from vibroimpact.service.sessions import Sessions
from vibroimpact.service.store import ENDED, Event, Job, KeyReusedError, State, Store
from vibroimpact.service.supervisor import Supervisor

PREFIX = "/api/v1"
MOST_QUEUED = 100
"""Jobs that wait, above which no more are accepted."""
RETRY_AFTER = 30
"""Seconds after which a client that was refused may ask again."""
MOST_WORKERS = 256
"""Processes that one campaign may ask for."""
MOST_PAGE = 200
"""Jobs on one page of a list."""
LOOKS = 0.2
"""Seconds between two looks for new events."""
HEARTBEAT = 15.0
"""Seconds of silence after which a stream of events says that it is alive."""
MOST_LOG = 2**20
"""Of a log, the end that is shown, byte."""


class Submission(BaseModel):
    """A scene to be run."""

    model_config = ConfigDict(extra="forbid")

    scene: Annotated[str, Field(min_length=1, max_length=2**20, description="The scene file, TOML.")]
    workers: Annotated[int | None, Field(ge=1, le=MOST_WORKERS, description="Worker processes.")] = None


class SceneText(BaseModel):
    """A scene to be checked."""

    model_config = ConfigDict(extra="forbid")

    scene: Annotated[str, Field(max_length=2**20, description="The scene file, TOML.")]


class SceneProblem(BaseModel):
    """One problem of a scene, and where it is."""

    message: str
    line: int
    column: int


class Validation(BaseModel):
    """What is wrong with a scene: nothing, where there are no problems."""

    problems: list[SceneProblem]


class JobAnswer(BaseModel):
    """A job: a campaign, or one run."""

    id: str
    title: str
    state: State
    kind: Literal["campaign", "run"]
    workers: int | None
    created: float
    started: float | None
    ended: float | None
    total: int
    done: int
    attempts: int
    message: str


class JobPage(BaseModel):
    """Jobs, the newest first, and where the next page begins."""

    items: list[JobAnswer]
    next: int | None


class Component(BaseModel):
    """A component that the package brings."""

    name: str


def application(store: Store, supervisor: Supervisor, sessions: Sessions) -> FastAPI:
    """Return the application over a store, what runs its jobs, and the sessions of its page."""
    app = FastAPI(
        title="vibroimpact",
        version=versions()["vibroimpact"],
        description="Campaigns of vibro-impact scenes: submitted, followed, resumed, fetched.",
        docs_url=None,
        redoc_url=None,
        openapi_url=f"{PREFIX}/openapi.json",
    )
    answer_problems(app)

    @app.get("/healthz", response_class=PlainTextResponse, summary="Whether the service answers")
    def healthz() -> str:
        return "ok\n"

    @app.get("/metrics", response_class=PlainTextResponse, responses=problems(), summary="For Prometheus")
    def metrics() -> Response:
        return Response(exposition(store), media_type=CONTENT_TYPE)

    app.include_router(_campaigns(store, supervisor), prefix=PREFIX)
    app.include_router(_results(store), prefix=PREFIX)
    app.include_router(_others(), prefix=PREFIX)
    app.include_router(page_routes(store, sessions), prefix=PREFIX)
    serve_page(app)
    return app


def _answer(job: Job) -> JobAnswer:
    return JobAnswer(
        kind="campaign" if job.sweeps else "run",
        **{name: getattr(job, name) for name in JobAnswer.model_fields if name != "kind"},
    )


def _known(store: Store, name: str) -> Job:
    try:
        return store.job(name)
    except KeyError:
        raise ProblemError(
            HTTPStatus.NOT_FOUND, f"{name}: expected the id of a campaign, got an unknown one."
        ) from None


def _refused(error: SceneError, text: str) -> ProblemError:
    found = [located(problem, text) for problem in error.problems]
    return ProblemError(HTTPStatus.UNPROCESSABLE_ENTITY, found[0]["message"], problems=found)


Key = Annotated[str | None, Header(alias="Idempotency-Key", min_length=1, max_length=200)]


def _campaigns(store: Store, supervisor: Supervisor) -> APIRouter:
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
            raise _refused(error, given.scene) from None
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
        return _answer(job)

    @router.get(
        "/campaigns", responses=problems(HTTPStatus.UNPROCESSABLE_ENTITY), summary="List, the newest first"
    )
    def campaigns(
        limit: Annotated[int, Query(ge=1, le=MOST_PAGE)] = 50,
        cursor: Annotated[int | None, Query(ge=0, le=2**62, description="`next` of the page before")] = None,
    ) -> JobPage:
        found = store.jobs(before=cursor, most=limit + 1)
        more = found[limit - 1].number if len(found) > limit else None
        return JobPage(items=[_answer(job) for job in found[:limit]], next=more)

    @router.get(
        "/campaigns/{name}", responses=problems(HTTPStatus.NOT_FOUND, HTTPStatus.UNPROCESSABLE_ENTITY)
    )
    def status(name: str) -> JobAnswer:
        """Say where a campaign is."""
        return _answer(_known(store, name))

    @router.post(
        "/campaigns/{name}/cancel",
        status_code=HTTPStatus.ACCEPTED,
        responses=problems(HTTPStatus.NOT_FOUND, HTTPStatus.CONFLICT, HTTPStatus.UNPROCESSABLE_ENTITY),
    )
    def cancel(name: str) -> JobAnswer:
        """End a campaign that waits or runs; what it has computed stays, and can be resumed."""
        job = _known(store, name)
        if not supervisor.cancel(name) and store.job(name).state in ENDED:
            raise ProblemError(
                HTTPStatus.CONFLICT,
                f"{name}: expected a campaign that waits or runs, got one that is {job.state}.",
            )
        return _answer(store.job(name))

    @router.post(
        "/campaigns/{name}/resume",
        status_code=HTTPStatus.ACCEPTED,
        responses=problems(HTTPStatus.NOT_FOUND, HTTPStatus.CONFLICT, HTTPStatus.UNPROCESSABLE_ENTITY),
    )
    def resume(name: str) -> JobAnswer:
        """Go on with a campaign that was cancelled or has failed, from what is there."""
        job = _known(store, name)
        again = {"state": State.queued, "message": "", "ended": None, "attempts": 0}
        if not store.change(name, only_from=[State.cancelled, State.failed], **again):
            raise ProblemError(
                HTTPStatus.CONFLICT,
                f"{name}: expected a campaign that was cancelled or has failed, got one that is {job.state}.",
            )
        return _answer(store.job(name))

    @router.delete(
        "/campaigns/{name}",
        status_code=HTTPStatus.NO_CONTENT,
        responses=problems(HTTPStatus.NOT_FOUND, HTTPStatus.CONFLICT, HTTPStatus.UNPROCESSABLE_ENTITY),
    )
    def delete(name: str) -> None:
        """Forget a campaign that has ended, with its folder."""
        job = _known(store, name)
        if job.state not in ENDED:
            raise ProblemError(
                HTTPStatus.CONFLICT,
                f"{name}: expected a campaign that has ended, got one that is {job.state}. Cancel it first.",
            )
        store.delete(name)
        shutil.rmtree(store.folder_of(name))

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
        _known(store, name)
        lines = _stream(store, name, last_event_id or 0, request)
        return StreamingResponse(lines, media_type="text/event-stream")

    return router


async def _stream(store: Store, name: str, last: int, request: Request) -> AsyncIterator[str]:
    """Yield the events of a job after one of them, those to come as well, until it has ended."""
    silent = 0.0
    while not await request.is_disconnected():
        found = await asyncio.to_thread(store.events, name, after=last)
        for event in found:
            last, silent = event.id, 0.0
            yield _event_lines(event)
        try:
            ended = store.job(name).state in ENDED
        except KeyError:
            return  # it was deleted
        if ended and not found:
            return
        if not found:
            await asyncio.sleep(LOOKS)
            silent += LOOKS
            if silent >= HEARTBEAT:
                silent = 0.0
                yield ": alive\n\n"


def _event_lines(event: Event) -> str:
    data = json.dumps(event.data | {"at": event.at})
    return f"id: {event.id}\nevent: {event.kind}\ndata: {data}\n\n"


def _results(store: Store) -> APIRouter:
    router = APIRouter(tags=["results"])
    absent = problems(HTTPStatus.NOT_FOUND, HTTPStatus.CONFLICT, HTTPStatus.UNPROCESSABLE_ENTITY)

    def dataset_of(name: str) -> tuple[Job, Path]:
        job = _known(store, name)
        path = store.dataset_of(job)
        if job.state != State.done or not path.is_file():
            raise ProblemError(
                HTTPStatus.CONFLICT, f"{name}: expected a campaign that is done, got one that is {job.state}."
            )
        return job, path

    @router.get("/campaigns/{name}/scene", response_class=PlainTextResponse, responses=absent)
    def scene(name: str) -> Response:
        """Return the scene as it was submitted."""
        _known(store, name)
        return Response(store.scene_of(name).read_bytes(), media_type="text/plain; charset=utf-8")

    @router.get("/campaigns/{name}/log", response_class=PlainTextResponse, responses=absent)
    def log(name: str) -> Response:
        """Return the end of what its process said."""
        _known(store, name)
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


def _others() -> APIRouter:
    router = APIRouter()

    @router.post("/scenes/validate", responses=problems(HTTPStatus.UNPROCESSABLE_ENTITY), tags=["scenes"])
    def validate(given: SceneText) -> Validation:
        """Return all problems of a scene, with their lines and columns."""
        try:
            taken_scene(given.scene)
        except SceneError as error:
            found = [SceneProblem(**located(problem, given.scene)) for problem in error.problems]
            return Validation(problems=found)
        return Validation(problems=[])

    @router.get("/fmus", responses=problems(), tags=["fmus"])
    def fmus() -> list[Component]:
        """List the components of the package."""
        return [Component(name=name) for name in sorted(components())]

    @router.get(
        "/fmus/{name}",
        response_class=FileResponse,
        responses={
            200: {"content": {"application/zip": {}}},
            206: {"description": "Partial Content"},
            416: {"description": "Range Not Satisfiable"},
            **problems(HTTPStatus.NOT_FOUND, HTTPStatus.UNPROCESSABLE_ENTITY),
        },
        tags=["fmus"],
    )
    def fmu(name: str, fmi: Annotated[Literal["2.0", "3.0"], Query()] = "3.0") -> FileResponse:
        """Return a component of the package as it is loaded here."""
        if name not in components():
            raise ProblemError(
                HTTPStatus.NOT_FOUND, f"{name}: expected one of {', '.join(sorted(components()))}."
            )
        return FileResponse(fmu_path(name, fmi), media_type="application/zip", filename=f"{name}.fmu")

    return router

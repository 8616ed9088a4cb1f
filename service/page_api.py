"""Routes for the page, besides those for every client: session, slices, points, failures, examples."""

from __future__ import annotations

from functools import cache
from http import HTTPStatus
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from fastapi import APIRouter, Query, Request, Response
from fastapi import Path as PathPart
from pydantic import BaseModel

from vibroimpact.analysis.dataset import Direction, Outcome
from vibroimpact.fmus.errors import DatasetError, SceneError
from vibroimpact.service.landed import Failure, Landed, LandedReader, Quantity, files_of
from vibroimpact.service.points import simulated_point
from vibroimpact.service.problems import ProblemError
from vibroimpact.service.routes.described import known_job, problems
from vibroimpact.service.scenes import Shelf, taken_scene
from vibroimpact.service.sessions import SECONDS, Sessions, is_own_origin
from vibroimpact.service.slices import Selection, slice_of
from vibroimpact.service.store import Job, Kind, State, Store

DEFAULT_VARIABLES = (
    "strobe_displacement",
    "displacement_range",
    "impact_velocity",
    "variance_accounted_for",
    "final_displacement",
)
"""Default variables to show of a campaign: the first one with values is taken."""
MOST_ROWS = 50_000
"""Largest number of rows in one slice."""
MOST_FAILURES = 200
"""Number of failures on one page of their list."""
FAILED = (Outcome.error, Outcome.crash, Outcome.timeout, Outcome.impact_limit, Outcome.unbounded)
MOST_RUN = 2**31 - 1

Column = list[float | None]


class QuantityAnswer(BaseModel):
    """A variable, or a swept parameter."""

    name: str
    label: str
    units: str
    along: str


class SliceAnswer(BaseModel):
    """Columns of equal length: `run`, `direction`, `outcome`, `value`, and one for each axis in `coordinates`.

    A map with more rows than requested is thinned to one of `every` values of each axis. Values of the class of runs
    are places in `classes`, the most frequent first. The `along` of an axis is a dimension shared with other axes.
    """

    state: State
    total: int
    landed: int
    variable: QuantityAnswer | None
    variables: list[QuantityAnswer]
    axes: list[QuantityAnswer]
    directions: list[str]
    outcomes: list[str]
    rows: int
    shown: int
    every: int
    classes: list[str]
    run: list[int]
    direction: list[int]
    outcome: list[int]
    coordinates: list[Column]
    value: Column


class PointAnswer(BaseModel):
    """One point, simulated again: columns by the name of their variable.

    `stops` has the positions that limit a sampled displacement; `left_out` lists parts missing in the columns.
    """

    run: int
    direction: str
    coordinates: dict[str, float]
    outcome: str
    message: str
    units: dict[str, str]
    stops: dict[str, list[float]]
    left_out: list[str]
    samples: dict[str, Column]
    impacts: dict[str, Column]
    periods: dict[str, Column]


class FailureAnswer(BaseModel):
    """A point that did not reach its end."""

    run: int
    outcome: str
    message: str
    coordinates: dict[str, float]


class FailurePage(BaseModel):
    """Points that did not reach their end, in the order of their index."""

    total: int
    items: list[FailureAnswer]
    next: int | None


class ExampleAnswer(BaseModel):
    """An example scene."""

    name: str
    title: str
    kind: Literal["campaign", "run"]
    scene: str


def page_routes(store: Store, shelf: Shelf, sessions: Sessions) -> APIRouter:
    """Return the routes of the page."""
    router = APIRouter()
    router.include_router(_session(sessions), tags=["session"])
    reader = LandedReader()
    router.include_router(_slices(store, reader), tags=["results"])
    router.include_router(_points(store, reader), tags=["results"])
    router.include_router(_scenes(shelf), tags=["scenes"])
    return router


def _session(sessions: Sessions) -> APIRouter:
    router = APIRouter()

    @router.post(
        "/session",
        status_code=HTTPStatus.NO_CONTENT,
        responses=problems(HTTPStatus.FORBIDDEN),
        summary="Begin a session of a browser",
    )
    def begin(request: Request, response: Response) -> None:
        """Exchange the token for a cookie, which no script of a page can read."""
        if "origin" in request.headers and not is_own_origin(dict(request.scope["headers"])):
            raise ProblemError(HTTPStatus.FORBIDDEN, "Origin: expected the page of this service.")
        response.set_cookie(
            sessions.cookie,
            sessions.made(),
            max_age=SECONDS,
            path="/api/v1",
            secure=request.url.scheme == "https",
            httponly=True,
            samesite="strict",
        )

    @router.delete(
        "/session", status_code=HTTPStatus.NO_CONTENT, responses=problems(), summary="End the session"
    )
    def end(response: Response) -> None:
        response.delete_cookie(sessions.cookie, path="/api/v1", httponly=True, samesite="strict")

    return router


def _results(store: Store, job: Job) -> Path:
    """Return the place of a job's results: the folder of a campaign, or the dataset of a run."""
    if job.kind not in (Kind.campaign, Kind.run):
        raise ProblemError(
            HTTPStatus.CONFLICT,
            f"{job.id}: expected a campaign or a run, which have points, got: {job.kind}.",
        )
    path = store.dataset_of(job)
    return path.parent if job.kind is Kind.campaign else path


def _files(store: Store, job: Job) -> list[Path]:
    results = _results(store, job)
    if job.kind is Kind.campaign:
        return files_of(results)
    return [results] if results.is_file() else []


def _damaged(store: Store, job: Job, error: DatasetError) -> ProblemError:
    why = str(error).replace(f"{store.folder_of(job.id)}/", "")  # hide the service's own folder
    return ProblemError(HTTPStatus.CONFLICT, f"{job.id}: expected results that can be read, got: {why}")


def _slices(store: Store, reader: LandedReader) -> APIRouter:
    router = APIRouter()

    def landed_of(job: Job, variable: str | None) -> tuple[str, Landed | None]:
        found: list[tuple[str, Landed | None]] = []
        for name in DEFAULT_VARIABLES if variable is None else (variable,):
            try:
                landed = reader.read(_files(store, job), name)
            except KeyError:
                continue
            except DatasetError as error:
                raise _damaged(store, job, error) from None
            found.append((name, landed))
            if landed is None or np.isfinite(landed.values).any():
                return found[-1]
        if found:
            return found[0]
        raise ProblemError(
            HTTPStatus.UNPROCESSABLE_ENTITY, f"variable: expected one of this campaign, got {variable!r}."
        )

    @router.get(
        "/campaigns/{name}/slice",
        responses=problems(HTTPStatus.NOT_FOUND, HTTPStatus.CONFLICT, HTTPStatus.UNPROCESSABLE_ENTITY),
        summary="One variable of the finished points",
    )
    def one_slice(
        name: str,
        variable: Annotated[str | None, Query(max_length=200)] = None,
        # FastAPI copies defaults, and reads a list from the query only if the default is a list
        at: Annotated[list[str], Query(max_length=20, description="NAME:VALUE, nearest existing")] = [],  # noqa: B006
        within: Annotated[list[str], Query(max_length=20, description="NAME:LOW:HIGH")] = [],  # noqa: B006
        most: Annotated[int, Query(ge=1, le=MOST_ROWS, description="Largest number of rows")] = 5000,
    ) -> SliceAnswer:
        """Return columns with a limited number of rows, thinned evenly; numbers that are not finite become null."""
        job = known_job(store, name)
        found, landed = landed_of(job, variable)
        try:
            selection = Selection.from_words(at, within)
            columns = _empty() if landed is None else slice_of(landed, selection, most)
        except ValueError as error:
            raise ProblemError(HTTPStatus.UNPROCESSABLE_ENTITY, str(error)) from None
        quantities = () if landed is None else landed.quantities
        shown = next((one for one in quantities if one.name == found), None)
        return SliceAnswer(
            state=job.state,
            total=job.total,
            landed=0 if landed is None else landed.runs.size,
            variable=None if shown is None else _quantity(shown),
            variables=[_quantity(one) for one in quantities],
            axes=[] if landed is None else [_quantity(axis) for axis in landed.axes],
            directions=[one.name for one in sorted(Direction)],
            outcomes=[one.name for one in sorted(Outcome)],
            **columns,
        )

    return router


def _empty() -> dict[str, Any]:
    columns: dict[str, list[Any]] = {
        name: [] for name in ("run", "direction", "outcome", "coordinates", "value")
    }
    return {"rows": 0, "shown": 0, "every": 1, "classes": [], **columns}


def _quantity(one: Quantity) -> QuantityAnswer:
    return QuantityAnswer(name=one.name, label=one.label, units=one.units, along=one.along)


def _points(store: Store, reader: LandedReader) -> APIRouter:
    router = APIRouter()

    @router.get(
        "/campaigns/{name}/points/{run}",
        responses=problems(
            HTTPStatus.NOT_FOUND,
            HTTPStatus.CONFLICT,
            HTTPStatus.UNPROCESSABLE_ENTITY,
            HTTPStatus.TOO_MANY_REQUESTS,
        ),
        summary="One point, simulated again with its motion in time",
    )
    def point(name: str, run: Annotated[int, PathPart(ge=0, le=MOST_RUN)]) -> PointAnswer:
        """Simulate a point of a campaign again; on a path it starts from the end state of the point before it."""
        results = _results(store, known_job(store, name))
        return PointAnswer(**simulated_point(store.scene_of(name), results, run))

    @router.get(
        "/campaigns/{name}/failures",
        responses=problems(HTTPStatus.NOT_FOUND, HTTPStatus.CONFLICT, HTTPStatus.UNPROCESSABLE_ENTITY),
        summary="Points that did not reach their end, and why",
    )
    def failures(
        name: str,
        limit: Annotated[int, Query(ge=1, le=MOST_FAILURES)] = 50,
        cursor: Annotated[int, Query(ge=0, le=MOST_RUN, description="`next` of the page before")] = 0,
    ) -> FailurePage:
        job = known_job(store, name)
        try:
            found = reader.failures(_files(store, job), FAILED)
        except DatasetError as error:
            raise _damaged(store, job, error) from None
        left = [one for one in found if one.run >= cursor]
        more = left[limit].run if len(left) > limit else None
        return FailurePage(total=len(found), items=[_failure(one) for one in left[:limit]], next=more)

    return router


def _scenes(shelf: Shelf) -> APIRouter:
    router = APIRouter()

    @router.get("/examples", responses=problems(), summary="Example scenes")
    def examples() -> list[ExampleAnswer]:
        return _examples(shelf)

    return router


def _failure(one: Failure) -> FailureAnswer:
    return FailureAnswer(
        run=one.run, outcome=Outcome(one.outcome).name, message=one.message, coordinates=one.coordinates
    )


@cache
def _examples(shelf: Shelf) -> list[ExampleAnswer]:
    """Return the project's examples that this service accepts, campaigns first."""
    found = []
    for path in sorted(examples_folder().glob("*.toml")):
        text = path.read_text(encoding="utf-8")
        try:
            scene = taken_scene(text, shelf).scene
        except SceneError:
            continue  # it needs an FMU that the package does not contain
        kind: Literal["campaign", "run"] = "campaign" if scene.sweep else "run"
        found.append(ExampleAnswer(name=path.stem, title=scene.title, kind=kind, scene=text))
    return sorted(found, key=lambda one: one.kind)


def examples_folder() -> Path:
    """Return the folder of the examples: in the package, or in the checkout of an editable install."""
    package = Path(str(files("vibroimpact.service")))
    shipped = package / "examples"
    return shipped if shipped.is_dir() else package.resolve().parent / "examples"

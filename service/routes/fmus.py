"""The FMUs that a scene may name: listed, exported, uploaded where that is allowed."""

from __future__ import annotations

import asyncio
from http import HTTPStatus
from pathlib import Path
from typing import Annotated, Literal

from fastapi import APIRouter, Query, Request, Response
from pydantic import BaseModel

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.shipped import components, fmu_path
from vibroimpact.service.fmus import NAME, FmuStore
from vibroimpact.service.problems import ProblemError
from vibroimpact.service.routes.described import PREFIX, problems
from vibroimpact.service.routes.uploads import Uploads
from vibroimpact.service.sent_files import SentFile


class Component(BaseModel):
    """A component that a scene may name, and whether it is part of the package or was uploaded."""

    name: str
    origin: Literal["package", "uploaded"]


def fmus_router(fmus: FmuStore, uploads: Uploads) -> APIRouter:
    """Return the routes of components."""
    router = APIRouter(tags=["fmus"])

    @router.get("/fmus", responses=problems())
    def listed() -> list[Component]:
        """List the components of the package and the uploaded ones."""
        own = [Component(name=name, origin="uploaded") for name in fmus.names()]
        return [Component(name=name, origin="package") for name in sorted(components())] + own

    @router.get(
        "/fmus/{name}",
        response_class=SentFile,
        responses={
            200: {"content": {"application/zip": {}}},
            206: {"description": "Partial Content"},
            **problems(HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE),
            **problems(HTTPStatus.NOT_FOUND, HTTPStatus.UNPROCESSABLE_ENTITY),
        },
    )
    def fmu(name: str, fmi: Annotated[Literal["2.0", "3.0"], Query()] = "3.0") -> SentFile:
        """Return a component as the service loads it; `fmi` applies to components of the package."""
        path = Path(fmu_path(name, fmi)) if name in components() else fmus.find(name)
        if path is None:
            known = ", ".join([*sorted(components()), *fmus.names()])
            raise ProblemError(HTTPStatus.NOT_FOUND, f"{name}: expected one of {known}.")
        return SentFile(path, media_type="application/zip", filename=f"{name.removesuffix('.fmu')}.fmu")

    @router.post(
        "/fmus",
        status_code=HTTPStatus.CREATED,
        responses=problems(
            *(HTTPStatus.FORBIDDEN, HTTPStatus.REQUEST_TIMEOUT),
            *(HTTPStatus.UNPROCESSABLE_ENTITY, HTTPStatus.INSUFFICIENT_STORAGE),
        ),
        openapi_extra={
            "requestBody": {
                "required": True,
                "content": {"application/octet-stream": {"schema": {"type": "string"}}},
            }
        },
        summary="Upload an FMU",
    )
    async def upload(
        request: Request,
        response: Response,
        name: Annotated[str, Query(pattern=NAME, description="Name for scenes.")],
    ) -> Component:
        """Accept an uploaded FMU, also of a user's contact law, if the service was started with `--allow-fmu-upload`.

        The service checks its archive and its description; no code of it is loaded before a scene names it.
        """
        if not fmus.takes_uploads:
            raise ProblemError(
                HTTPStatus.FORBIDDEN,
                "expected a service that takes FMUs, got one that does not: they are native code. "
                "Start it with --allow-fmu-upload.",
            )
        try:
            async with uploads.received(request, name) as given, uploads.turn:
                await asyncio.to_thread(fmus.add, given.file, name)
        except UsageError as error:
            raise ProblemError(HTTPStatus.UNPROCESSABLE_ENTITY, str(error)) from None
        response.headers["Location"] = f"{PREFIX}/fmus/{name}"
        return Component(name=name, origin="uploaded")

    return router

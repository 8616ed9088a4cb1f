"""The components that a scene may name."""

from __future__ import annotations

from http import HTTPStatus
from typing import Annotated, Literal

from fastapi import APIRouter, Query
from fastapi.responses import FileResponse
from pydantic import BaseModel

from vibroimpact.fmus.shipped import components, fmu_path
from vibroimpact.service.problems import ProblemError
from vibroimpact.service.routes.described import problems


class Component(BaseModel):
    """A component that the package brings."""

    name: str


def fmus_router() -> APIRouter:
    """Return the routes of components."""
    router = APIRouter(tags=["fmus"])

    @router.get("/fmus", responses=problems())
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
    )
    def fmu(name: str, fmi: Annotated[Literal["2.0", "3.0"], Query()] = "3.0") -> FileResponse:
        """Return a component of the package as it is loaded here."""
        if name not in components():
            raise ProblemError(
                HTTPStatus.NOT_FOUND, f"{name}: expected one of {', '.join(sorted(components()))}."
            )
        return FileResponse(fmu_path(name, fmi), media_type="application/zip", filename=f"{name}.fmu")

    return router

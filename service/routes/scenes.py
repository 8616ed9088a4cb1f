"""Scenes to check without running them."""

from __future__ import annotations

from http import HTTPStatus
from typing import Annotated

from fastapi import APIRouter
from pydantic import BaseModel, ConfigDict, Field

from vibroimpact.fmus.errors import SceneError
from vibroimpact.service.bodies import BoundedRoute
from vibroimpact.service.problems import ProblemError
from vibroimpact.service.routes.described import problems
from vibroimpact.service.scenes import Shelf, located, taken_scene


class SceneText(BaseModel):
    """A scene to check."""

    model_config = ConfigDict(extra="forbid")

    scene: Annotated[str, Field(max_length=2**20, description="The scene file, TOML.")]


class SceneProblem(BaseModel):
    """One problem of a scene, and its line and column."""

    message: str
    line: int
    column: int


class Validation(BaseModel):
    """The problems of a scene; a valid scene has none."""

    problems: list[SceneProblem]


def scenes_router(shelf: Shelf) -> APIRouter:
    """Return the route that checks a scene."""
    router = APIRouter(tags=["scenes"], route_class=BoundedRoute)

    @router.post("/scenes/validate", responses=problems(HTTPStatus.UNPROCESSABLE_ENTITY))
    def validate(given: SceneText) -> Validation:
        """Return all problems of a scene, with their lines and columns."""
        try:
            taken_scene(given.scene, shelf)
        except SceneError as error:
            found = [SceneProblem(**one) for one in located(error.problems, given.scene)]
            return Validation(problems=found)
        return Validation(problems=[])

    return router


def refused_scene(error: SceneError, text: str) -> ProblemError:
    """Return the refusal of a scene, with all of its problems."""
    found = located(error.problems, text)
    return ProblemError(HTTPStatus.UNPROCESSABLE_ENTITY, found[0]["message"], problems=found)

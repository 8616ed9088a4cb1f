"""Answers for refused requests: problem details (RFC 9457), each with one clear text."""

from __future__ import annotations

import sqlite3
from collections.abc import Mapping
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException

from vibroimpact.service.passing import FULL, SHORT

_FULL_DATABASE = ("SQLITE_FULL", "SQLITE_IOERR_WRITE", "SQLITE_IOERR_FSYNC", "SQLITE_IOERR_SHMSIZE")
_HELD_DATABASE = ("SQLITE_BUSY", "SQLITE_LOCKED")
_SHORT_DATABASE = ("SQLITE_CANTOPEN", "SQLITE_NOMEM", "SQLITE_IOERR_NOMEM")
RETRY_HELD = 2
"""Time after which a client may retry, s, if the database was locked or the machine short of a resource."""
MEDIA_TYPE = "application/problem+json"
MOST_PROBLEMS = 50
"""Largest number of problems in one answer; the client mends these first."""
MOST_CHARACTERS = 1000
"""Length of a message above which its middle is left out: messages quote the client's input."""


class ProblemError(Exception):
    """A refused request: the detail says what is wrong and what was expected; `members` are further fields."""

    def __init__(
        self, status: HTTPStatus, detail: str, headers: Mapping[str, str] | None = None, **members: Any
    ) -> None:
        self.status, self.detail, self.headers, self.members = status, detail, dict(headers or {}), members
        super().__init__(detail)


def answer(
    status: int, detail: str, headers: Mapping[str, str] | None = None, **members: Any
) -> JSONResponse:
    """Return a problem as a response."""
    return JSONResponse(problem(status, detail) | members, status, dict(headers or {}), MEDIA_TYPE)


def problem(status: int, detail: str) -> dict[str, Any]:
    """Return a problem as its JSON members."""
    return {
        "type": "about:blank",
        "title": HTTPStatus(status).phrase,
        "status": status,
        "detail": shortened(detail),
    }


def shortened(text: str) -> str:
    """Return a text of at most `MOST_CHARACTERS`; a longer one loses its middle.

    >>> shortened("a" * 600 + "b" * 600) == "a" * 498 + " ... " + "b" * 497
    True
    """
    if len(text) <= MOST_CHARACTERS:
        return text
    half = (MOST_CHARACTERS - 5) // 2
    return f"{text[: half + 1]} ... {text[-half:]}"


def is_held(error: Exception) -> bool:
    """Return whether an error means that another program has locked the database."""
    return getattr(error, "sqlite_errorname", "").startswith(_HELD_DATABASE)


def is_full(error: Exception) -> bool:
    """Return whether an error means a full disk, under a file or under the database."""
    if isinstance(error, sqlite3.Error):
        return getattr(error, "sqlite_errorname", "") in _FULL_DATABASE
    return isinstance(error, OSError) and error.errno in FULL


def is_short(error: Exception) -> bool:
    """Return whether an error means a process or system without free descriptors or memory."""
    if isinstance(error, sqlite3.Error):
        return getattr(error, "sqlite_errorname", "").startswith(_SHORT_DATABASE)
    return isinstance(error, OSError) and error.errno in SHORT


def why_later(error: Exception) -> str:
    """Return the shortage that a job must wait for after an error; empty if waiting does not help."""
    if is_full(error):
        return "waits for room on the disk"
    return "waits for free files and memory of the machine" if is_short(error) else ""


def answer_problems(app: FastAPI) -> None:
    """Let an application answer all of its errors as problem details."""

    @app.exception_handler(ProblemError)
    def of_ours(_: Request, problem: ProblemError) -> JSONResponse:
        return answer(problem.status, problem.detail, problem.headers, **problem.members)

    @app.exception_handler(OSError)
    @app.exception_handler(sqlite3.Error)
    def of_the_disk(_: Request, error: Exception) -> JSONResponse:
        if is_held(error):
            return answer(
                HTTPStatus.SERVICE_UNAVAILABLE,
                "expected the database of the service, got one that another program holds. Ask again.",
                {"Retry-After": str(RETRY_HELD)},
            )
        if is_short(error):
            return answer(
                HTTPStatus.SERVICE_UNAVAILABLE,
                "expected free files and memory of the machine, got none. Ask again.",
                {"Retry-After": str(RETRY_HELD)},
            )
        if not is_full(error):
            raise error
        return answer(
            HTTPStatus.INSUFFICIENT_STORAGE,
            "expected room on the disk of the service, got none. Nothing that was accepted is lost; ask again when "
            "there is room.",
        )

    @app.exception_handler(HTTPException)
    def of_routing(request: Request, error: HTTPException) -> JSONResponse:
        return answer(
            error.status_code, f"{request.method} {request.url.path}: {error.detail}", error.headers
        )

    @app.exception_handler(RequestValidationError)
    def of_validation(_: Request, error: RequestValidationError) -> JSONResponse:
        problems = [
            {"message": shortened(f"{'.'.join(str(part) for part in one['loc'])}: {one['msg']}")}
            for one in error.errors()[:MOST_PROBLEMS]
        ]
        detail = problems[0]["message"] if problems else "the request does not fit"
        return answer(HTTPStatus.UNPROCESSABLE_ENTITY, detail, problems=problems)

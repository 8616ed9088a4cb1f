"""Acceptance of any job: 202 with its place, the same answer to the same key, 429 when too many wait."""

from __future__ import annotations

import hashlib
from http import HTTPStatus
from typing import Annotated

from fastapi import Header, Response
from pydantic import BaseModel

from vibroimpact.service.problems import ProblemError
from vibroimpact.service.routes.described import PREFIX, JobAnswer, job_answer
from vibroimpact.service.store import KeyReusedError, NewJob, QueueFullError, Store

MOST_QUEUED = 100
"""Number of waiting jobs above which no more are accepted."""
RETRY_AFTER = 30
"""Time after which a refused client may retry, s."""
IdempotencyKey = Annotated[str | None, Header(alias="Idempotency-Key", min_length=1, max_length=200)]


def accepted(store: Store, new: NewJob, given: BaseModel, response: Response, key: str | None) -> JobAnswer:
    """Accept the job of a request, and put its address into the response."""
    digest = hashlib.sha256(f"{type(given).__name__}{given.model_dump_json()}".encode()).hexdigest()
    try:
        job, _ = store.submit(new, key=key or "", digest=digest, most_queued=MOST_QUEUED)
    except QueueFullError:
        raise ProblemError(
            HTTPStatus.TOO_MANY_REQUESTS,
            f"expected fewer than {MOST_QUEUED} campaigns that wait, got a full queue. Come back later.",
            {"Retry-After": str(RETRY_AFTER)},
        ) from None
    except KeyReusedError:
        raise ProblemError(
            HTTPStatus.UNPROCESSABLE_ENTITY,
            "Idempotency-Key: expected a new key, got that of another request.",
        ) from None
    response.headers["Location"] = f"{PREFIX}/campaigns/{job.id}"
    return job_answer(job)

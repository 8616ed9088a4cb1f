"""A database that another program has locked, or that fails for a while, delays the service and ends nothing."""

from __future__ import annotations

import asyncio
import errno
import os
import sqlite3
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi import FastAPI

from vibroimpact.fmus.processes.process import Process
from vibroimpact.service import store as store_module
from vibroimpact.service import supervisor as module
from vibroimpact.service.problems import answer_problems
from vibroimpact.service.store import DATABASE, Job, Kind, NewJob, State, Store
from vibroimpact.service.supervisor import Supervisor

JOB = NewJob(Kind.run, "held", "a scene")
WORKS = 'import time; time.sleep(0.3); print(\'{"total": 1, "done": 1}\')'


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Store]:
    """Yield the store of a service whose jobs finish instantly, and whose pauses are short."""
    monkeypatch.setattr(store_module, "HELD_SECONDS", 0.01)
    monkeypatch.setattr(module, "PAUSE", 0.05)
    monkeypatch.setattr(module, "IDLE", 0.02)
    monkeypatch.setattr(module, "Process", lambda *_, **options: Process("-c", WORKS, **options))
    opened = Store(tmp_path)
    yield opened
    opened.close()


@pytest.fixture
def supervisor(store: Store) -> Iterator[Supervisor]:
    running = Supervisor(store)
    running.start()
    yield running
    running.close()


def holder(store: Store) -> sqlite3.Connection:
    """Return another program's connection, which locks the database until it is closed."""
    other = sqlite3.connect(store.folder / DATABASE, isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    return other


def until(store: Store, job: Job, state: State) -> Job:
    end = time.monotonic() + 20.0
    while store.job(job.id).state != state:
        assert time.monotonic() < end, store.job(job.id)
        time.sleep(0.01)
    return store.job(job.id)


@pytest.mark.usefixtures("supervisor")
def test_a_job_that_waits_begins_when_the_database_is_let_go(store: Store) -> None:
    job, _ = store.submit(JOB)
    other = holder(store)
    time.sleep(0.2)
    other.close()
    assert until(store, job, State.done).done == 1


@pytest.mark.usefixtures("supervisor")
def test_the_end_of_a_job_is_noted_when_the_database_is_let_go(store: Store) -> None:
    job, _ = store.submit(JOB)
    until(store, job, State.running)
    other = holder(store)
    time.sleep(0.6)
    other.close()
    assert until(store, job, State.done).attempts == 1


@pytest.mark.usefixtures("supervisor")
def test_a_job_is_taken_up_again_after_a_database_that_failed(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    job, _ = store.submit(JOB)
    until(store, job, State.running)
    failed = threading.Event()
    with monkeypatch.context() as patched:

        def fails(*_: object, **__: object) -> bool:
            failed.set()
            raise sqlite3.OperationalError("disk I/O error")

        patched.setattr(store, "change", fails)
        assert failed.wait(20.0)  # the database fails for the end of the job, or for its last message
    assert until(store, job, State.done).attempts == 2


@pytest.mark.usefixtures("supervisor")
@pytest.mark.parametrize("number", [errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.ENOSPC])
@pytest.mark.parametrize("place", ["Process", "JobLog"])
def test_a_short_machine_delays_jobs_and_is_said_once(
    store: Store, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, place: str, number: int
) -> None:
    refusals = threading.Semaphore(0)

    def refuse(*_: object, **__: object) -> None:
        refusals.release()
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(module, "LONGEST_PAUSE", 0.05)
    with monkeypatch.context() as patched, caplog.at_level("WARNING"):
        patched.setattr(module, place, refuse)
        jobs = [store.submit(JOB)[0] for _ in range(3)]
        for _ in range(6):
            assert refusals.acquire(timeout=20.0)
        assert {store.job(job.id).state for job in jobs} <= {State.queued, State.running}
    assert [record.getMessage() for record in caplog.records].count("jobs wait") == 1
    for job in jobs:
        ended = until(store, job, State.done)
        assert (ended.done, ended.attempts) == (1, 1), "what hinders all jobs is no attempt of one"


def test_who_asks_meanwhile_is_told_to_ask_again(store: Store) -> None:
    app = FastAPI()
    answer_problems(app)

    @app.post("/")
    def submit() -> dict[str, Any]:
        return {"id": store.submit(JOB)[0].id}

    async def answer() -> httpx.Response:
        transport = httpx.ASGITransport(app)
        async with httpx.AsyncClient(transport=transport, base_url="http://service") as client:
            return await client.post("/")

    other = holder(store)
    refused = asyncio.run(answer())
    other.close()
    assert (refused.status_code, refused.headers["Retry-After"]) == (503, "2")
    assert "another program holds" in refused.json()["detail"]
    assert not list((store.folder / "jobs").glob("*"))
    assert asyncio.run(answer()).status_code == 200

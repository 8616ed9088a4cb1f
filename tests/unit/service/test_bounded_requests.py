"""Bounds on the cost of a request: few values, few problems, a limited queue, turns by memory."""

from __future__ import annotations

import asyncio
import json
import threading
import time
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi import FastAPI

from vibroimpact.fmus.errors import UsageError
from vibroimpact.service.bodies import BoundedRoute
from vibroimpact.service.memory import import_memory, imports_at_once
from vibroimpact.service.problems import MOST_PROBLEMS, answer_problems
from vibroimpact.service.recordings import stored_name
from vibroimpact.service.routes.accepting import MOST_QUEUED
from vibroimpact.service.routes.campaigns import campaigns_router
from vibroimpact.service.routes.estimates import estimates_router
from vibroimpact.service.routes.scenes import scenes_router
from vibroimpact.service.routes.uploads import Uploads
from vibroimpact.service.sent_files import SentFile
from vibroimpact.service.store import Kind, NewJob, QueueFullError, State, Store

nothing: Any = None
app = FastAPI()
answer_problems(app)
for router in (
    campaigns_router(nothing, nothing, nothing),
    estimates_router(nothing, nothing),
    scenes_router(nothing),
):
    app.include_router(router)


@app.get("/file")
def file() -> SentFile:
    return SentFile(Path(__file__), filename="file.nc")


def answer_to(method: str, path: str, **request: Any) -> httpx.Response:
    async def ask() -> httpx.Response:
        transport = httpx.ASGITransport(app)
        async with httpx.AsyncClient(transport=transport, base_url="http://service") as client:
            return await client.request(method, path, **request)

    return asyncio.run(ask())


def keys(count: int) -> bytes:
    return json.dumps({"scene": "x"} | {f"{place:x}": 0 for place in range(count)}).encode()


@pytest.mark.parametrize("path", ["/campaigns", "/scenes/validate", "/estimates"])
@pytest.mark.parametrize(
    "body",
    [
        keys(250_000),
        json.dumps({"scene": "x", "recordings": [0] * 1_000_000}).encode(),
        json.dumps({"scene": [[]] * 500_000}).encode(),
        b'{"scene":' + b"[" * 2_000_000,
        b'{"scene": ' + b"1" * 4_000_000 + b"}",
        json.dumps({"scene": "x", "k" * 4_000_000: 0}).encode(),
        b'{"scene": "' + b'\\"' * 2_000_000,
        b'{"scene": ' + b'"' * 4_000_000,
    ],
    ids=["keys", "items", "lists", "depth", "digits", "one key", "no end", "quotes"],
)
def test_a_body_of_any_kind_costs_little_and_is_answered_shortly(path: str, body: bytes) -> None:
    began = time.process_time()
    refused = answer_to("POST", path, content=body, headers={"Content-Type": "application/json"})
    assert refused.status_code in (400, 422)
    assert refused.headers["content-type"] == "application/problem+json"
    assert len(refused.content) < 4000
    assert time.process_time() - began < 1.0  # 250,000 problems took 3 s and more


def test_the_problems_of_a_body_are_told_as_ever() -> None:
    refused = answer_to("POST", "/campaigns", json={"scene": "x", "workres": 2, "workers": 0}).json()
    messages = " ".join(one["message"] for one in refused["problems"])
    assert "body.workres: Extra inputs are not permitted" in messages
    assert "body.workers" in messages
    many = answer_to("POST", "/campaigns", content=keys(900), headers={"Content-Type": "application/json"})
    assert len(many.json()["problems"]) == MOST_PROBLEMS


def test_every_route_that_reads_a_body_bounds_it() -> None:
    for router in (campaigns_router(nothing, nothing, nothing), estimates_router(nothing, nothing)):
        reading = [route for route in router.routes if getattr(route, "body_field", None)]
        assert reading
        assert all(isinstance(route, BoundedRoute) for route in reading)


@pytest.mark.parametrize(
    ("given", "status"),
    [("bytes=999999999-", 416), ("bytes=x-y", 400), ("chars=0-1", 400), ("bytes=5-2", 400)],
)
def test_ranges_that_are_none_are_problem_details(given: str, status: int) -> None:
    refused = answer_to("GET", "/file", headers={"Range": given})
    assert (refused.status_code, refused.json()["status"]) == (status, status)
    assert refused.headers["content-type"] == "application/problem+json"
    assert ("content-range" in refused.headers) == (status == 416)
    assert refused.json()["detail"].startswith("Range: expected")
    assert answer_to("GET", "/file", headers={"Range": "bytes=0-2"}).content == b'"""'


def test_the_queue_keeps_its_length_however_many_submit_at_once(tmp_path: Path) -> None:
    store, outcomes, start = Store(tmp_path), list[str](), threading.Barrier(20)

    def submit() -> None:
        start.wait()
        for _ in range(3):
            try:
                store.submit(NewJob(Kind.run, "many", ""), most_queued=25)
                outcomes.append("accepted")
            except QueueFullError:
                outcomes.append("full")

    threads = [threading.Thread(target=submit) for _ in range(20)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert (outcomes.count("accepted"), outcomes.count("full")) == (25, 35)
    assert store.counts()[State.queued] == 25 == len(list((tmp_path / "jobs").iterdir()))
    store.close()
    assert MOST_QUEUED == 100


def test_the_same_key_is_the_same_job_while_the_queue_is_full(tmp_path: Path) -> None:
    store = Store(tmp_path)
    first, _ = store.submit(NewJob(Kind.run, "one", ""), key="k", digest="d", most_queued=1)
    assert store.submit(NewJob(Kind.run, "one", ""), key="k", digest="d", most_queued=1) == (first, False)
    store.close()


@pytest.mark.parametrize("name", ["con.nc", "CON.txt", "nul", "com1.tar.gz", "Lpt9 .csv", "aux.tdms"])
def test_a_device_of_windows_is_no_name_of_a_recording(name: str) -> None:
    with pytest.raises(UsageError, match="a device on Windows"):
        stored_name(name)
    assert stored_name("console.txt") == "console.nc"


def test_bodies_that_arrive_slowly_hold_no_turn_of_an_import(tmp_path: Path) -> None:
    class Slow:
        async def stream(self) -> Any:
            await asyncio.sleep(3600.0)
            yield b""

    class Whole:
        async def stream(self) -> Any:
            yield b"all of it"

    async def take(uploads: Uploads, request: Any) -> int:
        async with uploads.received(request, "a.txt") as given, uploads.turn:
            return given.file.stat().st_size

    async def main() -> int:
        uploads = Uploads(tmp_path)
        slow = [asyncio.create_task(take(uploads, Slow())) for _ in range(8)]
        await asyncio.sleep(0)
        found = await asyncio.wait_for(take(uploads, Whole()), 20.0)
        for task in slow:
            task.cancel()
        await asyncio.gather(*slow, return_exceptions=True)
        return found

    assert asyncio.run(main()) == 9
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("machine", [2**30 * size for size in (4, 8, 16, 32, 64, 512)])
def test_all_imports_together_fit_into_the_memory_of_the_machine(machine: int) -> None:
    assert import_memory(machine) * imports_at_once(machine) <= machine

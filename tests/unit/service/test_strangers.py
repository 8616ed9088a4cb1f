"""Unauthenticated requests: refused by their heads, under names of this service alone, in few lines of the log."""

from __future__ import annotations

import asyncio
import json
import logging
from typing import Any

import httpx
import pytest
from fastapi import FastAPI

from vibroimpact.fmus.errors import UsageError
from vibroimpact.service import logs as module
from vibroimpact.service.hosts import Hosts
from vibroimpact.service.logs import MOST_ALIKE
from vibroimpact.service.security import Guarded
from vibroimpact.service.sessions import Sessions

app = FastAPI()


@app.get("/inside")
@app.get("/healthz")
def inside() -> str:
    return "inside"


def answer_to(path: str = "/inside", names: tuple[str, ...] = (), **headers: str) -> httpx.Response:
    guarded = Guarded(app, "secret", Sessions("secret"), Hosts("127.0.0.1", names))

    async def ask() -> httpx.Response:
        transport = httpx.ASGITransport(guarded)  # type: ignore[arg-type]
        async with httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1:8737") as client:
            return await client.get(path, headers={"Authorization": "Bearer secret"} | headers)

    return asyncio.run(ask())


@pytest.mark.parametrize(
    ("given", "status"),
    [
        ("Bearer secret", 200),
        ("bearer secret", 200),
        ("BEARER  secret", 200),
        ("Bearer Secret", 401),
        ("Basic secret", 401),
        ("secret", 401),
        ("Bearer secret secret", 401),
        ("Bearer", 401),
    ],
)
def test_the_scheme_of_the_token_is_taken_in_any_case_and_the_token_in_its_own(
    given: str, status: int
) -> None:
    assert answer_to(Authorization=given).status_code == status


@pytest.mark.parametrize(
    "host",
    ["127.0.0.1", "127.0.0.1:9999", "localhost:8737", "LOCALHOST", "[::1]:8737", "127.8.0.1", "Lab.Example."],
)
def test_the_service_is_asked_by_its_addresses_and_the_names_of_its_owner(host: str) -> None:
    assert answer_to(names=("lab.example",), Host=host).status_code == 200


@pytest.mark.parametrize("path", ["/inside", "/healthz"])
@pytest.mark.parametrize(
    "host",
    [
        "evil.example",
        "127.0.0.1.evil.example",
        "localhost.evil.example",
        "evil.localhost",
        "evillocalhost",
        "local",
        "192.0.2.7",
        "",
        "[::1",
        "x" * 9000,
    ],
)
def test_a_page_of_another_name_that_leads_here_is_not_answered(path: str, host: str) -> None:
    refused = answer_to(path, Host=host)
    assert refused.status_code == 421
    assert refused.headers["content-type"] == "application/problem+json"
    assert "--allow-host" in refused.json()["detail"]
    assert len(refused.content) < 500


def test_an_address_that_a_connection_came_to_is_a_name_of_a_service_for_all_addresses() -> None:
    hosts = Hosts("0.0.0.0")
    assert hosts.why_not(b"192.0.2.7:8737", "192.0.2.7") == ""
    assert hosts.why_not(b"192.0.2.7:8737", "::ffff:192.0.2.7") == ""
    assert "got '192.0.2.8'" in hosts.why_not(b"192.0.2.8:8737", "192.0.2.7")
    assert "got '0.0.0.0'" in hosts.why_not(b"0.0.0.0:8737", "192.0.2.7")
    assert hosts.why_not(None, "192.0.2.7") == "", "no browser leaves it out"


@pytest.mark.parametrize("name", ["", "http://lab.example", "lab.example:80", "a b", "-a", "*"])
def test_what_is_no_name_of_a_host_is_refused(name: str) -> None:
    with pytest.raises(UsageError, match=r"expected a name such as lab\.example, without port"):
        Hosts("127.0.0.1", [name])


def lines_of(*records: tuple[str, dict[str, Any], float]) -> list[dict[str, Any]]:
    """Return the log lines of messages with their facts, at given times."""
    written, seldom, form = [], module._RepeatFilter(), module._Lines()
    for message, facts, at in records:
        name = "vibroimpact.service" if facts else "uvicorn.error"
        record = logging.makeLogRecord(
            {"name": name, "msg": message, "created": at, "levelname": "INFO"} | facts
        )
        if seldom.filter(record):
            written.append(json.loads(form.format(record)))
    return written


def test_strangers_write_few_lines_into_the_log_and_none_of_a_job_is_lost() -> None:
    strange = ("request", {"alike": "request 401"}, 1.0)
    noise = ("Invalid HTTP request received.", dict[str, Any](), 1.0)
    found = lines_of(*[strange, noise, ("job", {"job": "a", "state": "done"}, 1.0)] * 1000)
    assert [line["event"] for line in found].count("job") == 1000
    assert len(found) == 1000 + 2 * MOST_ALIKE
    again = lines_of(*[strange] * 1000, ("request", {"alike": "request 401"}, 62.0))
    assert again[-1]["left_out"] == 1000 - MOST_ALIKE

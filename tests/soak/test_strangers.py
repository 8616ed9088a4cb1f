"""The kind `service_strangers` detects idle strangers, and a service that is slow, grows, logs or loses jobs."""

from __future__ import annotations

import itertools
import os
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from soak import service_strangers as kind
from soak._strangers import WAYS

STATUS = "/api/v1/campaigns/a"
TOKEN = "secret"


@dataclass
class Job:
    """A job with a status."""

    status: dict[str, Any] = field(default_factory=lambda: {"state": "done", "attempts": 1, "started": None})
    id: str = "a"

    def refresh(self) -> Job:
        """Return itself."""
        return self


class Service(ThreadingHTTPServer):
    """A service of two paths; `late` gives the delay of each answer, s."""

    daemon_threads = True

    def __init__(self, folder: Path) -> None:
        super().__init__(("127.0.0.1", 0), Answer)
        self.late: dict[str, float] = {}
        (folder / "token").write_text(TOKEN)
        self.folder, self.log = folder, folder / "log"
        self.url, self.process = f"http://127.0.0.1:{self.server_port}", SimpleNamespace(pid=os.getpid())


class Answer(BaseHTTPRequestHandler):
    """Answers as a service would."""

    server: Service

    def do_GET(self) -> None:
        """Answer, late where the test wants it."""
        time.sleep(self.server.late.get(self.path, 0.0))
        known = self.path == "/healthz" or self.headers["Authorization"] == f"Bearer {TOKEN}"
        self.send_response(200 if known else 401)
        self.end_headers()

    def log_message(self, *_: Any) -> None:
        """Write no log."""


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Service]:
    with Service(tmp_path) as served:
        thread = threading.Thread(target=served.serve_forever, args=(0.01,))
        thread.start()
        yield served
        served.shutdown()
        thread.join()


def watch(service: Service) -> kind.Watch:
    return kind.Watch(service, Job())  # type: ignore[arg-type]


def test_a_service_that_answers_has_no_problem(service: Service) -> None:
    watched = watch(service)
    assert watched.look() is None
    assert all(seconds > 0.0 for seconds in watched.slowest.values())


@pytest.mark.parametrize(("path", "name"), [("/healthz", "health"), (STATUS, "status")])
def test_one_late_answer_of_one_question_is_a_problem(
    service: Service, path: str, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kind, "ANSWER_SECONDS", 0.2)
    service.late = {path: 0.3}
    assert (watch(service).look() or "").startswith(f"{name}: an answer took 0.")


def test_a_refusal_and_silence_are_problems(service: Service, monkeypatch: pytest.MonkeyPatch) -> None:
    (service.folder / "token").write_text("another")
    assert (watch(service).look() or "").startswith("status: no answer")
    monkeypatch.setattr(kind, "PATIENCE_SECONDS", 0.1)
    service.late = {"/healthz": 0.3}
    assert "health: no answer in 0." in (watch(service).look() or "")


def test_memory_that_grew_and_was_given_back_is_a_problem(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    watched = watch(service)
    sizes = itertools.chain([2**31], itertools.repeat(0))
    used = SimpleNamespace(user=0.0, system=0.0)
    watched._process = SimpleNamespace(  # type: ignore[assignment]
        memory_info=lambda: SimpleNamespace(rss=next(sizes)), cpu_times=lambda: used
    )
    assert "its memory grew by" in (watched.look() or "")


@pytest.mark.parametrize(
    "status",
    [
        {"state": "failed", "attempts": 1},
        {"state": "done", "attempts": 2},
        {"state": "cancelled", "attempts": 1},
    ],
)
def test_a_job_that_is_not_done_at_once_is_lost(status: dict[str, Any]) -> None:
    assert kind.lost([Job()]) is None  # type: ignore[list-item]
    assert "lost" in (kind.lost([Job(), Job(status)]) or "")  # type: ignore[list-item]


def test_a_long_log_and_a_traceback_are_problems(tmp_path: Path) -> None:
    log = tmp_path / "log"
    for content, problem in [
        ("x\n", None),
        ("Traceback\n", "traceback"),
        ("x" * (kind.MOST_LOG + 1), "byte"),
    ]:
        log.write_text(content)
        found = kind.logged(log)
        assert (problem is None and found is None) or (problem or "-") in (found or "")


def test_a_case_in_which_nothing_was_tried_says_so(service: Service, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kind, "ATTACKED_SECONDS", 0.0)
    monkeypatch.setattr(kind, "strangers", lambda *_: nullcontext(counts))
    counts = [0] * len(WAYS)
    ended, waiting = Job(), Job({"state": "queued", "attempts": 1, "started": None})
    assert tried(service, ended, ended) == "no job waited when the strangers came"
    assert tried(service, ended, waiting) == "strangers opened no connection: idle"
    counts[0] = 1
    assert tried(service, ended, waiting) == "no job began while strangers were there"
    waiting.status["started"] = time.time() + 60.0
    assert tried(service, ended, waiting) is None


def tried(service: Service, *jobs: Job) -> str | None:
    return kind.attacked(service, jobs, ["idle"], 1)  # type: ignore[arg-type]


@pytest.mark.parametrize("way", WAYS)
def test_strangers_open_connections_in_each_way_and_end(way: str) -> None:
    with socket.create_server(("127.0.0.1", 0), backlog=4096) as silent:
        with kind.strangers(silent.getsockname(), [way], 1, 0.5) as opened:
            pass
        assert [name for name, count in zip(WAYS, opened, strict=True) if count] == [way]


def test_a_stranger_that_ends_in_an_error_is_a_problem_of_the_case() -> None:
    with (
        pytest.raises(RuntimeError, match=r"strangers ended with \[1, 1\]"),
        kind.strangers(("127.0.0.1", 1), ["nothing"], 1, 5.0),
    ):
        pass

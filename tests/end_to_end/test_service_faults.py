"""Faults around the service: connections are cut, disks are full, schedulers disappear."""

from __future__ import annotations

import json
import random
import socket
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import httpx
import psutil
import pytest
from support.served import SHORT, Cluster, Served, scene_file, sweep_text, until

import vibroimpact as vi
from vibroimpact.service.client import Service
from vibroimpact.service.remote import RemoteJob, ServiceError

pytestmark = pytest.mark.together("service")

LONG = sweep_text(120, 100_000)


class Cutter:
    """A proxy of a service that cuts each connection after a random number of bytes of its answers."""

    def __init__(self, url: str, seed: int) -> None:
        target = httpx.URL(url)
        self._place, self._chance = (target.host, target.port), random.Random(seed)
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self._listening.getsockname()[1]}"
        self.cuts = 0
        threading.Thread(target=self._accept, daemon=True).start()

    def close(self) -> None:
        self._listening.shutdown(socket.SHUT_RDWR)
        self._listening.close()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                near, _ = self._listening.accept()
                threading.Thread(target=self._serve, args=(near,), daemon=True).start()

    def _serve(self, near: socket.socket) -> None:
        left = self._chance.randint(500, 1500)
        with near, socket.create_connection(self._place) as far, suppress(OSError):
            threading.Thread(target=self._forward, args=(near, far), daemon=True).start()
            while left and (block := far.recv(min(left, 4096))):
                near.sendall(block)
                left -= len(block)
            self.cuts += not left
            near.shutdown(socket.SHUT_RDWR)
            far.shutdown(socket.SHUT_RDWR)

    @staticmethod
    def _forward(near: socket.socket, far: socket.socket) -> None:
        with suppress(OSError):
            while block := near.recv(4096):
                far.sendall(block)


def test_no_event_is_lost_or_doubled_where_connections_are_cut_at_random_bytes(
    served: Served, tmp_path: Path
) -> None:
    cutter = Cutter(served.url, seed=7)
    token = (served.folder / "token").read_text(encoding="utf-8").strip()
    try:
        with served.client() as service, Service(cutter.url, token) as cut:
            job = service.submit(scene_file(tmp_path, LONG), workers=1)
            # this request goes without cuts: only streams are resumed
            while_it_runs = list(RemoteJob(cut, job.status).events())
            seen = list(job.events())
            assert while_it_runs == seen
            for _ in range(4):
                assert list(RemoteJob(cut, job.status).events()) == seen
        assert cutter.cuts > 2
        assert seen[-1]["state"] == "done"
        assert seen[-1]["done"] == 120
    finally:
        cutter.close()


def test_any_number_of_silent_connections_stops_neither_answers_nor_jobs(
    served: Served, tmp_path: Path
) -> None:
    place, before = httpx.URL(served.url), served.log.stat().st_size
    with ExitStack() as kept, served.client() as service:
        job = service.submit(scene_file(tmp_path, SHORT), workers=1)
        for _ in range(700):
            kept.enter_context(socket.create_connection((place.host, place.port), 20.0))
        assert httpx.get(f"{served.url}/healthz", timeout=20.0).text == "ok\n"
        assert job.wait().status["attempts"] == 1
    assert served.log.stat().st_size - before < 5000


@contextmanager
def full(service: Served) -> Iterator[None]:
    """Prevent all processes of a service from writing into a file, as on a full disk, for the duration of the block."""
    resource = pytest.importorskip("resource", reason="limits of files are those of POSIX")
    if not hasattr(resource, "prlimit"):
        pytest.skip("only Linux changes the limits of a process from outside")

    def limit(most: int) -> None:
        parent = psutil.Process(service.process.pid)
        for process in (parent, *parent.children(recursive=True)):
            with suppress(ProcessLookupError):
                resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (most, resource.RLIM_INFINITY))

    limit(0)
    try:
        yield
    finally:
        limit(resource.RLIM_INFINITY)


def test_a_full_disk_is_one_answer_and_what_was_accepted_goes_on_when_there_is_room(tmp_path: Path) -> None:
    service, scene = Served(tmp_path / "service"), scene_file(tmp_path, LONG)
    try:
        with service.client() as client:
            job = client.submit(scene, workers=1)
            next(event for event in job.events() if event["done"] > 0)
            with full(service):
                for path, body in (
                    ("/campaigns", {"json": {"scene": SHORT}}),
                    ("/recordings?name=a.txt", {"content": b"0 1\n1 2\n"}),
                ):
                    with pytest.raises(ServiceError, match="expected room on the disk") as refused:
                        client.ask("POST", path, **body)
                    assert refused.value.status == 507
                assert job.refresh().status["state"] == "running"
                assert httpx.get(f"{service.url}/healthz").status_code == 200
                with pytest.raises(ServiceError, match="expected room"):
                    job.cancel()
            found = job.wait().dataset()
            assert [one.id for one in client.jobs()] == [job.id]
            assert client.submit(scene_file(tmp_path, SHORT), workers=1).wait().status["done"] == 40
        assert found.displacement_range.equals(vi.run(scene_file(tmp_path, LONG)).displacement_range)
    finally:
        service.stop()


@pytest.mark.long
def test_a_campaign_waits_for_a_scheduler_that_is_not_there_and_goes_on_when_it_is(tmp_path: Path) -> None:
    cluster = Cluster()
    service, scene = Served(tmp_path / "service", "--scheduler", cluster.address), scene_file(tmp_path, LONG)
    try:
        with service.client() as client:
            job = client.submit(scene)
            waits = next(one for one in job.events() if "waits for workers behind tcp://" in one["message"])
            assert waits["state"] == "queued"
            with cluster:
                next(one for one in job.events(after=waits["id"]) if one["done"] > 0)
            with cluster:
                found = job.wait().dataset()
        assert found.displacement_range.equals(vi.run(scene).displacement_range)
    finally:
        service.stop()


def test_logs_are_lines_of_json_with_the_job_and_without_the_token(tmp_path: Path) -> None:
    service = Served(tmp_path / "service")
    token = (service.folder / "token").read_text(encoding="utf-8").strip()
    try:
        with service.client() as client:
            job = client.submit(scene_file(tmp_path, SHORT), workers=1).cancel()
            until(job, "cancelled")
        httpx.get(f"{service.url}/api/v1/campaigns", headers={"Authorization": f"Bearer {token}x"})
    finally:
        service.stop()
    log = service.log.read_text(encoding="utf-8")
    lines = [json.loads(line) for line in log.splitlines()]
    assert {line.get("state") for line in lines if line.get("job") == job.id} >= {"cancelled"}
    assert any(line["event"] == "request" and line["status"] == 401 for line in lines)
    assert token not in log

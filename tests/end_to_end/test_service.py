"""The service for its clients: real processes, killed, cancelled, with wrong requests."""

from __future__ import annotations

import os
import re
import shutil
import socket
import time
from pathlib import Path
from typing import Any

import httpx
import psutil
import pytest
from support.command_line import in_this_process
from support.places import EXAMPLES
from support.served import SHORT, Served, scene_file, sweep_text, until

import vibroimpact as vi
from vibroimpact.fmus.errors import UsageError
from vibroimpact.service.client import RemoteJob, Service, ServiceError

pytestmark = pytest.mark.together("service")

LONG = sweep_text(160, 100_000)
ENDLESS = """
[scene]
units = "nondimensional"
[body]
mass = 1.0
stiffness = 1.0
[forcing]
amplitude = 1.0
angular_frequency = 1.0
[[stop]]
position = 1e-300
restitution = 1.0
[[stop]]
position = -1e-300
side = "lower"
restitution = 1.0
[record]
transient_periods = 1000000000
recorded_periods = 1
[execution]
impact_limit = 1000000000000
"""


def processes_of(folder: Path) -> list[psutil.Process]:
    """Return the processes with a folder in their command, and their children."""
    found: list[psutil.Process] = []
    for process in psutil.process_iter():
        try:
            if "job_process" in " ".join(process.cmdline()) and str(folder) in " ".join(process.cmdline()):
                found += [process, *process.children(recursive=True)]
        except (psutil.NoSuchProcess, psutil.AccessDenied):
            continue
    return found


def test_a_campaign_of_the_service_is_that_of_the_command_line(served: Served, finished: RemoteJob) -> None:
    folder = served.folder / "jobs" / finished.id
    assert finished.status["done"] == finished.status["total"] == 40
    found, expected = finished.dataset(), vi.run(folder / "scene.toml")
    for name in ("displacement_range", "impact_time", "impact_velocity"):
        assert found[name].equals(expected[name]), name
    again = in_this_process("campaign", str(folder / "scene.toml"), "-o", str(folder / "campaign"))
    assert again.returncode == 0
    assert "Nothing to do" in again.stdout + again.stderr


def test_a_scene_without_a_sweep_is_one_run(served: Served, tmp_path: Path) -> None:
    with served.client() as service:
        job = service.submit(EXAMPLES / "single_run.toml").wait()
        assert job.status["kind"] == "run"
        assert job.dataset().sizes["sample"] > 1000


def test_a_service_that_is_killed_goes_on_where_it_was(tmp_path: Path) -> None:
    scene, folder = scene_file(tmp_path, LONG), tmp_path / "service"
    first = Served(folder)
    with first.client() as service:
        job = service.submit(scene, workers=2)
        for event in job.events():
            if event["done"] > 0:
                break
        seen = event["id"]
    first.kill()
    second = Served(folder)
    try:
        with second.client() as service:
            again = service.job(job.id)
            rest = list(again.events(after=seen))
            assert again.status["state"] == "done"
            identifiers = [one["id"] for one in rest]
            assert identifiers == sorted(set(identifiers))
            assert identifiers[0] > seen
            assert "restarted" in " ".join(one["message"] for one in rest)
            found = again.dataset()
    finally:
        second.stop()
    expected = vi.run(scene)
    for name in ("displacement_range", "impact_time"):
        assert found[name].equals(expected[name]), name
    assert not processes_of(folder)


def test_cancel_takes_effect_within_a_second_in_a_step_that_never_ends(
    served: Served, tmp_path: Path
) -> None:
    with served.client() as service:
        job = service.submit(scene_file(tmp_path, ENDLESS))
        until(job, "running")
        while not processes_of(served.folder):
            time.sleep(0.05)
        time.sleep(3.0)  # long before its step ends
        began = time.monotonic()
        job.cancel()
        until(job, "cancelled")
        assert time.monotonic() - began < 1.0
        assert not processes_of(served.folder)
        with pytest.raises(
            ServiceError, match="expected a campaign that waits or runs, got one that is cancelled"
        ):
            job.cancel()


def test_what_was_cancelled_is_resumed_and_deleted(served: Served, tmp_path: Path, raw: httpx.Client) -> None:
    with served.client() as service:
        job = service.submit(scene_file(tmp_path, LONG), workers=2)
        waiting = service.submit(scene_file(tmp_path, SHORT), workers=1).cancel()
        assert waiting.status["state"] == "cancelled"
        assert raw.get(f"/campaigns/{waiting.id}/dataset").status_code == 409
        for event in job.events():
            if event["done"] > 0:
                job.cancel()
                break
        until(job, "cancelled")
        assert raw.delete(f"/campaigns/{job.id}").status_code == 204
        assert not (served.folder / "jobs" / job.id).exists()
        waiting.resume().wait()
        assert waiting.status["done"] == 40


def test_a_job_whose_folder_is_gone_fails_and_the_queue_goes_on(served: Served, tmp_path: Path) -> None:
    with served.client() as service:
        first = service.submit(scene_file(tmp_path, sweep_text(300, 20_000)), workers=1)
        lost = service.submit(scene_file(tmp_path, SHORT), workers=1)
        shutil.rmtree(served.folder / "jobs" / lost.id)
        first.cancel()
        until(lost, "failed")
        assert "its folder cannot be used" in lost.status["message"]
        service.submit(scene_file(tmp_path, SHORT), workers=1).wait()


def test_a_campaign_whose_folder_somebody_has_removed_says_so_and_is_deleted(
    served: Served, raw: httpx.Client, tmp_path: Path
) -> None:
    with served.client() as service:
        job = service.submit(scene_file(tmp_path, SHORT), workers=1).wait()
    shutil.rmtree(served.folder / "jobs" / job.id)
    for what in ("dataset", "figure"):
        answer = raw.get(f"/campaigns/{job.id}/{what}")
        assert (answer.status_code, "somebody has removed it" in answer.text) == (409, True)
    assert raw.delete(f"/campaigns/{job.id}").status_code == 204
    assert raw.get(f"/campaigns/{job.id}").status_code == 404


def test_the_same_key_is_the_same_campaign_and_another_body_is_refused(raw: httpx.Client) -> None:
    header = {"Idempotency-Key": "mine"}
    first = raw.post("/campaigns", json={"scene": SHORT}, headers=header)
    second = raw.post("/campaigns", json={"scene": SHORT}, headers=header)
    other = raw.post("/campaigns", json={"scene": SHORT, "workers": 3}, headers=header)
    assert first.status_code == second.status_code == 202
    assert first.headers["location"] == second.headers["location"]
    assert other.status_code == 422
    assert "got that of another request" in other.json()["detail"]
    assert other.headers["content-type"] == "application/problem+json"
    raw.post(f"/campaigns/{first.json()['id']}/cancel")


def test_events_that_were_read_in_parts_are_those_read_at_once(finished: RemoteJob) -> None:
    whole = list(finished.events())
    parts: list[dict[str, Any]] = []
    while len(parts) < len(whole):
        parts.append(next(finished.events(after=parts[-1]["id"] if parts else 0)))
    assert parts == whole
    assert [one["state"] for one in whole][:2] == ["queued", "running"]
    assert whole[-1]["state"] == "done"


def test_lists_are_read_in_pages(raw: httpx.Client) -> None:
    names = [raw.post("/campaigns", json={"scene": SHORT, "workers": 1}).json()["id"] for _ in range(5)]
    found, cursor = [], None
    while len(found) < 5:
        page = raw.get(
            "/campaigns", params={"limit": 2, **({} if cursor is None else {"cursor": cursor})}
        ).json()
        found += [one["id"] for one in page["items"]]
        cursor = page["next"]
    assert found[:5] == names[::-1]
    for name in names:
        raw.post(f"/campaigns/{name}/cancel")
    assert raw.get("/campaigns", params={"cursor": "?!"}).status_code == 422


@pytest.mark.parametrize(
    ("text", "message", "line"),
    [
        ("[body]\nmass = -1", "expected a number > 0, got -1", 2),
        ("[body", "expected valid TOML", 1),
        ("\n[component.a]\nfmu = '/own/own.fmu'\n", "This service loads no FMU but those of the package", 3),
        (
            "\n\n[replay]\nrecordings = ['/etc/passwd']\n",
            "expected the name of a recording of this service",
            4,
        ),
    ],
)
def test_a_scene_with_problems_says_where_they_are(
    raw: httpx.Client, text: str, message: str, line: int
) -> None:
    refused = raw.post("/campaigns", json={"scene": text})
    assert refused.status_code == 422
    (first, *_) = refused.json()["problems"]
    assert message in first["message"]
    assert first["line"] == line
    assert raw.post("/scenes/validate", json={"scene": text}).json()["problems"][0] == first


def test_nobody_without_the_token_is_answered(served: Served, raw: httpx.Client) -> None:
    assert httpx.get(f"{served.url}/healthz").text == "ok\n"
    for path in ("/api/v1/campaigns", "/api/v1/openapi.json", "/metrics", "/anything"):
        for headers in ({}, {"Authorization": "Bearer wrong"}, {"Authorization": "Basic eDp5"}):
            refused = httpx.get(f"{served.url}{path}", headers=headers)
            assert refused.status_code == 401, path
            assert refused.headers["x-frame-options"] == "DENY"
    with Service(served.url, "wrong") as stranger, pytest.raises(ServiceError, match="expected Bearer"):
        stranger.job("x")
    assert oct((served.folder / "token").stat().st_mode)[-3:] == "600"
    assert raw.post("/campaigns", content=b"x" * 5_000_000).status_code == 413


def test_results_are_drawn_and_ranges_of_them_answered(
    raw: httpx.Client, served: Served, finished: RemoteJob
) -> None:
    job = finished
    figure = raw.get(f"/campaigns/{job.id}/figure", params={"format": "svg"})
    assert figure.headers["content-type"].startswith("image/svg+xml")
    assert b"<svg" in figure.content
    assert raw.get(f"/campaigns/{job.id}/figure", params={"kind": "nothing"}).status_code == 422
    part = raw.get(f"/campaigns/{job.id}/dataset", headers={"Range": "bytes=0-7"})
    assert part.status_code == 206
    assert part.content == b"\x89HDF\r\n\x1a\n"
    assert "attempt 1" in raw.get(f"/campaigns/{job.id}/log").text
    assert raw.get(f"/campaigns/{job.id}/scene").text == SHORT
    metrics = raw.get(f"{served.url}/metrics").text
    assert re.search(r'vibroimpact_jobs\{state="done"\} [1-9]', metrics)
    assert re.search(r'vibroimpact_outcomes\{outcome="ok"\} [1-9]', metrics)
    assert raw.get("/fmus/Oscillator").content[:2] == b"PK"


def test_misuse_of_serve_is_one_error(served: Served, tmp_path: Path) -> None:
    def refused(*options: str) -> str:
        done = in_this_process("serve", *options)
        assert done.returncode == 2
        return done.stderr

    assert "got one in which another service is running" in refused(
        "--data", str(served.folder), "--port", "0"
    )
    port = served.url.rpartition(":")[2]
    assert "expected a free port" in refused("--data", str(tmp_path / "other"), "--port", port)
    assert "whoever reaches it" in refused("--data", str(tmp_path / "other"), "--host", "0.0.0.0")
    assert "with other things in it" in refused("--data", str(tmp_path))
    open_token = tmp_path / "open"
    open_token.mkdir()
    (open_token / "service.sqlite").touch()
    (open_token / "token").write_text("known to all\n", encoding="utf-8")
    os.chmod(open_token / "token", 0o644)
    assert "only you can read" in refused("--data", str(open_token), "--port", "0")


def test_a_client_without_a_service_or_a_token_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("VIBROIMPACT_TOKEN", raising=False)
    with pytest.raises(UsageError, match="expected the token of the service"):
        Service()
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        url = f"http://127.0.0.1:{free.getsockname()[1]}"
    with Service(url, "token") as service, pytest.raises(ServiceError, match="a service that answers"):
        service.job("x")


def test_a_client_finds_the_address_of_a_service_in_its_folder(
    served: Served, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.delenv("VIBROIMPACT_SERVICE", raising=False)
    assert (served.folder / "url").read_text(encoding="utf-8") == f"{served.url}\n"
    done = in_this_process("status", "--data", str(served.folder))
    assert done.returncode == 0, done.stderr
    with Service(folder=served.folder) as service:
        list(service.jobs())
    (tmp_path / "token").write_text("token", encoding="ascii")
    (tmp_path / "url").write_bytes(b"\xff")
    with pytest.raises(UsageError, match="expected the address of a service"):
        Service(folder=tmp_path)


def test_the_commands_of_the_client(served: Served, tmp_path: Path) -> None:
    scene = scene_file(tmp_path, SHORT)
    where = ("--service", served.url, "--data", str(served.folder))
    submitted = in_this_process("submit", str(scene), *where, "--workers", "1", "--wait")
    assert submitted.returncode == 0, submitted.stdout
    name = re.search(r"[0-9a-f]{32}", submitted.stdout)
    assert name
    status = in_this_process("status", name[0], *where)
    assert "done  40 of 40 points  short sweep" in status.stdout
    target = tmp_path / "fetched.nc"
    assert in_this_process("fetch", name[0], "-o", str(target), *where).returncode == 0
    with vi.open_dataset(target) as found:
        assert found.sizes["angular_frequency"] == 40
    bad = in_this_process("submit", str(scene_file(tmp_path, "[body]\nmass = -1")), *where)
    assert bad.returncode == 2
    assert "line 2: body.mass: expected a number > 0, got -1" in bad.stderr
    assert in_this_process("cancel", name[0], *where).returncode == 2

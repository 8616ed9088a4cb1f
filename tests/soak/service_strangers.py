"""Strangers without the token at the port of a service: others are answered within a second, and no job is lost."""

from __future__ import annotations

import multiprocessing
import random
import time
from pathlib import Path

import httpx
import psutil
from support.served import Served, scene_file, sweep_text

from soak._strangers import WAYS, attack
from vibroimpact.service.client import RemoteJob, ServiceError

CASES = 20
SAMPLE = 1
SECONDS = 300.0
JOBS = 3
POINTS, TRANSIENT = 60, 20_000
ATTACKERS = 2
ATTACKED_SECONDS = 12.0
ANSWER_SECONDS = 1.0
"""In which health and an authorised status are answered, s, on two cores."""
MOST_GROWTH = 200 * 2**20
"""Of the memory of the service, byte."""
MOST_LOG = 2**20
"""Of the log of the service, byte."""
WAIT_SECONDS = 120.0


def check(seed: int) -> str | None:
    """Serve jobs while strangers do what they can."""
    chance = random.Random(seed)
    ways = chance.sample(sorted(WAYS), chance.randint(1, len(WAYS)))
    served = Served(Path("service").absolute())
    try:
        with served.client() as service:
            scene = scene_file(Path.cwd(), sweep_text(POINTS, TRANSIENT))
            jobs = [service.submit(scene, workers=1) for _ in range(JOBS)]
            problem = _attacked(served, jobs[0], ways, seed) or _lost(jobs)
    finally:
        served.stop()
    size = served.log.stat().st_size
    if problem is None and size > MOST_LOG:
        problem = f"the log has {size} byte"
    if problem is None and "Traceback" in served.log.read_text(encoding="utf-8"):
        problem = "the log has a traceback"
    return problem and f"{ways}: {problem}"


def _attacked(served: Served, job: RemoteJob, ways: list[str], seed: int) -> str | None:
    url, process = httpx.URL(served.url), psutil.Process(served.process.pid)
    before, slowest = process.memory_info().rss, 0.0
    forked = multiprocessing.get_context("fork")
    place = (url.host, url.port or 0)
    attackers = [
        forked.Process(target=attack, args=(place, ways[one:] + ways[:one], seed + one, ATTACKED_SECONDS))
        for one in range(ATTACKERS)
    ]
    for attacker in attackers:
        attacker.start()
    try:
        end = time.monotonic() + ATTACKED_SECONDS
        while time.monotonic() < end:
            began = time.monotonic()
            try:
                httpx.get(f"{served.url}/healthz", timeout=10.0).raise_for_status()
                job.refresh()
            except (httpx.HTTPError, ServiceError) as error:
                return f"no answer after {time.monotonic() - began:.1f} s: {error!r}"
            slowest = max(slowest, (time.monotonic() - began) / 2.0)
            time.sleep(0.2)
    finally:
        for attacker in attackers:
            attacker.join(ATTACKED_SECONDS)
            attacker.kill()
    growth = process.memory_info().rss - before
    if slowest > ANSWER_SECONDS:
        return f"an answer took {slowest:.1f} s"
    return f"its memory grew by {growth >> 20} MB" if growth > MOST_GROWTH else None


def _lost(jobs: list[RemoteJob]) -> str | None:
    end = time.monotonic() + WAIT_SECONDS
    while any(job.refresh().status["state"] in ("queued", "running") for job in jobs):
        if time.monotonic() > end:
            return f"had not ended after {WAIT_SECONDS:.0f} s: {[job.status['state'] for job in jobs]}"
        time.sleep(0.2)
    lost = [job.status for job in jobs if job.status["state"] != "done" or job.status["attempts"] != 1]
    return f"lost: {lost}" if lost else None

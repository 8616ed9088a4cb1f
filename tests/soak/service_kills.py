"""A service, its jobs and a scheduler, killed at random moments: accepted jobs end bit for bit as undisturbed."""

from __future__ import annotations

import random
import time
from functools import lru_cache
from pathlib import Path

import psutil
from support.served import Cluster, Served, sweep_text

import vibroimpact as vi
from soak.kills import Content, content, difference
from vibroimpact.service.client import ServiceError

CASES = 20
SAMPLE = 0
SECONDS = 300.0
WAIT_SECONDS = 120.0
POINTS = {"independent": 240, "up-down": 120}
TRANSIENT = 20_000
"""Forcing periods before the recording: a point takes some ten milliseconds."""
MOST_KILLS = 4
SCHEDULED = 0.3
"""Share of the cases whose workers belong to a scheduler, which is killed too."""


def check(seed: int) -> str | None:
    """Submit, kill, start again, and compare with an undisturbed campaign."""
    chance = random.Random(seed)
    path = chance.choice(sorted(POINTS))
    return disturbed(chance, path, POINTS[path], TRANSIENT)


def disturbed(chance: random.Random, path: str, points: int, transient: int) -> str | None:
    """Disturb a service with a sweep of `points` points, each after `transient` periods."""
    expected = _undisturbed(path, points, transient)
    scene, folder = Path("scene.toml"), Path("service").absolute()
    scene.write_text(sweep_text(points, transient, path))
    if chance.random() < SCHEDULED:
        with Cluster() as cluster:
            return _disturbed(chance, scene, folder, expected, cluster)
    return _disturbed(chance, scene, folder, expected, None)


def _disturbed(
    chance: random.Random, scene: Path, folder: Path, expected: Content, cluster: Cluster | None
) -> str | None:
    options = () if cluster is None else ("--scheduler", cluster.address)
    served = Served(folder, *options)
    try:
        with served.client() as service:
            name = service.submit(scene, workers=None if cluster else 2).id
        for _ in range(chance.randint(1, MOST_KILLS)):
            time.sleep(chance.expovariate(0.5))
            if chance.random() < 0.5:
                served.kill()
                served = Served(folder, *options)
            elif cluster is not None and chance.random() < 0.5:
                cluster.__exit__()
                time.sleep(chance.expovariate(0.5))
                cluster.__enter__()
            elif victims := _descendants(served.process.pid):
                _kill(chance.choice(victims))
        return _end_of(served, name, folder, expected)
    finally:
        served.stop()


def _end_of(served: Served, name: str, folder: Path, expected: Content) -> str | None:
    with served.client() as service:
        job, end = service.job(name), time.monotonic() + WAIT_SECONDS
        while job.status["state"] in ("queued", "running"):
            if time.monotonic() > end:
                return f"had not ended after {WAIT_SECONDS:.0f} s: {job.status}"
            time.sleep(0.2)
            try:
                job.refresh()
            except ServiceError as error:
                return f"the service does not answer: {error}"
        if job.status["state"] != "done":
            return f"{job.status}"
        numbers = [event["id"] for event in job.events()]
        if numbers != sorted(set(numbers)):
            return f"events are not each once and in order: {numbers}"
    return difference(expected, content(folder / "jobs" / name / "campaign" / "dataset.nc"))


@lru_cache(maxsize=2)
def _undisturbed(path: str, points: int, transient: int) -> Content:
    folder = Path(f"undisturbed-{path}")
    folder.mkdir()
    scene = folder / "scene.toml"
    scene.write_text(sweep_text(points, transient, path))
    vi.campaign(scene, folder / "campaign", workers=2, progress=False).close()
    return content(folder / "campaign" / "dataset.nc")


def _descendants(process: int) -> list[psutil.Process]:
    try:
        return psutil.Process(process).children(recursive=True)
    except psutil.Error:
        return []


def _kill(process: psutil.Process) -> None:
    try:
        process.kill()
    except psutil.Error:
        return  # it ended by itself

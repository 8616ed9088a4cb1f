"""Response time of the service during a campaign: 50 clients that each ask once a second; and its memory."""

from __future__ import annotations

import argparse
import csv
import os
import sys
import tempfile
import threading
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import httpx
import numpy as np
import psutil
from support.served import Served, sweep_text

GOAL_MILLISECONDS = 100.0
CLIENTS, SECONDS, REQUESTS = 50, 60.0, 10_000
CAMPAIGN = 1_000_000, 20_000
"""Points of the running campaign, and periods of each: it outlasts the clients."""
GOAL_GROWTH = 0.05
"""Largest growth of the memory of the service over all requests, relative."""


def ask(
    url: str, headers: dict[str, str], until: float, offset: float, waits: list[float], errors: list[str]
) -> None:
    """Ask once a second until a time; note the duration of each answer, s."""
    with httpx.Client(headers=headers, timeout=30.0) as client:
        time.sleep(offset)
        while time.monotonic() < until:
            began = time.perf_counter()
            answer = client.get(url)
            waits.append(time.perf_counter() - began)
            if answer.status_code != 200:
                errors.append(f"{answer.status_code}")
            time.sleep(max(0.0, 1.0 - waits[-1]))


def main() -> int:
    """Measure, print, write CSV; return 1 if a goal is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=SECONDS)
    parser.add_argument("--output", type=Path, default=Path("results/bench_service"))
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder, "scene.toml")
        scene.write_text(sweep_text(*CAMPAIGN), encoding="utf-8")
        served = Served(Path(folder, "service"))
        try:
            token = (served.folder / "token").read_text(encoding="utf-8").strip()
            headers = {"Authorization": f"Bearer {token}"}
            with served.client() as service:
                job = service.submit(scene, workers=os.cpu_count())
                while job.refresh().status["done"] == 0:
                    time.sleep(0.2)
                waits, errors = clients(f"{served.url}/api/v1/campaigns/{job.id}", headers, options.seconds)
                job.refresh()
                state, done = job.status["state"], job.status["done"]
                if state != "running":
                    raise RuntimeError(
                        f"bench_service: expected a campaign that still runs, got one that is {state}"
                    )
                job.cancel()
            growth, rate = memory(served, headers, REQUESTS)
        finally:
            served.stop()
    worst, median = float(np.percentile(waits, 95)), float(np.median(waits))
    print(
        f"{CLIENTS} clients, {len(waits)} answers in {options.seconds:g} s beside a campaign ({state}, {done} points): "
        f"{len(errors)} errors, median {1e3 * median:.1f} ms, 95 % within {1e3 * worst:.1f} ms "
        f"(goal {GOAL_MILLISECONDS:g}). {REQUESTS} requests, {rate:.0f} a second: memory {growth:+.1%}."
    )
    options.output.mkdir(parents=True, exist_ok=True)
    with (options.output / "bench_service.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        names = (
            "clients",
            "answers",
            "errors",
            "median_ms",
            "p95_ms",
            "memory_growth",
            "requests_per_second",
        )
        writer.writerow(names)
        figures = [1e3 * median, 1e3 * worst, growth, rate]
        writer.writerow([CLIENTS, len(waits), len(errors), *(f"{figure:.4g}" for figure in figures)])
    return int(bool(errors) or 1e3 * worst > GOAL_MILLISECONDS or growth > GOAL_GROWTH)


def clients(url: str, headers: dict[str, str], seconds: float) -> tuple[list[float], list[str]]:
    """Run all clients, spread over a second; return the duration of each answer, s, and the errors."""
    waits: list[float] = []
    errors: list[str] = []
    until = time.monotonic() + seconds
    threads = [
        threading.Thread(target=ask, args=(url, headers, until, k / CLIENTS, waits, errors))
        for k in range(CLIENTS)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return waits, errors


def memory(served: Served, headers: dict[str, str], requests: int) -> tuple[float, float]:
    """Return the relative growth of a service's memory over many requests, and its answers per second."""
    process = psutil.Process(served.process.pid)
    with httpx.Client(headers=headers, timeout=30.0, base_url=served.url) as client:
        for _ in range(requests // 10):
            client.get("/api/v1/campaigns")
        before, began = process.memory_info().rss, time.perf_counter()
        for _ in range(requests):
            client.get("/api/v1/campaigns")
        took = time.perf_counter() - began
    return process.memory_info().rss / before - 1.0, requests / took


if __name__ == "__main__":
    sys.exit(main())

"""Saturation of a campaign with many workers: up to 1,000 of them in one process, whose points sleep.

Schedule, client and scheduler are those of a campaign; a worker sleeps for the time of its points, and writes no part.
Up to 200 workers share this process and its interpreter lock, unlike workers on other machines: the rates are lower
bounds. The ideal rate is the number of workers over the seconds of a point. The processor time and the peak memory
are those of this process.

Run with `python tests/benchmarks/bench_scale.py [--output results/benchmarks]`, on a quiet machine.
"""

from __future__ import annotations

import argparse
import csv
import logging
import resource
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

import dask
import matplotlib
from distributed import Client, LocalCluster

import vibroimpact.orchestrator.campaign.workers.computation as computation
from vibroimpact.orchestrator.campaign.destination import ShardParts
from vibroimpact.orchestrator.campaign.schedule import ChunkSchedule
from vibroimpact.orchestrator.campaign.stores.seals import Seal
from vibroimpact.orchestrator.campaign.workers.chunks import Chunk, ChunkResult, Work
from vibroimpact.orchestrator.campaign.workers.cluster import QUIET
from vibroimpact.orchestrator.campaign.workers.pool import Cluster, WorkerPool
from vibroimpact.orchestrator.run.progress import Progress
from vibroimpact.orchestrator.scene import parse_scene
from vibroimpact.orchestrator.scene.sweep import Branch, SweepAxis, axis_of_range, expand

matplotlib.use("Agg")
WORKERS = (1, 2, 5, 10, 20, 50, 100, 200)
MANY_WORKERS = 1000
MANY_PROCESSES = 4
"""Number of processes of many workers, each a thread there; this process has client and scheduler alone."""
POINT_MILLISECONDS = (0.005, 1.0, 10.0, 100.0)
SECONDS, MANY_SECONDS = 10.0, 180.0
"""Duration of a measurement with ideal workers, and with many ideal workers, s."""
POINT_BYTES = 78
"""Size of the results of a point, bytes, which bounds the points of a chunk."""
MOST_ALONG_AN_AXIS = 10_000
"""Largest number of points along one of two axes."""
SATURATED = 0.8
"""Share of the ideal rate below which a campaign counts as saturated."""
SCENE = """
[scene]
units = "nondimensional"
[body]
mass = 1.0
stiffness = 1.0
[forcing]
amplitude = 0.5
angular_frequency = 0.8
[[stop]]
position = 1.0
restitution = 0.7
[record]
transient_periods = 10
recorded_periods = 2
[sweep]
"forcing.angular_frequency" = { start = 0.6, stop = 1.6, points = 2 }
"""

Rate = tuple[float, int, float]
"""Milliseconds of a point, workers, points per second."""


class Sleeper:
    """Replaces `run_chunk`: sleeps for the time of the points, and ends a chunk early where a worker would."""

    def __init__(self, point_seconds: float) -> None:
        self._seconds = point_seconds

    def __call__(self, work: Work, chunk: Chunk) -> ChunkResult:
        began = time.perf_counter()
        fitting = min(chunk.most_seconds / self._seconds, chunk.most_bytes / POINT_BYTES)
        count = min(chunk.count, max(1, int(fitting)))
        time.sleep(count * self._seconds)
        done = Chunk(chunk.branch, chunk.first, chunk.first + count, None, chunk.most_seconds)
        return ChunkResult(done, None, {"ok": count}, time.perf_counter() - began, POINT_BYTES * count)


@contextmanager
def sleeping_workers(number: int) -> Iterator[Cluster]:
    """Open workers that are threads of this process, or many workers that are threads of some others."""
    processes = number if number < MANY_WORKERS else MANY_PROCESSES
    with (
        LocalCluster(
            n_workers=processes,
            threads_per_worker=number // processes,
            processes=number >= MANY_WORKERS,
            dashboard_address="127.0.0.1:0",
            scheduler_kwargs={"dashboard": False},
            memory_limit=0,
            silence_logs=logging.CRITICAL,
        ) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        client.wait_for_workers(processes)
        yield Cluster(client, processes)


def sweep_of(points: int) -> Sequence[Branch]:
    """Return at least this many independent points; a scene would have 10^9 at most."""
    others = SweepAxis("forcing.amplitude", tuple(map(float, range(-(-points // MOST_ALONG_AN_AXIS)))))
    along = min(points, MOST_ALONG_AN_AXIS)
    axis = axis_of_range("forcing.angular_frequency", 0.6, 1.6, along, "independent")
    return expand(SimpleNamespace(sweep=(others, axis)))


def rate(number: int, point_seconds: float, seconds: float) -> float:
    """Return the points per second of `number` workers, which would take about `seconds`, s, if they were ideal."""
    branches = sweep_of(int(seconds * number / point_seconds))
    points = sum(len(branch.points) for branch in branches)
    scene = parse_scene(SCENE, "scale.toml")
    done = chunks = 0

    def take(result: ChunkResult) -> Sequence[ShardParts]:
        nonlocal done, chunks
        done, chunks = done + result.chunk.count, chunks + 1
        return ()

    def sealed(seal: Seal) -> None:
        raise AssertionError(f"a shard without a store: {seal}")

    with dask.config.set(QUIET), patch.object(computation, "run_chunk", Sleeper(point_seconds)):
        pool = WorkerPool(lambda: sleeping_workers(number), "this process", Progress())
        with pool.connection:
            pool.wait_for_workers()
            schedule = ChunkSchedule(branches, [], number)
            began, busy = time.perf_counter(), time.process_time()
            computation.Computation(pool, Work(scene, "", "", ""), schedule, take, sealed).run()
            spent = time.perf_counter() - began
            busy = time.process_time() - busy
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(
        f"points of {point_seconds * 1e3:g} ms, {number} workers: {points / spent:.0f} points/s, "
        f"{points * point_seconds / spent / number:.0%} of the ideal; {chunks} chunks, {busy / chunks * 1e3:.1f} ms of "
        f"processor each, {memory:.0f} MB",
        flush=True,
    )
    if done != points:
        raise AssertionError(f"{done} points of {points}")
    return points / spent


def draw(rates: Sequence[Rate], path: Path) -> None:
    """Draw rates over workers, each with its ideal."""
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(6, 4))
    for milliseconds in POINT_MILLISECONDS:
        of = [(number, found) for point, number, found in rates if point == milliseconds]
        (line,) = axes.loglog(*zip(*of, strict=True), "o-", label=f"points of {milliseconds:g} ms")
        ideal = [1e3 / milliseconds * number for number, _ in of]
        axes.loglog([number for number, _ in of], ideal, ":", color=line.get_color())
    axes.set(xlabel="workers", ylabel="points per second", title="dotted: ideal")
    axes.legend(loc="lower right", fontsize="small")
    axes.grid(alpha=0.3)
    figure.tight_layout()
    figure.savefig(path, dpi=120)
    plt.close(figure)


def sentence(rates: Sequence[Rate]) -> str:
    """Return the share of the ideal at the most workers, and the saturation of each kind of point, in words."""
    said = []
    for milliseconds in POINT_MILLISECONDS:
        of = [
            (number, found * milliseconds / 1e3 / number)
            for point, number, found in rates
            if point == milliseconds
        ]
        below = [number for number, part in of if part < SATURATED]
        where = (
            f"below {SATURATED:.0%} from {below[0]} workers on" if below else f"nowhere below {SATURATED:.0%}"
        )
        said.append(
            f"points of {milliseconds:g} ms: {of[-1][1]:.0%} of the ideal with {of[-1][0]} workers, {where}"
        )
    return "; ".join(said) + "."


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, write a table and a figure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("results", "benchmarks"))
    parser.add_argument("--workers", type=int, nargs="*", default=WORKERS)
    options = parser.parse_args(arguments)
    options.output.mkdir(parents=True, exist_ok=True)
    rates: list[Rate] = []
    runs = [(each, number, SECONDS) for each in POINT_MILLISECONDS for number in options.workers]
    runs += [(POINT_MILLISECONDS[0], MANY_WORKERS, MANY_SECONDS)]
    for milliseconds, number, seconds in runs:
        rates.append((milliseconds, number, rate(number, milliseconds / 1e3, seconds)))
    with (options.output / "bench_scale.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(("point_ms", "workers", "points_per_second"))
        writer.writerows(rates)
    draw(rates, options.output / "bench_scale.png")
    print(sentence(rates))
    return 0


if __name__ == "__main__":
    sys.exit(main())

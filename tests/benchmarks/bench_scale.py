"""Saturation of a campaign with many workers: up to 200 of them in one process, whose points sleep.

Schedule, client and scheduler are those of a campaign; a worker sleeps for the time of its points, and writes no part.
All share this process and its interpreter lock, unlike workers on other machines: the rates are lower bounds. The ideal
rate is the number of workers over the seconds of a point.

Run with `python tests/benchmarks/bench_scale.py [--output results/benchmarks]`, on a quiet machine.
"""

from __future__ import annotations

import argparse
import csv
import logging
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from unittest.mock import patch

import dask
import matplotlib
from distributed import Client, LocalCluster

import vibroimpact.orchestrator.campaign.computation as computation
from vibroimpact.orchestrator.campaign.chunks import Chunk, ChunkResult, Work
from vibroimpact.orchestrator.campaign.cluster import QUIET
from vibroimpact.orchestrator.campaign.pool import Cluster, WorkerPool
from vibroimpact.orchestrator.campaign.schedule import ChunkSchedule
from vibroimpact.orchestrator.run.progress import Progress
from vibroimpact.orchestrator.scene import parse_scene
from vibroimpact.orchestrator.scene.sweep import expand

matplotlib.use("Agg")
WORKERS = (1, 2, 5, 10, 20, 50, 100, 200)
POINT_MILLISECONDS = (1.0, 10.0, 100.0)
SECONDS = 3.0
"""Duration of a measurement with ideal workers, s."""
MOST_POINTS = 400_000
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
"forcing.angular_frequency" = {{ start = 0.6, stop = 1.6, points = {points} }}
"""

Rate = tuple[float, int, float]
"""Milliseconds of a point, workers, points per second."""


class Sleeper:
    """Replaces `run_chunk`: sleeps for the time of the points, and ends a chunk early where a worker would."""

    def __init__(self, point_seconds: float) -> None:
        self._seconds = point_seconds

    def __call__(self, work: Work, chunk: Chunk) -> ChunkResult:
        began = time.perf_counter()
        count = min(chunk.count, max(1, int(chunk.most_seconds / self._seconds)))
        time.sleep(count * self._seconds)
        done = Chunk(chunk.branch, chunk.first, chunk.first + count, None, chunk.most_seconds)
        return ChunkResult(done, None, {"ok": count}, time.perf_counter() - began)


@contextmanager
def workers_of_this_process(number: int) -> Iterator[Cluster]:
    """Open workers that are threads of this process."""
    with (
        LocalCluster(
            n_workers=number,
            threads_per_worker=1,
            processes=False,
            dashboard_address="127.0.0.1:0",
            scheduler_kwargs={"dashboard": False},
            memory_limit=0,
            silence_logs=logging.CRITICAL,
        ) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        client.wait_for_workers(number)
        yield Cluster(client, number)


def rate(number: int, point_seconds: float) -> float:
    """Return the points per second of `number` workers."""
    points = min(int(SECONDS * number / point_seconds), MOST_POINTS)
    scene = parse_scene(SCENE.format(points=points), "scale.toml")
    done = 0

    def take(result: ChunkResult) -> None:
        nonlocal done
        done += result.chunk.count

    with dask.config.set(QUIET), patch.object(computation, "run_chunk", Sleeper(point_seconds)):
        pool = WorkerPool(lambda: workers_of_this_process(number), "this process", Progress())
        with pool.connection:
            pool.wait_for_workers()
            schedule = ChunkSchedule(expand(scene), [], number)
            began = time.perf_counter()
            computation.Computation(pool, Work(scene, "", "", ""), schedule, take).run()
            seconds = time.perf_counter() - began
    if done != points:
        raise AssertionError(f"{done} points of {points}")
    return points / seconds


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
    axes.legend()
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
    options = parser.parse_args(arguments)
    options.output.mkdir(parents=True, exist_ok=True)
    rates: list[Rate] = []
    for milliseconds in POINT_MILLISECONDS:
        for number in WORKERS:
            rates.append((milliseconds, number, rate(number, milliseconds / 1e3)))
            print(f"points of {milliseconds:g} ms, {number} workers: {rates[-1][2]:.0f} points/s", flush=True)
    with (options.output / "bench_scale.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(("point_ms", "workers", "points_per_second"))
        writer.writerows(rates)
    draw(rates, options.output / "bench_scale.png")
    print(sentence(rates))
    return 0


if __name__ == "__main__":
    sys.exit(main())

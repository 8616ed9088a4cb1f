"""Cost of a Dask campaign over two bare processes that run the same chunks.

Each repetition times, one after the other and in alternating order:

- `campaign`: `run_campaign` with two workers, from the first chunk handed out to the last one done. Start and
  stop of the cluster and the compaction are excluded: they happen once, however long the sweep.
- `bare`: two processes that take the very chunks of that campaign from a shared counter, without Dask, network or
  resume. They write their parts in the same way. Timed from a common start to the last chunk done.
- `points`: two processes that only run the points and store nothing.

Run with `python tests/benchmarks/bench_dask.py [--points 20000] [--repetitions 5]`, on a quiet machine: other
programs slow down one of the three at a time.
"""

from __future__ import annotations

import argparse
import multiprocessing
import statistics
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from vibroimpact.orchestrator.campaign import CampaignReport, run_campaign
from vibroimpact.orchestrator.campaign.workers.chunks import (
    Chunk,
    Work,
    get_ready,
    points_of,
    run_chunk,
)
from vibroimpact.orchestrator.run import named_runner
from vibroimpact.orchestrator.scene import Scene, parse_scene
from vibroimpact.orchestrator.scene.sweep import expand

WORKERS = 2
LONGEST_SECONDS = 600.0
"""Time after which the bare processes count as dead, s."""

SCENE = """
[scene]
title = "impact oscillator, thesis figure 3.3"
units = "nondimensional"
[body]
mass = 1.0
stiffness = 1.0
damping_ratio = 0.05
[forcing]
amplitude = 0.5
angular_frequency = 0.8
[[stop]]
position = 1.0
restitution = 0.7
[record]
transient_periods = {transient}
recorded_periods = 20
[sweep]
"forcing.angular_frequency" = {{ start = 0.6, stop = 1.6, points = {points} }}
"""

Task = Callable[[Chunk], object]


def bare_seconds(work: Work, chunks: Sequence[Chunk], *, write: bool) -> float:
    """Return the time of two bare processes for the chunks, s."""
    context = multiprocessing.get_context("spawn")
    barrier, counter, results = context.Barrier(WORKERS), context.Value("i", 0), context.Queue()
    processes = [
        context.Process(target=_bare_process, args=(work, chunks, write, barrier, counter, results))
        for _ in range(WORKERS)
    ]
    for process in processes:
        process.start()
    spans = [results.get(timeout=LONGEST_SECONDS) for _ in processes]
    for process in processes:
        process.join()
    return float(max(end for _, end in spans) - min(begin for begin, _ in spans))


def _bare_process(
    work: Work, chunks: Sequence[Chunk], write: bool, barrier: Any, counter: Any, results: Any
) -> None:
    get_ready(work)
    task: Task = (lambda chunk: run_chunk(work, chunk)) if write else _points_only(work)
    barrier.wait()
    begin = time.time()
    while True:
        with counter.get_lock():
            number = counter.value
            counter.value += 1
        if number >= len(chunks):
            break
        task(chunks[number])
    results.put((begin, time.time()))


def _points_only(work: Work) -> Task:
    branches, runner = expand(work.scene), named_runner(work.scene, work.runner)

    def run(chunk: Chunk) -> None:
        runner.rows(points_of(branches, chunk), chunk.start)

    return run


def one_repetition(scene: Scene, order: int) -> tuple[float, float, CampaignReport]:
    """Return the seconds of the bare processes, with parts and without, and the campaign's report."""
    with tempfile.TemporaryDirectory() as folder:
        report = run_campaign(scene, Path(folder, "campaign"), workers=WORKERS)
        parts = Path(folder, "parts")
        parts.mkdir()
        work = Work(scene, str(parts))
        kinds = (True, False) if order % 2 else (False, True)
        seconds = {write: bare_seconds(work, report.chunks, write=write) for write in kinds}
        return seconds[True], seconds[False], report


def figure(name: str, values: Sequence[float], unit: str = "") -> str:
    """Return one line of results: the median and the range."""
    return f"{name}: {statistics.median(values):.3g}{unit} ({min(values):.3g}..{max(values):.3g})"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--points", type=int, default=20_000)
    parser.add_argument("--repetitions", type=int, default=5)
    parser.add_argument(
        "--transient", type=int, default=2000, help="forcing periods before the recorded ones"
    )
    chosen = parser.parse_args()
    scene = parse_scene(SCENE.format(points=chosen.points, transient=chosen.transient), "bench.toml")
    ratios, overheads, compactions = [], [], []
    for repetition in range(chosen.repetitions):
        bare, points, report = one_repetition(scene, repetition)
        ratios.append(bare / report.compute_seconds)
        overheads.append(WORKERS * (report.compute_seconds - points) / chosen.points * 1e6)
        compactions.append(report.compaction_seconds / chosen.points * 1e6)
        print(
            f"  repetition {repetition + 1}: campaign {report.compute_seconds:.2f} s "
            f"in {len(report.chunks)} chunks, bare {bare:.2f} s, points only {points:.2f} s, "
            f"{WORKERS * points / chosen.points * 1e3:.2f} ms each",
            flush=True,
        )
    print(figure("dask/bare throughput, 2 workers, cluster start and compaction excluded", ratios))
    print(figure("overhead per point, part writing included", overheads, " us"))
    print(figure("compaction per point", compactions, " us"))


if __name__ == "__main__":
    main()

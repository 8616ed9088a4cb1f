"""Cost of a map of many points: overhead of a point, memory of client and workers, bytes, opening.

A map over frequency and amplitude of a forced oscillator with a rigid stop, 100 periods before 20 recorded ones.
Threads of this process compute it, or worker processes (`--workers 2`). For each number of points it prints

- `overhead`: wall time of the workers per point, us. It counts from the first chunk's start to the last one's end,
  without the time of the body (`point_seconds`);
- the processor time of this process, s, and of its ended children;
- the peak memory of the client (it holds threads, or Dask's scheduler) and of the largest worker, MB;
- the size of the dataset per point, and its opening time in a process that has read it before.

Run with `python tests/benchmarks/bench_campaign.py [--points 10000 100000 1000000] [--impacts] [--workers 2]`.
"""

from __future__ import annotations

import argparse
import math
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from vibroimpact.analysis import open_dataset
from vibroimpact.orchestrator.campaign import run_campaign
from vibroimpact.orchestrator.campaign.workers.processors import processor_count
from vibroimpact.orchestrator.scene import Scene, parse_scene

OPENINGS = 5

SCENE = """
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
transient_periods = 100
recorded_periods = 20
strobe = false
each_period = false
impacts = {impacts}
[sweep]
"forcing.amplitude" = {{ start = 0.2, stop = 1.0, points = {amplitudes} }}
"forcing.angular_frequency" = {{ start = 0.6, stop = 1.6, points = {frequencies} }}
"""


def map_of(points: int, impacts: bool) -> Scene:
    """Return a map of about `points` points."""
    side = math.isqrt(points)
    text = SCENE.format(impacts=str(impacts).lower(), amplitudes=side, frequencies=points // side)
    return parse_scene(text, "map.toml")


def measured(points: int, impacts: bool, workers: int | None) -> None:
    """Run one campaign and print its costs."""
    scene = map_of(points, impacts)
    with tempfile.TemporaryDirectory() as folder:
        began = time.perf_counter()
        report = run_campaign(scene, Path(folder, "map"), workers=workers)
        wall = time.perf_counter() - began
        openings = []
        for _ in range(OPENINGS):
            began = time.perf_counter()
            open_dataset(report.dataset).close()
            openings.append(time.perf_counter() - began)
        with open_dataset(report.dataset) as opened:
            own = float(opened.point_seconds.sum())
        size = Path(report.dataset).stat().st_size
    client, largest = (
        resource.getrusage(who).ru_maxrss / 1024 for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    )
    overhead = ((workers or processor_count()) * report.compute_seconds - own) / report.runs
    print(
        f"{report.runs:>8} points: {wall:.1f} s, processor {sum(os.times()[:4]):.1f} s, computing "
        f"{report.compute_seconds:.1f} s, joining {report.compaction_seconds:.1f} s; "
        f"{own / report.runs * 1e6:.0f} us a point in the body, overhead {overhead * 1e6:.1f} us; "
        f"client {client:.0f} MB, largest worker {largest:.0f} MB; "
        f"{size / report.runs:.0f} bytes a point; opened in {statistics.median(openings) * 1e3:.0f} ms",
        flush=True,
    )


def main() -> None:
    """Measure each number of points in a process of its own, since memory is measured by its peak."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--points", type=int, nargs="+", default=[10_000, 100_000, 1_000_000])
    parser.add_argument("--impacts", action="store_true", help="keep the rows of impacts too")
    parser.add_argument("--workers", type=int, help="worker processes; threads of this process without it")
    chosen = parser.parse_args()
    if len(chosen.points) == 1:
        measured(chosen.points[0], chosen.impacts, chosen.workers)
        return
    for points in chosen.points:
        more = ["--impacts"] if chosen.impacts else []
        more += ["--workers", str(chosen.workers)] if chosen.workers else []
        subprocess.run([sys.executable, __file__, "--points", str(points), *more], check=True)


if __name__ == "__main__":
    main()

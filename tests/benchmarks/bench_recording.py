"""Cost of recording nothing, extremes, impacts or a time series; and calls and bytes of each example scene.

- Records: 4,000 periods of the motion of `examples/single_run.toml`, with each record in turns. The table has the
  processor time (median and range of repetitions) over that of the run which records nothing. A time series costs
  time for each sample: this time is printed too, at two rates.
- Points in lanes: the cost of a recorded period of P(1,1) through `vi.run`, by the slope between two record lengths.
- Examples: calls of FMU functions, and bytes of the dataset, of one point of each example scene. These counts are
  the same on each machine.

Run with `python tests/benchmarks/bench_recording.py [--repetitions 9]`.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

import vibroimpact as vi
from vibroimpact.fmus.errors import SceneError
from vibroimpact.fmus.safe_toml import parse_toml
from vibroimpact.orchestrator.run import open_runner
from vibroimpact.orchestrator.scene import Scene, load_scene
from vibroimpact.orchestrator.study.ways.way import CallCounter

EXAMPLES = Path(__file__).parents[2] / "examples"
PERIODS = 4_000
RECORDS: dict[str, dict[str, Any]] = {
    "nothing": {"impacts": False, "extrema": False, "strobe": False},
    "extremes": {"impacts": False, "extrema": True, "strobe": False},
    "impacts": {"impacts": True, "extrema": False, "strobe": False},
    "all three": {"impacts": True, "extrema": True, "strobe": True},
    "10 samples a period": {"impacts": False, "extrema": False, "strobe": False, "samples": 10},
    "40 samples a period": {"impacts": False, "extrema": False, "strobe": False, "samples": 40},
}
LANES = {
    "scene": {"units": "nondimensional"},
    "body": {"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.1},
    "forcing": {"amplitude": 0.5, "angular_frequency": 1.0},
    "stop": [{"position": 1.0, "restitution": 0.7}],
    "sweep": {"body.displacement_start": {"start": 0.2, "stop": 0.9, "points": 64}},
}
LENGTHS = (200, 2200)
"""Recorded periods of the two runs; their difference gives the slope."""


def scene_of(record: dict[str, Any]) -> Scene:
    """Return the scene with the given record."""
    document = parse_toml((EXAMPLES / "single_run.toml").read_text(encoding="utf-8"))
    keys = {name: value for name, value in record.items() if name != "samples"}
    document["record"] = {"transient_periods": 10, "recorded_periods": PERIODS, **keys}
    scene = Scene.from_dict(document)
    if "samples" not in record:
        return scene
    assert scene.period is not None
    series = {"variables": ["displacement"], "rate": record["samples"] / scene.period}
    return scene.with_values({"record.time_series": series})


def seconds_of_records(repetitions: int) -> dict[str, list[float]]:
    """Run all records in turns; return the processor times of each record, s."""
    runners = {name: open_runner(scene_of(record), "fused") for name, record in RECORDS.items()}
    found: dict[str, list[float]] = {name: [] for name in runners}
    for runner in runners.values():
        runner.run({})
    for _ in range(repetitions):
        for name, runner in runners.items():
            began = time.process_time()
            runner.run({})
            found[name].append(time.process_time() - began)
    for runner in runners.values():
        runner.close()
    return found


def slopes_in_lanes(repetitions: int) -> dict[str, float]:
    """Return the processor time of a recorded period of a point in lanes, us, for each set of records."""
    sets = {name: record for name, record in RECORDS.items() if "samples" not in record}
    sets["strobe"] = {**RECORDS["nothing"], "strobe": True}
    found: dict[str, list[float]] = {name: [] for name in sets}
    for _ in range(repetitions):
        for name, record in sets.items():
            seconds = []
            for periods in LENGTHS:
                lengths = {"transient_periods": 200, "recorded_periods": periods}
                scene = Scene.from_dict({**LANES, "record": {**lengths, **record}})
                began = time.process_time()
                vi.run(scene, progress=False)
                seconds.append(time.process_time() - began)
            found[name].append((seconds[1] - seconds[0]) / ((LENGTHS[1] - LENGTHS[0]) * 64))
    return {name: 1e6 * statistics.median(each) for name, each in found.items()}


def counts_of(path: Path, folder: Path) -> tuple[int, int]:
    """Return the calls of FMU functions and the bytes of the dataset for one point of a scene."""
    scene = load_scene(path).with_sweep({})
    counter = CallCounter()
    runner = open_runner(scene, scene.execution.how, wrap=lambda name: counter.wrap)
    counter.calls.clear()
    try:
        runner.run({})
    finally:
        runner.close()
    target = folder / "point.nc"
    vi.run(scene, target, progress=False)
    return sum(counter.calls.values()), target.stat().st_size


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--repetitions", type=int, default=9)
    repetitions = parser.parse_args().repetitions
    found = seconds_of_records(repetitions)
    bare = statistics.median(found["nothing"])
    print(
        f"{PERIODS} periods of single_run.toml, processor time over that without a record ({bare * 1e3:.2f} ms)"
    )
    for name, seconds in found.items():
        middle = statistics.median(seconds)
        line = f"  {name:20} {middle / bare:8.2f}  ({min(seconds) / bare:.2f} to {max(seconds) / bare:.2f})"
        samples = RECORDS[name].get("samples", 0) * PERIODS
        print(line + (f"  {(middle - bare) / samples * 1e6:.2f} us a sample" if samples else ""))
    print("A recorded period of P(1,1) in lanes, through vi.run, us")
    for name, slope in slopes_in_lanes(repetitions).items():
        print(f"  {name:20} {slope:8.3f}")
    print("One point of each example: calls of functions of FMUs, bytes of the dataset")
    with tempfile.TemporaryDirectory() as folder:
        for path in sorted(EXAMPLES.glob("*.toml")):
            try:
                scene = load_scene(path)
            except SceneError:
                print(f"  {path.name:24} (needs an FMU that is not there)")
                continue
            if not scene.is_one_body and scene.execution.guard:
                print(f"  {path.name:24} (in a process of its own, where nobody counts)")
                continue
            calls, size = counts_of(path, Path(folder))
            print(f"  {path.name:24} {calls:9d} {size:10d}")
    least, *others = (
        statistics.median(found[name]) for name in ("nothing", "extremes", "impacts", "all three")
    )
    held = "so it was" if least <= min(others) and others[-1] >= max(others) else "not within the noise"
    share = 100.0 * (others[-1] / bare - 1.0)
    print(f"Recording less costs less: {held}; all three records cost {share:.0f} % of the motion.")


if __name__ == "__main__":
    main()

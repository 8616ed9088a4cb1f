"""Adaptive sweeps against uniform sweeps with a step of their tolerance: jumps found, and points needed.

- Thesis figure 3.3, up and down, to 1e-5: adaptive from 51 and from 401 values each way, and uniform with 200,002
  points. Each jump of the uniform sweep is compared with the nearest bracket between the same two motions.
- A map over frequency and gap, from rest, to 0.002 and 0.004, and a uniform map of its finest cells with 328,833
  points. The counts are neighbours between which the motion jumps, and pairs with both points in the adaptive map.

The output is the table of jumps, the two pictures of docs/campaigns.md and a sentence for each. On two cores it takes
some eight minutes and 1 GB of memory; `--quick` makes steps and cells eight times as wide.

Run with `python tests/benchmarks/bench_adaptive.py [--output results/benchmarks] [--quick]`.
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import xarray as xr

import vibroimpact as vi
from vibroimpact.analysis.jumps import jumps_of

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tests"))

from support.borders import borders_found  # noqa: E402

FIGURE = ROOT / "examples" / "thesis" / "figure_3_3.toml"
KEY, GAP = "forcing.angular_frequency", "stop[1].position"
FIRST_VALUES = (51, 401)
"""Values each way in the first round of the adaptive sweeps."""
NEAR = 1e-4
"""Distance below which a bracket matches a jump of the uniform sweep: points of a path depend on its steps."""
RECORD = {"impacts": False, "extrema": True, "strobe": True}
MAP = {"transient_periods": 200, "recorded_periods": 20, **RECORD}


def timed(folder: Path, sweep: dict[str, Any], record: dict[str, Any]) -> tuple[xr.Dataset, int, float]:
    """Return the campaign of figure 3.3 over a sweep, its number of points, and its duration in s."""
    scene = vi.Scene.from_file(FIGURE)
    scene = scene.with_values({f"record.{name}": value for name, value in record.items()}).with_sweep(sweep)
    began = time.perf_counter()
    dataset = vi.campaign(scene, folder, workers=2, progress=False)
    return dataset, int((dataset["run_id"] >= 0).sum()), time.perf_counter() - began


def measure_figure(folder: Path, output: Path, step: float) -> None:
    """Compare the jumps of figure 3.3 by adaptive and by uniform sweeps."""
    axis = {"start": 0.6, "stop": 1.6, "path": "up-down"}
    whole, points, seconds = timed(folder / "uniform", {KEY: axis | {"points": round(1 / step) + 1}}, RECORD)
    uniform = jumps_of(whole)
    print(f"figure 3.3, uniform: {points} points in {seconds:.0f} s, {uniform.sizes['jump']} jumps")
    nearest = {}
    for count in FIRST_VALUES:
        adaptive = {KEY: axis | {"points": count, "adaptive": {"tolerance": step, "at_most": 5000}}}
        dataset, fewer, seconds = timed(folder / str(count), adaptive, {})
        found = jumps_of(dataset)
        distances = [_distance(uniform.isel(jump=place), found) for place in range(uniform.sizes["jump"])]
        nearest[f"begun with {count}"] = distances
        unseen = sum(not distance <= NEAR for distance in distances)
        print(
            f"  begun with {count} values: {fewer} points in {seconds:.1f} s, {points / fewer:.0f} times fewer; "
            f"{found.sizes['jump']} jumps no wider than {float((found.above - found.below).max()):.2g}; "
            f"{unseen} of the uniform sweep's have none within {NEAR:g}"
        )
    vi.figures.save(vi.draw(dataset), output / "figure_3_3_adaptive.png")
    with (output / "adaptive_jumps.csv").open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["direction", "below", "above", "periods", "impacts", *nearest])
        for place in range(uniform.sizes["jump"]):
            one = uniform.isel(jump=place)
            ends = [
                float(one.below),
                float(one.above),
                one.period.values.tolist(),
                one.impacts.values.tolist(),
            ]
            rows.writerow(
                [str(one.direction.values), *ends, *(f"{each[place]:.2g}" for each in nearest.values())]
            )


def _distance(jump: xr.Dataset, found: xr.Dataset) -> float:
    """Return the distance of a jump from the nearest bracket between the same two motions; NaN without one."""
    same = (found.direction == jump.direction) & (found.period == jump.period).all("side")
    same &= (found.impacts == jump.impacts).all("side")
    there = found.isel(jump=same.values)
    middles = 0.5 * (there.below + there.above).values
    return float(min(abs(middles - 0.5 * float(jump.below + jump.above)), default=math.nan))


def measure_map(folder: Path, output: Path, cuts: int) -> None:
    """Compare the borders of a map by two adaptive axes and by a uniform grid of the finest cells."""
    ends = {KEY: (0.6, 1.6, 21, 0.05), GAP: (0.2, 1.8, 17, 0.1)}
    coarse, fine = {}, {}
    for key, (start, stop, count, cell) in ends.items():
        finest = cell / 2**cuts
        coarse[key] = {
            "start": start,
            "stop": stop,
            "points": count,
            "adaptive": {"tolerance": 1.28 * finest, "at_most": 100_000},
        }
        fine[key] = {"start": start, "stop": stop, "points": (count - 1) * 2**cuts + 1}
    adaptive, fewer, seconds = timed(folder / "map", coarse, MAP)
    vi.figures.save(vi.draw(adaptive, "impacts-per-period"), output / "map_adaptive.png")
    print(f"map: {fewer} points in {seconds:.0f} s")
    uniform, points, seconds = timed(folder / "uniform_map", fine, MAP)
    found = borders_found(adaptive, uniform, cuts)
    print(
        f"  uniform: {points} points in {seconds:.0f} s, {points / fewer:.0f} times as many; "
        f"of {found.pairs} pairs of neighbours between which the motion jumps {found.bracketed} are bracketed, "
        f"{found.unseen} lie at islands that no first value sees, {found.missed} are missed"
    )


def main() -> None:
    """Measure, write the table and the pictures, and print the result."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, default=Path("results/benchmarks"))
    parser.add_argument("--quick", action="store_true", help="wider steps and cells")
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        measure_figure(Path(folder), options.output, 8e-5 if options.quick else 1e-5)
        measure_map(Path(folder), options.output, 2 if options.quick else 5)


if __name__ == "__main__":
    main()

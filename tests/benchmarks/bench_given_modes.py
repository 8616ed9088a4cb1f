"""Cost of given modes beside that of a beam with the same modes: an impact, and a campaign in lanes.

A clamped-free beam in units of its first mode is driven at its tip, and meets a rigid stop there. It has one impact in
each period, as in `bench_structure.py` (damping ratio .3). `kind = "modes"` has the same frequencies and shapes.
Points of the campaigns have a damping ratio of .05. Some of them chatter, and leave the lanes for the fused engine.

- An impact with its flight, fused, with 8 and 32 modes. Both bodies take turns.
- A campaign of 10^4 points over the place of the stop and the amplitude of the force, with 2 and 8 modes, in lanes.

Times are processor times of this process, the smallest of several repetitions.
Run with `python tests/benchmarks/bench_given_modes.py [--repetitions 5] [--output results/bench_given_modes]`.
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import vibroimpact as vi
from vibroimpact.analysis import open_dataset
from vibroimpact.fmus.core.modes import beam_modes
from vibroimpact.orchestrator.campaign import run_campaign
from vibroimpact.orchestrator.run.opening import open_runner
from vibroimpact.orchestrator.run.points import columns_of_points
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.sweep import expand

FREQUENCY, RESTITUTION = 0.9, 0.7
#: Damping ratios of the periodic motion with one impact a period, and of the campaigns, whose motions are of all kinds.
DAMPING, DAMPING_OF_MAPS = 0.3, 0.05
#: The stop, over the amplitude of the steady motion without it, for each number of modes.
GAPS = {8: 0.999, 32: 0.99999}
PERIODS, COUNTED = 4000, 20
#: Modes of the campaigns, points along each of both keys, and their ends over the amplitude without a stop.
IN_LANES, SIDE, PLACES, AMPLITUDES = (2, 8), 100, (0.98, 1.1), (0.9, 1.1)
#: Largest ratio of given modes to the beam: an impact, and a map. Points that leave the lanes run one by one on a
#: Structure, whose arrays the loop in C does not set.
MOST_RATIO, MOST_OF_MAPS = 1.1, 1.2
KINDS = ("beam", "modes")


def scene_of(kind: str, modes: int, place: float, record: dict[str, Any], *, is_map: bool = False) -> Scene:
    """Return the scene of a beam or of its modes, whose stop is at a share of the steady amplitude at the tip."""
    found = beam_modes("clamped_free", modes)
    xi = np.asarray(found.eigenvalues)
    damping = DAMPING_OF_MAPS if is_map else DAMPING
    natural, tip = (xi / xi[0]) ** 2, np.asarray(found.shapes([1.0]))[0]
    steady = abs((tip**2 / (natural**2 - FREQUENCY**2 + 2j * damping * natural * FREQUENCY)).sum())
    force: dict[str, Any] = {"amplitude": 1.0, "angular_frequency": FREQUENCY}
    stop: dict[str, Any] = {"position": place * float(steady), "restitution": RESTITUTION}
    body: dict[str, Any] = {"kind": kind, "damping_ratio": damping}
    if kind == "beam":
        body |= {
            "length": 1.0,
            "mass_per_length": 1.0,
            "flexural_rigidity": float(xi[0]) ** -4,
            "modes": modes,
        }
    else:
        body |= {"angular_frequencies": natural.tolist(), "shapes": {"tip": tip.tolist()}}
        force, stop = force | {"at": "body.tip"}, stop | {"at": "body.tip"}
    axes = {"stop[1].position": [share * float(steady) for share in PLACES], "forcing.amplitude": AMPLITUDES}
    sweep = {key: {"start": low, "stop": high, "points": SIDE} for key, (low, high) in axes.items()}
    document = {"body": body, "forcing": force, "stop": [stop], "record": record}
    return Scene.from_dict(document | ({"sweep": sweep} if is_map else {}))


def least_in_turns(runs: Mapping[str, Callable[[], object]], repetitions: int) -> dict[str, float]:
    """Return the smallest processor time of each run, s, after one that does not count."""
    best = dict.fromkeys(runs, math.inf)
    for turn in range(repetitions + 1):
        for name, run in runs.items():
            began = time.process_time()
            run()
            if turn:
                best[name] = min(best[name], time.process_time() - began)
    return best


def impacts(modes: int, repetitions: int) -> dict[str, float]:
    """Return the time of an impact of each body, fused, us."""
    record = {
        "transient_periods": PERIODS,
        "recorded_periods": COUNTED,
        "strobe": False,
        "each_period": False,
    }
    scenes = {kind: scene_of(kind, modes, GAPS[modes], record) for kind in KINDS}
    runs: dict[str, Callable[[], object]] = {}
    for kind, scene in scenes.items():
        runner, point = open_runner(scene, "fused"), columns_of_points(expand(scene), 0, 1)
        count = int(vi.run(scene, progress=False).impact_count)
        if count != COUNTED:
            raise AssertionError(f"expected {COUNTED} impacts in as many periods, got {count}.")
        runs[kind] = partial(runner.rows, point)
    times = least_in_turns(runs, repetitions)
    return {kind: 1e6 * seconds / (PERIODS + COUNTED) for kind, seconds in times.items()}


def campaigns(modes: int, repetitions: int) -> dict[str, float]:
    """Return the processor time of a point of a campaign of each body, us."""
    record = {"transient_periods": 100, "recorded_periods": 20, "strobe": False, "each_period": False}
    runs = {kind: partial(_campaign, scene_of(kind, modes, 1.0, record, is_map=True)) for kind in KINDS}
    return {kind: 1e6 * seconds / SIDE**2 for kind, seconds in least_in_turns(runs, repetitions).items()}


def _campaign(scene: Scene) -> None:
    """Run a campaign, which must go in lanes."""
    with tempfile.TemporaryDirectory() as folder:
        report = run_campaign(scene, Path(folder, "map"))
        with open_dataset(report.dataset) as opened:
            execution, impacts = opened.attrs["execution"], int(opened.impact_count.sum())
    if execution != "lanes" or impacts < SIDE**2:
        raise AssertionError(f"expected lanes and some impacts, got {execution} and {impacts}.")


def main() -> int:
    """Measure, print and write a CSV; return 1 if given modes cost more than their beam."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repetitions", type=int, default=5)
    parser.add_argument("--output", type=Path, default=Path("results/bench_given_modes"))
    options = parser.parse_args()
    rows = [
        (f"an impact, {modes} modes, us", impacts(modes, 4 * options.repetitions), MOST_RATIO)
        for modes in GAPS
    ]
    rows += [
        (f"a point of a campaign, {modes} modes, us", campaigns(modes, options.repetitions), MOST_OF_MAPS)
        for modes in IN_LANES
    ]
    missed = False
    for name, each, most in rows:
        ratio = each["modes"] / each["beam"]
        missed = missed or ratio > most
        print(
            f"{name:36} beam {each['beam']:8.2f}, given modes {each['modes']:8.2f}, ratio {ratio:.2f}, goal {most:g}"
        )
    options.output.mkdir(parents=True, exist_ok=True)
    with (options.output / "bench_given_modes.csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([("case", *KINDS), *((name, *each.values()) for name, each, _ in rows)])
    print(f"goals: {'missed' if missed else 'reached'}")
    return int(missed)


if __name__ == "__main__":
    sys.exit(main())

"""Cost of an impact between two bodies, and the energy error after 10^4 impacts.

Newton's cradle of five balls with restitution 1 swings until it has made the given number of impulses, in FMI 3.0 and
2.0. Two chains pound, and two masses on springs hit each other with a compliant law. The results are the processor
time for each impulse (or contact), and the relative change of the energy.

A ball in the cavity of an oscillator runs as one structure over 200 forcing periods. Its points run one after the
other, and at once in lanes. They start off the contacts, since lanes leave out points that touch. The results are the
processor times of a point.
Run with `python tests/benchmarks/bench_bodies_in_contact.py [--impacts 10000]`.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))
from support.pair_parts import PairRun, cradle, hit, pair, run_of
from support.places import EXAMPLES

from vibroimpact.orchestrator.run.opening import open_runner
from vibroimpact.orchestrator.run.points import columns_of_points
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.sweep import expand

#: Largest relative change of the energy.
MOST_CHANGE = 1e-12


def pounding_chains() -> PairRun:
    """Return two chains of three masses whose second masses hit each other."""
    chain: dict[str, Any] = {"masses": 3, "contact[1].mass_number": 2}
    lower = hit("lower", "Chain", **chain | {"velocity_start[3]": 1.0})
    upper = hit("upper", "Chain", **chain | {"mass[2]": 3.0, "displacement_start[2]": -0.5})
    return run_of([lower, upper], [pair("lower", "upper", clearance=0.51)])


def yielding_masses() -> PairRun:
    """Return two masses on springs with Hertz's law between them."""
    bodies = [hit("a", displacement_start=-1.0), hit("b", stiffness=3.0)]
    return run_of(bodies, [pair("a", "b", clearance=0.1, law="hertz", stiffness=1e5)])


#: Periods and points of the ball in a cavity, and the goals of the issue: ms a point, one by one and at once.
PERIODS, POINTS, MOST_MILLISECONDS = 200, 64, {"fused": 2.0, "lanes": 1.0}


def absorber(execution: str, repetitions: int = 5) -> float:
    """Return the processor time of a point of a ball in a cavity, ms; the least of several repetitions."""
    record = {"recorded_periods": PERIODS, "each_period": False}
    changes = {"body[1].displacement_start": 0.04, "record": record}
    scene = Scene.from_file(EXAMPLES / "impact_damper_cavity.toml").with_values(changes)
    count = POINTS if execution == "lanes" else 8
    scene = scene.with_sweep({"forcing.angular_frequency": {"start": 0.98, "stop": 1.02, "points": count}})
    points = columns_of_points(expand(scene), 0, count)
    with open_runner(scene, execution) as runner:
        times = []
        for _ in range(repetitions + 1):
            began = time.process_time()
            runner.rows(points)
            times.append(1e3 * (time.process_time() - began) / count)
    return min(times[1:])


def measure(name: str, make: Callable[[], PairRun], impacts: int) -> bool:
    """Run a system for a number of impacts; print the cost of each, and return whether the energy is conserved."""
    run = make()
    energy = run.energy()
    began = time.process_time()
    while len(run.events) < impacts:
        run.at(run.importer.time + 10.0)
    seconds = time.process_time() - began
    change = run.energy() / energy - 1.0
    count = len(run.events)
    run.importer.free()
    print(
        f"{name:22} {count:6d} impacts {1e6 * seconds / count:8.0f} us each, energy changed by {change:9.1e}"
    )
    return abs(change) <= MOST_CHANGE


def main() -> None:
    """Measure all systems."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--impacts", type=int, default=10_000)
    impacts = parser.parse_args().impacts
    kept = [
        measure("cradle, FMI 3.0", lambda: cradle({0: -0.1}), impacts),
        measure("cradle, FMI 2.0", lambda: cradle({0: -0.1}, version="2.0"), impacts),
        measure("chains that pound", pounding_chains, impacts // 10),
    ]
    measure("hertz, 30 steps", yielding_masses, impacts // 100)
    times = {execution: absorber(execution) for execution in MOST_MILLISECONDS}
    for execution, most in MOST_MILLISECONDS.items():
        print(
            f"ball in a cavity, {PERIODS} periods, {execution}: {times[execution]:.2f} ms a point, goal {most:g} ms"
        )
    if not all(kept):
        raise SystemExit(f"energy: expected a relative change of at most {MOST_CHANGE:g}, got a larger one.")
    print(f"Impacts with restitution 1 keep the energy to {MOST_CHANGE:g}.")


if __name__ == "__main__":
    main()

"""Cost of following orbits and finding basins, against the usual alternatives.

- A branch: P(1,1) of `examples/bifurcation.toml`, and of a clamped beam of 8 modes, with its bifurcations to rounding.
- Its period doubling by sweeps instead: runs of 20,000 periods. One sweep of 41 points after the other narrows the
  bracket down to 1e-8. A transient near the doubling dies out too slowly for a right answer.
- One orbit by `scipy.optimize.root` on a shooting function whose flight is `solve_ivp` with an event, and by Newton's
  method on the phases.
- Basins of 100 x 100 starts, and single runs of 1,064 periods that are classified.

Times are medians and ranges of repetitions in turns, processor time of one core (basins: wall time, two threads).
Run with `python tests/benchmarks/bench_orbits.py [--repetitions 5]`.
"""

from __future__ import annotations

import argparse
import math
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import root

import vibroimpact as vi
from vibroimpact.analysis.orbits import find_orbit
from vibroimpact.analysis.orbits.branch import Branch
from vibroimpact.analysis.study import whole
from vibroimpact.orchestrator.orbits.bodies import impacting_body
from vibroimpact.orchestrator.orbits.follow import Following

EXAMPLES = Path(__file__).parents[2] / "examples"
FREQUENCY = "forcing.angular_frequency"
DOUBLING = 0.9364931207
BEAM = """
[body]
kind = "beam"
length = 0.3
flexural_rigidity = 0.05002
mass_per_length = 0.1054
modes = 8
damping_ratio = 0.1
[forcing]
amplitude = 0.4
angular_frequency = 24.0
location = 1.0
[[stop]]
position = -0.2672
side = "lower"
restitution = 0.7
location = 1.0
[record]
recorded_periods = 5
"""


def oscillator() -> vi.Scene:
    """Return the scene of the thesis's figure 3.3, at one frequency."""
    path = EXAMPLES / "bifurcation.toml"
    return vi.Scene.from_text(path.read_text(encoding="utf-8")).with_sweep({})


def branches(scene: vi.Scene, span: tuple[float, float], step: float) -> list[Branch]:
    """Follow P(1,1) and the branches that double from it."""
    return whole(Following(scene, FREQUENCY, *span, step=step, impacts=1, grazes=0)).followed.branches


def doubling_by_sweeps(tolerance: float) -> tuple[float, int]:
    """Return the period doubling of P(1,1), and the number of runs; each sweep has 41 points of the last bracket."""
    record = {"record.transient_periods": 20_000, "record.recorded_periods": 64, "record.impacts": True}
    low, high, runs = 0.93, 0.95, 0
    while high - low > tolerance:
        grid = np.linspace(low, high, 41)
        scene = oscillator().with_values(record).with_sweep({FREQUENCY: {"values": grid.tolist()}})
        names = [kind.name for kind in vi.classify(vi.run(scene, progress=False))]
        runs += len(grid)
        doubled = [value for value, name in zip(grid, names, strict=True) if name != "P(1,1)"]
        if not doubled or max(doubled) >= high:
            return math.nan, runs
        low, high = max(doubled), float(grid[np.searchsorted(grid, max(doubled)) + 1])
    return 0.5 * (low + high), runs


def orbit_by_shooting() -> float:
    """Return the impact velocity of P(1,1) at .9 by SciPy; the unknowns are time and speed of the impact."""
    force, w, r, ratio, stop = 0.5, 0.9, 0.7, 0.05, 1.0

    def motion(t: float, y: np.ndarray[Any, Any]) -> list[float]:
        return [y[1], force * math.cos(w * t) - y[0] - 2.0 * ratio * y[1]]

    def reached(t: float, y: np.ndarray[Any, Any]) -> float:
        return float(y[0] - stop)

    reached.terminal, reached.direction = True, 1.0  # type: ignore[attr-defined]

    def error(unknown: np.ndarray[Any, Any]) -> list[float]:
        at, speed = unknown
        flown = solve_ivp(
            motion,
            (at, at + 20.0),
            [stop - 1e-14, -r * speed],
            method="DOP853",
            rtol=1e-11,
            atol=1e-13,
            events=reached,
        )
        return [flown.t_events[0][0] - at - 2.0 * math.pi / w, flown.y_events[0][0][1] - speed]

    found = root(error, [0.13, 0.66], tol=1e-11)
    assert found.success, found.message
    return float(found.x[1])


BODY = impacting_body(oscillator().with_values({FREQUENCY: 0.9}))


def orbit_by_phases() -> float:
    """Return the same velocity by Newton's method on the phase of the impact."""
    return float(find_orbit(BODY, [0.12]).velocities[0])


def basins() -> Any:
    """Return the basins of 100 x 100 starts."""
    return vi.basins(
        vi.Scene.from_text((EXAMPLES / "basins.toml").read_text(encoding="utf-8")), points=(100, 100)
    )


def single_runs(count: int) -> None:
    """Run a grid of starts in one campaign and classify each run, with the record that `classify` needs."""
    record = {
        "record.transient_periods": 1000,
        "record.recorded_periods": 64,
        "record.impacts": True,
        "record.extrema": True,
    }
    side = round(math.sqrt(count))
    grid = {
        "body.displacement_start": {"start": -1.5, "stop": 1.0, "points": side},
        "body.velocity_start": {"start": -2.0, "stop": 2.0, "points": side},
    }
    text = (EXAMPLES / "basins.toml").read_text(encoding="utf-8")
    vi.classify(vi.run(vi.Scene.from_text(text).with_values(record).with_sweep(grid), progress=False))


def timed(
    jobs: dict[str, Callable[[], object]], repetitions: int, clock: Callable[[], float]
) -> dict[str, list[float]]:
    """Do jobs in turns; return the times of each, s."""
    found: dict[str, list[float]] = {name: [] for name in jobs}
    for _ in range(repetitions):
        for name, job in jobs.items():
            began = clock()
            job()
            found[name].append(clock() - began)
    return found


def summary(times: list[float]) -> str:
    """Return the median and the range of times."""
    return f"{statistics.median(times):.4g} s ({min(times):.3g} to {max(times):.3g})"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repetitions", type=int, default=5)
    repetitions = parser.parse_args().repetitions
    beam = vi.Scene.from_text(BEAM)
    counts = {
        "oscillator": branches(oscillator(), (0.6, 1.6), 0.01),
        "beam of 8 modes": branches(beam, (15.0, 60.0), 0.0002),
    }
    for name, found in counts.items():
        many, points = sum(len(each.orbits) for each in found), sum(len(each.points) for each in found)
        print(f"{name}: {len(found)} branches, {many} orbits, {points} bifurcations")
    times = timed(
        {
            "oscillator": lambda: branches(oscillator(), (0.6, 1.6), 0.01),
            "beam of 8 modes": lambda: branches(beam, (15.0, 60.0), 0.0002),
            "one orbit, phases": orbit_by_phases,
            "one orbit, solve_ivp and root": orbit_by_shooting,
        },
        repetitions,
        time.process_time,
    )
    for name, seconds in times.items():
        print(f"{name}: {summary(seconds)}")
    print(f"  speeds differ by {abs(orbit_by_phases() - orbit_by_shooting()):.1e}")
    began = time.process_time()
    where, runs = doubling_by_sweeps(1e-8)
    by_sweeps = time.process_time() - began
    print(
        f"period doubling by {runs} runs of 20,064 periods: {abs(where - DOUBLING):.1e} off, {by_sweeps:.4g} s"
    )
    ratio = statistics.median(times["one orbit, solve_ivp and root"]) / statistics.median(
        times["one orbit, phases"]
    )
    print(f"one orbit by solve_ivp and root takes {ratio:.0f} times as long")
    walls = timed(
        {"basins of 10,000 starts": basins, "400 single runs, classified": lambda: single_runs(400)},
        repetitions,
        time.perf_counter,
    )
    for name, seconds in walls.items():
        print(f"{name}: {summary(seconds)}")
    single = statistics.median(walls["400 single runs, classified"]) / 400.0
    own = statistics.median(walls["basins of 10,000 starts"]) / 10_000.0
    print(
        f"one start costs {1e6 * own:.3g} us, a single run of 1,064 periods {single / own:.0f} times as much"
    )


if __name__ == "__main__":
    main()

"""Cost of a random force on a Structure with a stop: its making alone, an interval of its spline, and a chirp.

One mode (3 rad/s, damping ratio .05) or several (growing by 1.3) are driven by a band up to 100 rad/s. A stop with
r = .7 is at .05 m. An interval is an eighth of the shortest period. Times are processor times, the smallest of several
repetitions. Run with `python tests/benchmarks/bench_random.py [--repetitions 5] [--output results/bench_random]`.
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from support.component_fmu import stop
from support.modal_fmu import structure_fmu

from vibroimpact.fmus.core.signals import Signal, SignalKind

HIGH, INTERVALS, CHIRP_TIME = 100.0, 200_000, 500.0
INTERVAL = 2.0 * math.pi / (8.0 * HIGH)
#: Goals: microseconds of the making of a sample, and of a sample on one mode with a stop.
MOST_OF_MAKING, MOST_OF_ONE_MODE = 0.1, 0.3
Row = tuple[str, float]


def least_time(repetitions: int, call: Callable[[], object]) -> float:
    """Return the smallest processor time of several calls, s."""
    times = []
    for _ in range(repetitions):
        start = time.process_time()
        call()
        times.append(time.process_time() - start)
    return min(times)


def making(repetitions: int) -> Row:
    signal = Signal(SignalKind.random, end_angular_frequency=HIGH)
    times = np.arange(INTERVALS) * INTERVAL
    return "making of a sample", least_time(repetitions, lambda: signal.values(times)) / INTERVALS * 1e6


def arrays_of(modes: int) -> dict[str, Any]:
    shape = np.full(modes, 1.0 / math.sqrt(modes))
    return {
        "mode.angular_frequency": 3.0 * 1.3 ** np.arange(modes),
        "mode.damping_ratio": np.full(modes, 0.05),
        "mode.contact_shape": [shape],
        "mode.observed_shape": shape,
        "mode.signal": [shape],
    }


def driven(name: str, modes: int, repetitions: int, **record: bool) -> Row:
    """Return the cost of an interval, us."""
    force = {"signal[1].kind": 7, "signal[1].amplitude": 2.0, "signal[1].end_angular_frequency": HIGH}
    switches = {f"record.{what}": on for what, on in record.items()}
    with structure_fmu(arrays_of(modes), {**force, **stop(0.05, 0.7), **switches}) as fmu:
        fmu.step(INTERVAL)
        seconds = least_time(repetitions, lambda: fmu.step(INTERVALS * INTERVAL))
    return f"{name}, a sample", seconds / INTERVALS * 1e6


def chirped(kind: SignalKind, repetitions: int) -> Row:
    """Return the cost of a turn of a chirp from 10 to 100 rad/s on one mode with a stop, us."""
    names = ("kind", "amplitude", "duration", "angular_frequency", "end_angular_frequency")
    values = (int(kind), 5.0, CHIRP_TIME, 10.0, 100.0)
    chirp = {f"signal[1].{name}": value for name, value in zip(names, values, strict=True)}
    mean = 55.0 if kind is SignalKind.chirp_linear else 90.0 / math.log(10.0)
    with structure_fmu(arrays_of(1), {**chirp, **stop(0.05, 0.7)}) as fmu:
        start = fmu.serialized()

        def again() -> None:
            fmu.restore(start)
            fmu.time = 0.0
            fmu.step(CHIRP_TIME)

        seconds = least_time(repetitions, again)
    return f"{kind.name}, a turn", seconds / (mean * CHIRP_TIME / (2.0 * math.pi)) * 1e6


def main() -> int:
    """Measure, print and write a CSV; return 1 if a goal is missed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repetitions", type=int, default=5)
    parser.add_argument("--output", type=Path, default=Path("results/bench_random"))
    options = parser.parse_args()
    rows = [
        making(options.repetitions),
        driven("1 mode", 1, options.repetitions),
        driven("1 mode, extremes recorded", 1, options.repetitions, extrema=True),
        driven("1 mode, energies integrated", 1, options.repetitions, energies=True),
        driven("8 modes", 8, options.repetitions),
        chirped(SignalKind.chirp_linear, options.repetitions),
        chirped(SignalKind.chirp_logarithmic, options.repetitions),
    ]
    options.output.mkdir(parents=True, exist_ok=True)
    with (options.output / "random.csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([("case", "us"), *rows])
    for name, microseconds in rows:
        print(f"{name}: {microseconds:.3f} us")
    missed = rows[0][1] > MOST_OF_MAKING or rows[1][1] > MOST_OF_ONE_MODE
    print(f"goals of {MOST_OF_MAKING} and {MOST_OF_ONE_MODE} us: {'missed' if missed else 'reached'}")
    return int(missed)


if __name__ == "__main__":
    sys.exit(main())

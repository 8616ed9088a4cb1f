"""Cost of a long rest: on one stop or several, held or pressed, any damping, with and without energies.

Four masses of 1 kg between springs of 1 N/m are pressed outwards to stops at both ends for 100 s under a slow force.
Compliant stops have 1e8 N/m, a rate of 10^4 rad/s: the rest lasts 10^6 radians of it. Each rest is computed by its
exact flow and by series.

Times are processor times: the smallest of several repetitions of the exact flow, and one run of the series.
Run with `python tests/benchmarks/bench_rests.py [--repetitions 5] [--output results/bench_rests]`.
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from support.structure import Modes, Stop, Structure

MASSES, STIFFNESS, SLOW, DURATION = 4, 1e8, 0.3, 100.0
#: The goal of the issue: a rest on stiff stops finishes in milliseconds.
MOST_MILLISECONDS = 5.0

SPRINGS = 2.0 * np.eye(MASSES) - np.eye(MASSES, k=1) - np.eye(MASSES, k=-1)
SQUARE, SHAPES = np.linalg.eigh(SPRINGS)
NATURAL = np.sqrt(SQUARE)
FORCE = SHAPES.T @ [0.3, 0.2, 0.1, 0.3]
OUTWARDS = SHAPES.T @ [-3.0, 0.0, 0.0, 3.0]


@dataclass(frozen=True)
class Case:
    """A rest: its name, the damping of the chain, its stops, and whether energies are recorded."""

    name: str
    modes: Modes
    stops: tuple[Stop, ...]
    energies: bool = False


@dataclass(frozen=True)
class Figure:
    """One line of the table, times in ms; `apart`: the largest difference between the end states of both runs."""

    name: str
    exact: float
    series: float
    apart: float

    def sentence(self) -> str:
        """Return the line in words."""
        return f"{self.name:42} {self.exact:9.3f} ms {self.series:10.1f} ms by series, ends {self.apart:.0e} apart"


def yielding(shape: np.ndarray, side: str) -> Stop:
    """Return a stiff Kelvin-Voigt stop."""
    damping = 0.2 * math.sqrt(STIFFNESS)
    return Stop(shape, 0.0, law="kelvin_voigt", side=side, stiffness=STIFFNESS, damping=damping)


def cases() -> list[Case]:
    """Return the cases of rest."""
    first, last = yielding(SHAPES[0], "lower"), yielding(SHAPES[-1], "upper")
    held = Stop(SHAPES[-1], 0.0, restitution=0.3)
    damper = 0.05 * SPRINGS + np.diag([0.0, 0.4, 0.0, 0.0])
    light = Modes(NATURAL, 0.025 * NATURAL, FORCE, SLOW)
    strong = Modes(NATURAL, 3.0, FORCE, SLOW)
    coupled = Modes(NATURAL, 0.0, FORCE, SLOW, coupling=SHAPES.T @ damper @ SHAPES)
    return [
        Case("pressed on one stop", light, (last,)),
        Case("pressed on one stop, energies", light, (last,), energies=True),
        Case("pressed on one stop, coupled damping", coupled, (last,)),
        Case("pressed on one stop, overdamped modes", strong, (last,)),
        Case("pressed on two stops", light, (last, first)),
        Case("pressed on two stops, energies", light, (last, first), energies=True),
        Case("pressed on two stops, coupled damping", coupled, (last, first)),
        Case("held on one stop, pressed on another", light, (held, first)),
    ]


def followed(case: Case, *, by_series: bool) -> tuple[float, np.ndarray]:
    """Return the processor time of a rest, s, and its end state."""
    with Structure(case.modes, case.stops, energies=case.energies, by_series=by_series) as body:
        began = time.process_time()
        body.advance(DURATION, held=OUTWARDS)
        seconds = time.process_time() - began
        return seconds, np.array([*body.displacement, *body.velocity, body.forcing_work, body.damping_loss])


def measured(case: Case, repetitions: int) -> Figure:
    """Time a rest by its exact flow and by series."""
    exact, end = min((followed(case, by_series=False) for _ in range(repetitions)), key=lambda run: run[0])
    series, other = followed(case, by_series=True)
    return Figure(case.name, 1e3 * exact, 1e3 * series, float(np.abs(end - other).max()))


def draw(figures: list[Figure], path: Path) -> None:
    """Draw both times of each rest."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    rows = np.arange(len(figures))
    figure, axes = plt.subplots(figsize=(8, 4))
    axes.barh(rows - 0.2, [f.exact for f in figures], 0.4, label="exact flow")
    axes.barh(rows + 0.2, [f.series for f in figures], 0.4, label="series")
    axes.set_yticks(rows, [f.name for f in figures])
    axes.invert_yaxis()
    axes.set_xscale("log")
    axes.set_xlabel("processor time of 100 s at rest, ms")
    axes.set_title("Four masses at rest on stops of 1e8 N/m")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.18), ncols=2)
    figure.tight_layout()
    figure.savefig(path, dpi=150)
    plt.close(figure)


def main() -> int:
    """Measure, print, write CSV and figure; return 1 if the goal is missed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repetitions", type=int, default=5)
    parser.add_argument("--output", type=Path, default=Path("results/bench_rests"))
    options = parser.parse_args()
    figures = [measured(case, options.repetitions) for case in cases()]
    for figure in figures:
        print(figure.sentence())
    worst = max(figures, key=lambda figure: figure.exact)
    least = min(figure.series / figure.exact for figure in figures)
    print(
        f"10^6 radians at rest take at most {worst.exact:.2f} ms ({worst.name}), "
        f"at least {least:.0f} times less than by series."
    )
    options.output.mkdir(parents=True, exist_ok=True)
    with (options.output / "bench_rests.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["name", "exact_ms", "series_ms", "largest_difference"])
        writer.writerows([f.name, f"{f.exact:.4f}", f"{f.series:.2f}", f"{f.apart:.3g}"] for f in figures)
    draw(figures, options.output / "bench_rests.png")
    return 0 if worst.exact <= MOST_MILLISECONDS else 1


if __name__ == "__main__":
    sys.exit(main())

"""Cost of an impact of a beam: periodic orbit, number of modes, contact law, rest, and a stop out of reach.

A clamped-free beam in units of its first mode (natural frequencies (xi_j / xi_1)^2) is driven at its tip with 0.9 of
the first natural frequency. A stop with r = .7 is at the tip.

| motion | damping ratio | stop, over the amplitude of the steady motion without it |
|---|---|---|
| P(1,1) with 8 modes | .02 in every mode | .98 |
| cost over the number of modes | .3 | `GAPS` |

The tip of a beam is lighter the more modes there are (m / 4N) and soon bounces many times per period. High damping and
the close stop of `GAPS` give one impact per period for every number of modes: the orbits are of one kind.

A beam of the same modes chatters and sticks between 1 to 8 rigid stops along its length (`Shape`). Its cost is measured
over modes and stops, with the largest factor between neighbours (`support.neighbours`).

Times are processor times, the smallest of several repetitions: other work on the machine does not count.
Run with `python tests/benchmarks/bench_structure.py [--repetitions 5] [--output results/bench_structure]`.
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.core import beam_modes

sys.path.insert(0, str(Path(__file__).parents[1]))
from support.neighbours import LADDERS, Cost, Shape, cliffs, measured, shapes
from support.structure import Modes, Stop, Structure

FREQUENCY, DAMPING, RESTITUTION, GAP = 0.9, 0.02, 0.7, 0.98
HIGH_DAMPING, GAPS = 0.3, {4: 0.999, 8: 0.999, 16: 0.9999, 32: 0.99999}
PERIOD = 2.0 * math.pi / FREQUENCY
SIZES = tuple(GAPS)
#: The goals of the issue: us per impact of 8 modes, and the largest exponent of the cost over the number of modes.
MOST_MICROSECONDS, LARGEST_EXPONENT = 20.0, 2.0
SETTLING, PERIODS = 400, 2000
#: Beams between several stops: sizes, and the largest factor between the costs of neighbours.
STOPS, MOST_OF_NEIGHBOURS = (1, 2, 4, 8), 10.0
#: Periods before a measurement of a shape, in which a body meets nearly all sets of stops on which it rests. Processor
#: time from which a measurement is long enough, s, and its most periods.
BEFORE, LONG_ENOUGH, MOST_PERIODS = 16, 0.02, 4096
#: Sizes and damping ratios of beams with stops of a power law; periods before, and timed: by steps and by series.
POWER_SIZES, POWER_DAMPINGS = (4, 8, 16, 32, 64), (0.02, 0.0)
SETTLING_PERIODS, TIMED_PERIODS = 40, {False: 40, True: 4}
#: Least ratio of the cost by series to the cost by steps, for 64 modes.
LEAST_RATIO = 8.0


@dataclass(frozen=True)
class Figure:
    """One line of the table: a cost, and the motion to which it belongs."""

    name: str
    modes: int
    microseconds: float
    per: str
    impacts_per_period: float
    repeats_after: int

    def sentence(self) -> str:
        """Return the line in words."""
        orbit = f"repeats after {self.repeats_after}" if self.repeats_after else "not periodic"
        return (
            f"{self.name:46}{self.modes:4d} modes {self.microseconds:10.3f} us per {self.per}"
            f"   ({self.impacts_per_period:.2f} impacts per period, {orbit})"
        )


def beam(modes: int, damping: float = DAMPING) -> tuple[Modes, NDArray[np.float64], float]:
    """Return a beam, the shape of its tip and the amplitude of its steady motion there."""
    found = beam_modes("clamped_free", modes)
    natural = (np.asarray(found.eigenvalues) / found.eigenvalues[0]) ** 2
    tip = np.asarray(found.shapes([1.0]))[0]
    response = tip**2 / (natural**2 - FREQUENCY**2 + 2j * damping * natural * FREQUENCY)
    return Modes(natural, damping, tip, FREQUENCY), tip, float(abs(response.sum()))


def repeats_after(velocities: NDArray[np.float64]) -> int:
    """Return the number of impacts after which the velocities repeat to 1e-9; 0 where it is above 12."""
    for count in range(1, 13):
        if len(velocities) > 4 * count and np.allclose(velocities[count:], velocities[:-count], rtol=1e-9):
            return count
    return 0


def timed(body: Structure, periods: int, repetitions: int, period: float = PERIOD) -> float:
    """Return the smallest processor time of following the body for `periods` periods, s."""
    best = math.inf
    for _ in range(repetitions):
        began = time.process_time()
        body.advance(periods * period)
        best = min(best, time.process_time() - began)
    return best


def impacts(
    name: str,
    modes: int,
    repetitions: int,
    make: Callable[[NDArray[np.float64], float], Stop],
    damping: float = DAMPING,
) -> Figure:
    """Return the time per impact of a beam with one stop."""
    body_modes, tip, amplitude = beam(modes, damping)
    with Structure(body_modes, [make(tip, amplitude)]) as body:
        body.advance(SETTLING * PERIOD)
        before = len(body.impacts)
        seconds = timed(body, PERIODS, repetitions)
        rows = body.impacts[before:]
        per_period = len(rows) / (PERIODS * repetitions)
        each = 1e6 * seconds / (PERIODS * per_period)
        return Figure(name, modes, each, "impact", per_period, repeats_after(rows[-60:, 3]))


def restitution(tip: NDArray[np.float64], amplitude: float) -> Stop:
    """Return the stop of the P(1,1) motion."""
    return Stop(tip, GAP * amplitude, restitution=RESTITUTION)


def laws(modes: int, repetitions: int) -> list[Figure]:
    """Time the laws at the same place: stops whose contact lasts about a fortieth of the period of the first mode."""
    stiffness = 400.0
    return [
        impacts(
            f"kelvin_voigt, stiffness {stiffness:g}, damping 4",
            modes,
            repetitions,
            lambda tip, a: Stop(tip, GAP * a, law="kelvin_voigt", stiffness=stiffness, damping=4.0),
        ),
        impacts(
            f"hertz, stiffness {stiffness:g}",
            modes,
            repetitions,
            lambda tip, a: Stop(tip, GAP * a, law="hertz", stiffness=stiffness),
        ),
        impacts(
            f"hunt_crossley, stiffness {stiffness:g}, chi .5",
            modes,
            repetitions,
            lambda tip, a: Stop(tip, GAP * a, law="hunt_crossley", stiffness=stiffness, damping=0.5),
        ),
    ]


@dataclass(frozen=True)
class PowerContact:
    """Cost of an impact on a stop with a power law, and of the same impact by series of all modes."""

    figure: Figure
    by_series: float
    error: float

    def sentence(self) -> str:
        """Return the cost, its ratio to the series and the error beside it."""
        ratio = self.by_series / self.figure.microseconds
        return f"{self.figure.sentence()}, {ratio:.1f} times less than by series; error {self.error:.1g}"


def power_contact(modes: int, damping: float, law: str, repetitions: int) -> PowerContact:
    """Time impacts on a stop that a beam in units of its length meets, in turns with the same by series."""
    found = beam_modes("clamped_free", modes)
    natural, tip = np.asarray(found.eigenvalues) ** 2, np.asarray(found.shapes([1.0]))[0]
    stop = Stop(tip, 0.02, law=law, stiffness=1e4, damping=0.5)
    period = 2.0 * math.pi / 3.4
    costs, restitutions, per_period = {False: math.inf, True: math.inf}, {}, 0.0
    bodies = {
        by_series: Structure(
            Modes(natural, damping, 0.15 * tip, 3.4),
            [stop],
            tolerance=1e-10,
            by_series=by_series,
            at_once=not by_series,
        )
        for by_series in (False, True)
    }
    for by_series, body in bodies.items():
        body.advance(SETTLING_PERIODS * period)
        restitutions[by_series] = float(body.impacts[0, 6])
    for _ in range(repetitions):
        for by_series, body in bodies.items():
            periods, before = TIMED_PERIODS[by_series], len(body.impacts)
            seconds = timed(body, periods, 1, period)
            count = len(body.impacts) - before
            costs[by_series] = min(costs[by_series], 1e6 * seconds / max(1, count))
            per_period = count / periods if not by_series else per_period
    for body in bodies.values():
        body.close()
    error = abs(restitutions[False] - restitutions[True])
    figure = Figure(f"{law}, damping {damping:g}", modes, costs[False], "impact", per_period, 0)
    return PowerContact(figure, costs[True], error)


def sticking(modes: int, repetitions: int, *, by_series: bool = False) -> Figure:
    """Time a beam that a slow drive presses to its stop for half of each period; series or the exact flow for rests."""
    found = beam_modes("clamped_free", modes)
    natural = (np.asarray(found.eigenvalues) / found.eigenvalues[0]) ** 2
    tip, slow = np.asarray(found.shapes([1.0]))[0], 0.2
    period, best = 2.0 * math.pi / slow, math.inf
    with Structure(
        Modes(natural, 0.1, tip, slow), [Stop(tip, 0.0, restitution=0.3)], by_series=by_series
    ) as body:
        body.advance(period)
        before = len(body.impacts)
        for _ in range(repetitions):
            began = time.process_time()
            body.advance(period)
            best = min(best, time.process_time() - began)
        per_period = (len(body.impacts) - before) / repetitions
    name = "sticks for half of each slow period" + (", by series" if by_series else "")
    return Figure(name, modes, 1e6 * best, "period", per_period, 0)


def out_of_reach(modes: int, repetitions: int) -> tuple[Figure, Figure]:
    """Time samples with a stop far away and without a stop, in turns."""
    body_modes, tip, amplitude = beam(modes)
    found = []
    samples = 20_000
    for stops in ([Stop(tip, 50.0 * amplitude)], []):
        best = math.inf
        with Structure(body_modes, stops) as body:
            for _ in range(repetitions):
                began = time.process_time()
                for _ in range(samples):
                    body.advance(0.01 * PERIOD)
                best = min(best, time.process_time() - began)
        name = "stop out of reach, 100 samples per period" if stops else "no stop, 100 samples per period"
        found.append(Figure(name, modes, 1e6 * best / samples, "sample", 0.0, 0))
    return found[0], found[1]


def empty_call(repetitions: int) -> float:
    """Return the time of a bare call into the C library, us: a sample of one mode without a stop or a force."""
    best = math.inf
    with Structure(Modes([1.0])) as body:
        for _ in range(repetitions):
            began = time.process_time()
            for _ in range(20_000):
                body.advance(0.01)
            best = min(best, time.process_time() - began)
    return 1e6 * best / 20_000


def seconds_of(shape: Shape, repetitions: int) -> Cost:
    """Return the least processor time of a shape, s, over as many periods as measure it well."""
    periods, best = 4, measured(shape, lambda _: time.process_time(), settling=BEFORE, periods=4)
    while best.period * periods < LONG_ENOUGH and periods < MOST_PERIODS:
        periods *= 4
        best = measured(shape, lambda _: time.process_time(), settling=BEFORE, periods=periods)
    for _ in range(repetitions - 1):
        again = measured(shape, lambda _: time.process_time(), settling=BEFORE, periods=periods)
        best = min(best, again, key=lambda cost: cost.period)
    return best


def between_stops(costs: dict[Shape, Cost]) -> list[str]:
    """Return the table of beams between rigid stops, us an impact, with exponents over modes and over stops."""
    sizes = [value for value in LADDERS["modes"] if isinstance(value, int) and value >= 8]
    each = np.array([[1e6 * costs[Shape("beam", n, stops)].impact for stops in STOPS] for n in sizes])
    lines = ["modes" + "".join(f"{stops:>10d}" for stops in STOPS) + " stops, us per impact"]
    lines += [f"{n:5d}" + "".join(f"{x:10.2f}" for x in row) for n, row in zip(sizes, each, strict=True)]
    over_modes = np.polyfit(np.log(sizes), np.log(each), 1)[0]
    over_stops = np.polyfit(np.log(STOPS), np.log(each.T), 1)[0]
    lines.append("Exponents over modes: " + ", ".join(f"{x:.2f}" for x in over_modes))
    lines.append("Exponents over stops: " + ", ".join(f"{x:.2f}" for x in over_stops))
    return lines


def draw(sizes: list[Figure], exponent: float, path: Path) -> None:
    """Draw the cost over the number of modes."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    n, cost = np.array([f.modes for f in sizes]), np.array([f.microseconds for f in sizes])
    figure, axes = plt.subplots(figsize=(6, 4))
    axes.loglog(n, cost, "o-", label=f"measured, exponent {exponent:.2f}")
    axes.loglog(n, cost[0] * (n / n[0]) ** 2, "--", label="exponent 2")
    axes.set_xticks(n, [str(x) for x in n])
    axes.set_xticks([], minor=True)
    axes.set_xlabel("modes")
    axes.set_ylabel("processor time per impact, us")
    axes.set_title("Clamped-free beam with a stop at its tip")
    axes.legend()
    figure.tight_layout()
    figure.savefig(path, dpi=150)
    plt.close(figure)


def main() -> int:
    """Measure, print, write CSV and figure; return 1 if a goal is missed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repetitions", type=int, default=5)
    parser.add_argument("--output", type=Path, default=Path("results/bench_structure"))
    options = parser.parse_args()
    sizes = [
        impacts(
            f"restitution .7, damping .3, stop at {GAPS[n]}",
            n,
            options.repetitions,
            lambda tip, a, gap=GAPS[n]: Stop(tip, gap * a, restitution=RESTITUTION),  # type: ignore[misc]
            HIGH_DAMPING,
        )
        for n in SIZES
    ]
    eight = impacts("restitution .7, damping .02, stop at .98", 8, options.repetitions, restitution)
    exponent = float(np.polyfit(np.log(SIZES), np.log([f.microseconds for f in sizes]), 1)[0])
    compliant = laws(8, options.repetitions)
    far, without = out_of_reach(8, options.repetitions)
    resting = [sticking(64, options.repetitions), sticking(64, 1, by_series=True)]
    rows = [*sizes, eight, *compliant, *resting, far, without]
    powers = [
        power_contact(n, damping, law, options.repetitions)
        for law in ("hertz", "hunt_crossley")
        for damping in POWER_DAMPINGS
        for n in POWER_SIZES
    ]
    print("\n".join([*(row.sentence() for row in rows), *(power.sentence() for power in powers)]))
    rows.extend(power.figure for power in powers)
    call = empty_call(options.repetitions)
    print(
        f"A sample through the door of one free mode costs {call:.3f} us: most of it is the call from Python."
    )
    print(
        f"8 modes cost {eight.microseconds:.2f} us per impact; the cost grows as modes^{exponent:.2f}; "
        f"a stop out of reach makes a sample {far.microseconds / without.microseconds:.2f} times as long as no stop. "
        f"64 modes that stick cost {resting[0].microseconds / 1e3:.2f} ms per period, "
        f"{resting[1].microseconds / resting[0].microseconds:.0f} times less than by series."
    )
    costs = {shape: seconds_of(shape, options.repetitions) for shape in shapes()}
    steep = [line for ladder in LADDERS for line in cliffs(costs, ladder, MOST_OF_NEIGHBOURS)]
    print(*between_stops(costs), sep="\n")
    print(
        f"{len(steep)} of {len(costs)} shapes have a neighbour that costs over {MOST_OF_NEIGHBOURS:g} times as much."
    )
    print(*steep, sep="\n")
    options.output.mkdir(parents=True, exist_ok=True)
    with (options.output / "bench_structure.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["name", "modes", "microseconds", "per", "impacts_per_period", "repeats_after"])
        writer.writerows(
            [f.name, f.modes, f"{f.microseconds:.4f}", f.per, f"{f.impacts_per_period:.4f}", f.repeats_after]
            for f in rows
        )
    draw(sizes, exponent, options.output / "bench_structure.png")
    gains = [p.by_series / p.figure.microseconds for p in powers if p.figure.modes == POWER_SIZES[-1]]
    good = (
        eight.microseconds <= MOST_MICROSECONDS
        and exponent <= LARGEST_EXPONENT
        and eight.repeats_after > 0
        and not steep
        and min(gains) >= LEAST_RATIO
    )
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())

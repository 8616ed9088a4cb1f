"""Many points in lanes, in every instruction set of this machine, against the fused FMU, scipy, diffrax and FMPy.

The motions are P(1,1) of bench_fused, with its errors, and chaos (r .8, no damping, F 1, stop 0, w 2.8). Further rows
show the cost over modes, contacts, points and recorded periods. All are timed in turns, by processor time; medians are
compared.

Run with `python tests/benchmarks/bench_lanes.py [--periods 5000] [--repetitions 7] [--output FOLDER]`.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

import bench_fused
from bench_fused import PERIOD, PHASE, SCENE, VELOCITY, Fused, Peer, machine
from peers import fmpy_import, jax_flights
from peers.problems import orbit
from peers.ways import Clock as Allowance
from peers.ways import Way
from support import lane_points
from support.lane_points import IMPACT, TURN, Columns, drawn, drawn_coupled, run, taken

from vibroimpact.fmus.core import lanes
from vibroimpact.fmus.core.lanes import Instructions, instructions
from vibroimpact.orchestrator.run.point import PointRunner
from vibroimpact.orchestrator.scene import parse_scene

POINTS = 64
SETS = {
    "strobe of all periods": ("periods",),
    "impacts of all periods": ("impacts",),
    "strobe and extremes of all periods": ("periods", "extrema"),
    "all of all periods": ("periods", "impacts", "extrema"),
}
"""Recorded variables, by the name of the set."""
STIFFNESSES = (1e4, 1e8)
"""Stiffnesses of Kelvin-Voigt stops, that of the oscillator's spring being 1."""
VOIGT_RATIO = 0.1222
"""Damping ratio of a mass on a Kelvin-Voigt stop that has the restitution .7 (equations.md 6.9)."""
OTHER_IMPACTS = 100
"""Impacts of diffrax and FMPy, one in each period: the time per impact does not depend on the number."""
HERE = [each for each in Instructions if each and instructions() >= each]


class Clock:
    """Counts only the processor time of the calls of C."""

    def __init__(self) -> None:
        self.seconds = 0.0
        setattr(lane_points, "run_lanes", self._run)  # noqa: B010 - it replaces the function that the module imports

    def _run(
        self,
        plan: lanes.LanesPlan,
        points: lanes.LanesPoints,
        memory: np.ndarray[tuple[int], np.dtype[np.uint8]],
    ) -> lanes.LanesEnd:
        began = time.thread_time()
        end = lanes.run_lanes(plan, points, memory)
        self.seconds += time.thread_time() - began
        return end


@dataclass(frozen=True, slots=True)
class Case:
    """Points, the total number of their impacts, and their recorded variables."""

    points: Columns
    impacts: float
    recorded: tuple[str, ...] = ("periods",)

    def seconds(self, clock: Clock, chosen: Instructions) -> float:
        """Return seconds per impact."""
        clock.seconds = 0.0
        recorded = {name: name in self.recorded for name in ("periods", "impacts", "extrema")}
        run(self.points, **recorded, instructions=chosen, room=100_000)
        return clock.seconds / self.impacts


def oscillators(periods: int, recorded: int, **values: float) -> Columns:
    """Return points of mass 1 and stiffness 1 with one stop and different starts."""
    points = taken(drawn(1, 1, 1, 0), np.zeros(POINTS, np.int64))
    given = {"held": 0.0, "phase": 0.0, "shape": 1.0, "impulse": 1.0, "observed": 1.0, "stiffness": 1.0}
    for name, value in {**given, "yield_velocity": 0.0, "direction": 1.0, "force": 1.0, **values}.items():
        points[name] = np.full(points[name].shape, value)
    points["start_q"] = values["position"] - np.linspace(0.1, 0.8, POINTS)[None]
    period = TURN / points["angular_frequency"]
    return {**points, "begin": periods * period, "end": (periods + recorded) * period}


def periodic(periods: int, recorded: int = 1) -> Columns:
    """Return points that all converge to P(1,1)."""
    body = {"decay": 0.1, "force": 0.5, "angular_frequency": 1.0, "position": 1.0, "restitution": 0.7}
    return oscillators(periods, recorded, start_p=0.0, **body)


def under_three_sines(points: Columns) -> Columns:
    """Return points with two further sines of the same period: twice and three times the frequency."""
    shape = (2, *points["force"].shape)
    return {
        **points,
        "further_force": np.array([0.1, 0.05])[:, None, None] * np.ones(shape),
        "further_frequency": np.array([[2.0], [3.0]]) * points["angular_frequency"],
        "further_phase": np.array([[0.3], [1.0]]) * np.ones_like(points["angular_frequency"]),
    }


def counted(points: Columns, *recorded: str) -> Case:
    """Return the points that run in lanes, with their number of impacts."""
    whole = {**points, "begin": np.zeros_like(points["begin"])}
    found = run(whole, extrema=False, periods=False, room=1_000_000)
    kept = np.flatnonzero(found.has_run)
    impacts = sum(float(np.count_nonzero(found.rows[place][:, 0] == IMPACT)) for place in kept)
    return Case(taken(points, kept), impacts, recorded or ("periods",))


class Other:
    """Another package on the same orbit, with a setting of about the error of RK45 at rtol 1e-6."""

    def __init__(self, way: Way, setting: float) -> None:
        self.name = f"{way.name}, {way.knob} {setting:g}"
        self._run = way.open(orbit(OTHER_IMPACTS), setting, Allowance(600.0))

    def run(self) -> tuple[float, float, float]:
        """Return seconds per impact, and the errors of phase (rad) and velocity of the last impact."""
        began = time.process_time()
        found = self._run()
        seconds = (time.process_time() - began) / found.share
        if found.observation.failure or len(found.observation.impacts) != OTHER_IMPACTS:
            raise RuntimeError(f"{self.name}: expected {OTHER_IMPACTS} impacts, got {found.observation}")
        at, velocity = found.observation.impacts[-1, :2]
        # the orbit starts half a period after an impact
        return (
            seconds / OTHER_IMPACTS,
            abs(math.remainder(at - 0.5 * PERIOD, PERIOD)),
            abs(velocity - VELOCITY),
        )


def others() -> list[Peer | Other]:
    """Return the other solvers: scipy; diffrax, compiled, alone and vmapped; FMPy without and with CVode."""
    compiled = [Other(way, 1e-6) for way in jax_flights.ways() if "Dopri8" in way.name]
    stepped, _, integrated = fmpy_import.ways()
    return [Peer(1e-6), *compiled, Other(stepped, 1.0), Other(integrated, 1e-6)]


def errors() -> tuple[float, float]:
    """Return the largest errors of phase (rad) and velocity of the last impacts of P(1,1)."""
    rows = np.concatenate([each[each[:, 0] == IMPACT] for each in run(periodic(400, 4)).rows])
    return float(np.abs(rows[:, 2] - PHASE).max()), float(np.abs(rows[:, 3] - VELOCITY).max())


def yielding(periods: int, stiffness: float) -> Columns:
    """Return the points of `periodic` on a Kelvin-Voigt stop with about the restitution of its rigid stop."""
    points = periodic(periods)
    points["contact_stiffness"][:] = stiffness
    points["contact_damping"][:] = 2.0 * VOIGT_RATIO * math.sqrt(stiffness)
    return points


class FusedOrbit:
    """The orbit of bench_fused in one step, in a scene with some changes of its text."""

    PERIODS = 20_000

    def __init__(self, changes: dict[str, str]) -> None:
        text = SCENE.format_map({**vars(bench_fused), "velocity": -0.5, "impacts": self.PERIODS})
        for before, after in changes.items():
            assert before in text
            text = text.replace(before, after)
        self._runner = PointRunner(parse_scene(text, "bench_lanes.toml"))

    def seconds(self) -> float:
        """Return seconds per impact."""
        began = time.thread_time()
        record = self._runner.run({})
        seconds = time.thread_time() - began
        assert record.impacts is not None
        assert len(record.impacts) == 1
        return seconds / self.PERIODS


def fused_yielding(stiffness: float) -> FusedOrbit:
    """Return the Oscillator FMU on the orbit of `yielding`."""
    damping = 2.0 * VOIGT_RATIO * math.sqrt(stiffness)
    law = f'law = "kelvin_voigt"\nstiffness = {stiffness}\ndamping = {damping}'
    return FusedOrbit({"restitution = 0.7": law})


def fused_sines(further: int) -> FusedOrbit:
    """Return the Structure FMU under the sine of the orbit and further ones; without one, under a constant of 0."""
    forces = [f"amplitude = {0.1 / k}\nangular_frequency = {k + 1}.0" for k in range(1, further + 1)]
    forces = forces or ['signal = "constant"\namplitude = 0.0']
    tables = "".join(f"[[forcing]]\n{each}\n" for each in forces)
    return FusedOrbit({"[forcing]": "[[forcing]]", "[[stop]]": f"{tables}[[stop]]"})


def cases(periods: int) -> dict[str, Case]:
    """Return the timed cases, by name."""
    chaos = {"decay": 0.0, "angular_frequency": 2.8, "position": 0.0, "restitution": 0.8}
    found = {
        "P(1,1)": counted(periodic(periods)),
        "P(1,1), 8 points": counted(taken(periodic(periods), np.arange(8))),
        **{
            f"P(1,1), {what}": counted(periodic(0, min(periods, 500)), *recorded)
            for what, recorded in SETS.items()
        },
        **{
            f"P(1,1), Kelvin-Voigt stop of stiffness {stiffness:g}": counted(yielding(periods, stiffness))
            for stiffness in STIFFNESSES
        },
        "P(1,1) under three sines": counted(under_three_sines(periodic(periods))),
        "chaos": counted(oscillators(periods // 10, 1, start_p=0.1, **chaos)),
    }
    for modes, contacts in ((1, 1), (1, 2), (2, 1), (4, 1), (8, 1), (8, 2), (8, 4)):
        bodies = drawn(200, modes, contacts, seed=3, transient=60, recorded=1)
        found[f"random bodies: {modes} modes, {contacts} contacts"] = counted(bodies)
    for modes in (2, 4, 8):
        bodies = drawn(200, modes, 1, seed=3, transient=60, recorded=1)
        found[f"random bodies: {modes} modes, 1 contacts, three sines"] = counted(under_three_sines(bodies))
    for modes in (2, 4, 8):
        bodies = drawn_coupled(200, modes, 1, seed=3, transient=60, recorded=1)
        found[f"random bodies: {modes} coupled modes, 1 contacts"] = counted(bodies)
    return found


def measure(periods: int, repetitions: int) -> tuple[dict[str, float], dict[str, tuple[float, float]]]:
    """Time all in turns; return median microseconds per impact, and the others' errors of phase and velocity."""
    clock, fused, off = Clock(), Fused(100_000), {}
    timed: dict[str, Callable[[], float]] = {"fused Oscillator": lambda: fused.run()[0]}
    for stiffness in STIFFNESSES:
        timed[f"fused Oscillator, Kelvin-Voigt stop of stiffness {stiffness:g}"] = fused_yielding(
            stiffness
        ).seconds
    timed["fused Structure, one sine"] = fused_sines(0).seconds
    timed["fused Structure, three sines"] = fused_sines(2).seconds

    def timed_other(other: Peer | Other) -> float:
        seconds, *off[other.name] = other.run()
        return seconds

    for other in others():
        timed[other.name] = lambda other=other: timed_other(other)  # type: ignore[misc]
    for name, case in cases(periods).items():
        for chosen in HERE:
            timed[f"{name} ({chosen.name})"] = lambda case=case, chosen=chosen: case.seconds(clock, chosen)  # type: ignore[misc]
    seconds: dict[str, list[float]] = {name: [] for name in timed}
    for turn in range(repetitions):
        for name in timed if turn % 2 == 0 else reversed(list(timed)):
            seconds[name].append(timed[name]())
    found = {name: 1e6 * statistics.median(each) for name, each in seconds.items()}
    return found, {name: (phase, velocity) for name, (phase, velocity) in off.items()}


def main() -> int:
    """Measure, print the table, write `bench_lanes.json`; return 1 if errors or the ratio miss their goal."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--periods", type=int, default=5000)
    parser.add_argument("--repetitions", type=int, default=7)
    parser.add_argument("--output", type=Path, default=None)
    options = parser.parse_args()
    jax_flights.one_thread()
    (found, off), host = measure(options.periods, options.repetitions), machine("diffrax", "jax", "fmpy")
    best = HERE[-1].name
    ratio = found["solve_ivp RK45, rtol 1e-06, events"] / found[f"P(1,1) ({best})"]
    phase, velocity = errors()
    print("; ".join(f"{key} {value}" for key, value in host.items()))
    print(f"{'':60}{'us per impact':>14}{'phase error':>13}{'velocity error':>16}")
    for name, each in found.items():
        print(f"{name:60}{each:14.3f}" + "".join(f"{error:14.1e}" for error in off.get(name, ())))
    print(
        f"{options.repetitions} runs in turns: lanes with {best} are {ratio:,.0f} times faster than solve_ivp RK45 at "
        f"rtol 1e-6 on P(1,1), and exact to {phase:.0e} rad and {velocity:.0e}."
    )
    if options.output is not None:
        options.output.mkdir(parents=True, exist_ok=True)
        result = {"machine": host, "instructions": best, "ratio": ratio, "microseconds_per_impact": found}
        result |= {"phase_error": phase, "velocity_error": velocity, "errors_of_others": off}
        (options.output / "bench_lanes.json").write_text(
            json.dumps(result, indent=2) + "\n", encoding="utf-8"
        )
    return 0 if ratio >= 1000.0 and phase <= 1e-13 and velocity <= 1e-13 else 1


if __name__ == "__main__":
    sys.exit(main())

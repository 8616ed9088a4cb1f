"""Cost and accuracy of coupling, against FMPy's classes doing the same in the same process.

- microseconds per coupled impact
- microseconds per plain step
- a black-box ball, by step revision and by a plain loop of fixed steps
- the cost of the guard process

Every timing runs several times, in turns with its counterpart; tables show the median and the smallest.

Run with `python tests/benchmarks/bench_coupled.py` on a quiet machine.
"""

from __future__ import annotations

import argparse
import gc
import math
import os
import platform
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import psutil  # type: ignore[import-untyped, unused-ignore]

sys.path.insert(0, str(Path(__file__).parents[1]))
from fmpy.fmi3 import FMU3Slave
from fmpy.model_description import read_model_description
from support.coupled_parts import (
    P11,
    P11_PHASE,
    body,
    bounce_times,
    contact,
    events_of,
    external,
    part,
    phase_error,
    stop,
    values,
)
from support.fmu_factory import bouncing_ball

from vibroimpact.analysis.dataset.provenance import versions
from vibroimpact.fmus import fmu_path
from vibroimpact.fmus.packaging.archive import unpack
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.specification import EventSpec
from vibroimpact.orchestrator.run.points import independent_points
from vibroimpact.orchestrator.running import open_scene
from vibroimpact.orchestrator.scene import parse_scene

PERIOD = 2.0 * math.pi
IMPACT_GOALS = {"3.0+3.0": 2.0, "2.0+2.0": 4.0}
"""Most us per coupled impact, by the FMI versions of body and stop."""
STEP_GOAL, GUARD_GOAL, ERROR_GOAL = 1.5, 2.0, 1e-13
"""Most us per plain step; most cost of the guard, % of a point of 10 ms; largest phase error of P(1,1), rad."""
REPETITIONS = 9


def timed(*tasks: Callable[[], int], repetitions: int = REPETITIONS) -> list[list[float]]:
    """Return the seconds per unit of work of each task, run in turn; a task returns its number of units."""
    seconds: list[list[float]] = [[] for _ in tasks]
    gc.collect()
    for _ in range(repetitions):
        for place, task in zip(seconds, tasks, strict=True):
            began = time.perf_counter()
            units = task()
            place.append((time.perf_counter() - began) / units)
    return seconds


def micro(seconds: Sequence[float]) -> str:
    return f"{statistics.median(seconds) * 1e6:8.2f} {min(seconds) * 1e6:8.2f}"


def verdict(value: float, goal: float, unit: str) -> str:
    return f"goal <= {goal:g} {unit}: {'met' if value <= goal else 'not met'}"


# ---- FMPy's classes ----


def fmpy_instance(
    name: str, *, event_mode: bool, parameters: Mapping[str, float]
) -> tuple[Any, dict[str, int]]:
    """Return an instance of FMI 3.0 by FMPy's class, not yet initialized, and its references by name."""
    folder = str(unpack(fmu_path(name)).folder)
    description = read_model_description(folder)
    fmu = FMU3Slave(
        guid=description.instantiationToken,
        unzipDirectory=folder,
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName=name,
    )
    fmu.instantiate(eventModeUsed=event_mode, earlyReturnAllowed=event_mode)
    variables = {v.name: v for v in description.modelVariables}
    for key, value in parameters.items():
        kind = "Int64" if variables[key].type == "Enumeration" else "Float64"
        getattr(fmu, f"set{kind}")([variables[key].valueReference], [value])
    return fmu, {key: v.valueReference for key, v in variables.items()}


class FmpyCoupled:
    """Oscillator and ImpactStop by FMPy's classes, with event mode: P(1,1)."""

    def __init__(self) -> None:
        law = {"contact[1].law": 5, "contact[1].position": 1.0, "contact[1].side": 1}
        self.body, names = fmpy_instance("Oscillator", event_mode=True, parameters={**P11, **law})
        self.stop, stop_names = fmpy_instance("ImpactStop", event_mode=False, parameters={"restitution": 0.7})
        for fmu in (self.body, self.stop):
            fmu.enterInitializationMode()
            fmu.exitInitializationMode()
        self.body.updateDiscreteStates()
        self.body.enterStepMode()
        self.outputs = [names["contact[1].displacement"], names["contact[1].velocity"]]
        self.inputs = [names["contact[1].applied_restitution"], names["contact[1].applied_force"]]
        self.stop_inputs = [stop_names["displacement"], stop_names["velocity"]]
        self.answers = [stop_names["applied_restitution"], stop_names["applied_force"]]
        self.time = 0.0

    def advance(self, end: float) -> int:
        """Advance to `end`; return the number of impacts."""
        impacts, body, stop = 0, self.body, self.stop
        while self.time < end:
            body.setFloat64(self.inputs, stop.getFloat64(self.answers))
            event, _, _, reached = body.doStep(
                currentCommunicationPoint=self.time, communicationStepSize=end - self.time
            )
            stop.setFloat64(self.stop_inputs, body.getFloat64(self.outputs))
            stop.doStep(currentCommunicationPoint=self.time, communicationStepSize=reached - self.time)
            self.time = reached
            if event:
                impacts += 1
                body.enterEventMode()
                body.setFloat64(self.inputs, stop.getFloat64(self.answers))
                body.updateDiscreteStates()
                body.enterStepMode()
        return impacts


def impact_table() -> bool:
    """Print the microseconds per coupled impact; return whether the goals are met."""
    ours = {}
    for versions_used in (("3.0", "3.0"), ("3.0", "2.0"), ("2.0", "2.0")):
        importer = Importer(
            [body("body", {**P11, **external(1.0)}, versions_used[0]), stop("stop", 0.7, versions_used[1])],
            contact("body", "stop"),
        )
        importer.begin()
        ours["+".join(versions_used)] = importer
    fmpy = FmpyCoupled()
    by_python = Importer([body("body", {**P11, **external(1.0)}), stop("stop", 0.7)], contact("body", "stop"))
    by_python.steps_in_c = False
    by_python.begin()
    fused = Importer([body("body", {**P11, **external(1.0), "contact[1].law": "restitution"})])
    fused.begin()

    def coupled(importer: Importer) -> Callable[[], int]:
        def run() -> int:
            steps = importer.steps
            importer.advance(importer.time + 2000 * PERIOD)
            return importer.steps - steps - 1

        return run

    def alone() -> int:
        fused.advance(fused.time + 2000 * PERIOD)
        return 2000

    tasks = {f"importer, FMI {name}": coupled(importer) for name, importer in ours.items()}
    tasks["importer, FMI 3.0+3.0, step by step in Python"] = coupled(by_python)
    tasks["FMPy's classes, FMI 3.0+3.0"] = lambda: fmpy.advance(fmpy.time + 2000 * PERIOD)
    tasks["the Oscillator alone, fused"] = alone
    for task in tasks.values():
        task()
    found = dict(zip(tasks, timed(*tasks.values()), strict=True))
    print("\ncoupled impact (Oscillator + ImpactStop, P(1,1))     median      min  us")
    for name, seconds in found.items():
        print(f"  {name:48}{micro(seconds)}")
    held = True
    for name, goal in IMPACT_GOALS.items():
        error = phase_error(values(ours[name], "body", "contact[1].last_phase")[0], P11_PHASE)
        median = statistics.median(found[f"importer, FMI {name}"]) * 1e6
        print(f"  FMI {name}: {verdict(median, goal, 'us')}")
        print(f"    error of the impact phase {error:.1e} rad, {verdict(error, ERROR_GOAL, 'rad')}")
        held = held and median <= goal and error <= ERROR_GOAL
    return held


def step_table() -> bool:
    """Print the microseconds per plain step of one FMU; return whether the goal is met."""
    importer = Importer([body("body", {"displacement_start": 1.0})], macro_step=0.01)
    importer.begin()
    fmu, _ = fmpy_instance("Oscillator", event_mode=False, parameters={"displacement_start": 1.0})
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    reached = 0.0

    def ours() -> int:
        steps = importer.steps
        importer.advance(importer.time + 100.0)
        return importer.steps - steps

    def fmpy() -> int:
        nonlocal reached
        for _ in range(10_000):
            fmu.doStep(currentCommunicationPoint=reached, communicationStepSize=0.01)
            reached += 0.01
        return 10_000

    found = timed(ours, fmpy)
    print("\nplain doStep of one Oscillator, FMI 3.0, H = .01     median      min  us")
    for name, seconds in zip(("importer", "FMPy's class"), found, strict=True):
        print(f"  {name:48}{micro(seconds)}")
    median = statistics.median(found[0]) * 1e6
    print(f"  {verdict(median, STEP_GOAL, 'us')}")
    return median <= STEP_GOAL


# ---- a ball without events of its own ----


def fixed_step_bounces(importer: Importer, step: float, end: float) -> list[float]:
    """Return the times at which a plain loop sees the ball's velocity turn upwards."""
    importer.begin()
    instance, times, speed = importer.components["ball"].instance, [], 0.0
    velocity = importer.components["ball"].group("Float64", ["v"])
    for k in range(round(end / step)):
        instance.step(k * step, step)
        before, speed = speed, float(velocity.get()[0])
        if before <= 0.0 < speed:
            times.append((k + 1) * step)
    return times


def revision(fmu: Path, step: float, end: float, found: dict[str, list[float]]) -> Callable[[], int]:
    importer = Importer([part("ball", fmu)], events=[EventSpec("ball", "h")], macro_step=step)
    events = events_of(importer)

    def run() -> int:
        events.clear()
        importer.begin()
        importer.advance(end)
        found["step revision"] = [event.time for event in events]
        return 1

    return run


def fixed_steps(fmu: Path, step: float, end: float, found: dict[str, list[float]]) -> Callable[[], int]:
    importer = Importer([part("ball", fmu)])

    def run() -> int:
        found["plain fixed steps"] = fixed_step_bounces(importer, step, end)
        return 1

    return run


def ball_table(folder: Path) -> None:
    """Print bounce times and cost by step revision and by a plain loop."""
    fmu, end = bouncing_ball(folder), 2.0
    exact = bounce_times(4)
    print("\nblack-box ball (FMI 2.0), bounces up to 2 s      error of bounce 1  largest of 4  cost, ms")
    for step in (0.1, 0.001):
        found: dict[str, list[float]] = {}
        revise, loop = revision(fmu, step, end, found), fixed_steps(fmu, step, end, found)
        for name, seconds in zip(("step revision", "plain fixed steps"), timed(revise, loop), strict=True):
            times = np.array(found[name][: len(exact)])
            error = np.abs(times - exact[: len(times)])
            count = "" if len(times) == len(exact) else f" (of {len(times)})"
            cost = f"{statistics.median(seconds) * 1e3:8.2f}"
            print(f"  {name:20} H = {step:<24g}{error[0]:13.1e}{error.max():14.1e}{count}{cost}")


# ---- the guard ----

GUARDED = """
[scene]
units = "SI"
[component.b]
fmu = "Oscillator"
[component.b.parameters]
damping = 0.2
"forcing.amplitude" = 0.5
"forcing.angular_frequency" = 1.0
"contact[1].law" = "external"
"contact[1].side" = "upper"
"contact[1].position" = 1.0
[component.s]
fmu = "ImpactStop"
parameters = {{ restitution = 0.7 }}
[[connection]]
from = "b.contact[1].displacement"
to = "s.displacement"
[[connection]]
from = "b.contact[1].velocity"
to = "s.velocity"
[[connection]]
from = "s.applied_restitution"
to = "b.contact[1].applied_restitution"
[[connection]]
from = "s.applied_force"
to = "b.contact[1].applied_force"
[record]
recorded_time = {end}
[execution]
guard = {guard}
macro_step = {step}
"""


POINTS, POINT_TIME, PAIRS, GUARD_ROUNDS = 20, 0.010, 9, 8
"""Points of a chunk; processor time of a point without a guard, s; pairs of runners; turns of a pair. The placement of
a process's memory changes times by some per cent: so there are several pairs, each of fresh processes."""


def guard_table() -> bool:
    """Print the cost of a guarded child process for points of about 10 ms, run as by a worker of a campaign.

    Return whether the goal is met.
    """
    print(
        "\nguard, points of about 10 ms      alone, ms   cost of the guard, %: processor time (quartiles)   wall time"
    )
    worst = -math.inf
    for name, unit, step in (("impacts", PERIOD, 1e9), ("steps", 0.01, 0.01)):
        count = 500
        for _ in range(2):  # a point has a fixed cost too, which is not small against 500 impacts or steps
            count = int(
                count * POINT_TIME / statistics.median(chunk_times(count * unit, step, rounds=2)[0][0])
            )
        pairs = np.array([chunk_times(count * unit, step, rounds=GUARD_ROUNDS) for _ in range(PAIRS)])
        times = np.median(pairs, axis=-1)  # pair, processor or wall, alone or guarded
        costs = times[..., 1] / times[..., 0] * 100.0 - 100.0
        low, middle, high = np.percentile(costs[:, 0], (25, 50, 75))
        worst = max(worst, float(middle))
        print(
            f"  {f'{count} {name}':30}{np.median(times[:, 0, 0]) * 1e3:11.2f}{middle:28.1f} ({low:.1f} to {high:.1f})"
            f"{np.median(costs[:, 1]):18.1f}"
        )
    print(f"  {verdict(worst, GUARD_GOAL, '%')}")
    return worst <= GUARD_GOAL


def chunk_times(end: float, step: float, rounds: int) -> tuple[list[list[float]], list[list[float]]]:
    """Return processor and wall times of a point, s: each without and with a guard, in turn; means of a chunk."""
    scenes = [
        parse_scene(GUARDED.format(end=end, step=step, guard=guard), "guard.toml")
        for guard in ("false", "true")
    ]
    runners = [open_scene(scene) for scene in scenes]
    # Linux derives the clock of a process from its number
    clocks = [~child.pid << 3 | 2 for child in psutil.Process().children(recursive=True)]

    def spent() -> float:
        return time.process_time() + sum(map(time.clock_gettime, clocks))

    points = independent_points({}, POINTS)
    processor: list[list[float]] = [[], []]
    wall: list[list[float]] = [[], []]
    for turn in range(-1, rounds):  # the first turn is not counted
        for way in (0, 1) if turn % 2 else (1, 0):
            before, began = spent(), time.perf_counter()
            runners[way].rows(points)
            seconds = time.perf_counter() - began
            if turn >= 0:
                processor[way].append((spent() - before) / POINTS)
                wall[way].append(seconds / POINTS)
    for runner in runners:
        runner.close()
    return processor, wall


def main() -> int:
    """Measure and print; return 1 if a goal is missed."""
    argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    ).parse_args()
    load = f", load {os.getloadavg()[0]:.2f}" if hasattr(os, "getloadavg") else ""
    print(
        f"{platform.processor() or platform.machine()}, {os.cpu_count()} processors{load}, {platform.system()}"
    )
    print(", ".join(f"{name} {version}" for name, version in versions().items()))
    with tempfile.TemporaryDirectory() as made:
        held = [impact_table(), step_table()]
        ball_table(Path(made))
        held.append(guard_table())
    return 0 if all(held) else 1


if __name__ == "__main__":
    sys.exit(main())

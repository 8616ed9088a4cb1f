"""The fused Oscillator in one step over many periods against plain loops and scipy's solve_ivp, on the same orbit.

P(1,1) of m=1, k=1, zeta=.1, F=.5, w=1, r=.7, stop 1; phase and velocity of its impacts are known in closed form.
The plain loop, in C and by numba (extra `bench`), is the 40 lines that a student would write; nothing in it is
certified. All are timed in turns, several times, in one process; medians are compared.

Run with `python tests/benchmarks/bench_fused.py [--impacts 1000000] [--repetitions 7] [--output FOLDER]`.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import math
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from vibroimpact.orchestrator.run import PointRunner
from vibroimpact.orchestrator.scene import parse_scene

PHASE, VELOCITY = 0.3665212101960540571, 0.7910497883492130773
PERIOD = 2.0 * math.pi
DAMPING, FORCE, STOP, RESTITUTION = 0.2, 0.5, 1.0, 0.7
#: Impacts of a run of solve_ivp: it is far slower, and its time per impact does not depend on their number.
PEER_IMPACTS = 100
PLAIN_IMPACTS = 100_000

SCENE = """
[scene]
units = "nondimensional"
[body]
mass = 1.0
stiffness = 1.0
damping = {DAMPING}
displacement_start = {STOP}
velocity_start = {velocity!r}
[forcing]
amplitude = {FORCE}
angular_frequency = 1.0
phase = {PHASE!r}
[[stop]]
position = {STOP}
restitution = {RESTITUTION}
[record]
transient_periods = {impacts}
recorded_periods = 1
"""


class Fused:
    """The Oscillator FMU, through the runner that campaigns use."""

    name = "fused Oscillator, one step"

    def __init__(self, impacts: int) -> None:
        self.impacts = impacts
        values = {**globals(), "velocity": -RESTITUTION * VELOCITY, "impacts": impacts}
        self.runner = PointRunner(parse_scene(SCENE.format_map(values), "bench_fused.toml"))

    def run(self) -> tuple[float, float, float]:
        """Return seconds per impact, and the errors of phase (rad) and velocity of the last impact."""
        began = time.perf_counter()
        record = self.runner.run({})
        seconds = time.perf_counter() - began
        assert record.impacts is not None
        _, phase, velocity, *_ = record.impacts[-1]
        return seconds / self.impacts, abs(phase - PHASE), abs(velocity - VELOCITY)


class Peer:
    """scipy's solve_ivp, stopped by an event at every impact and restarted after it."""

    def __init__(self, tolerance: float) -> None:
        self.name = f"solve_ivp RK45, rtol {tolerance:g}, events"
        self.tolerance = tolerance

    @staticmethod
    def _slope(t: float, y: Sequence[float]) -> list[float]:
        return [y[1], FORCE * math.cos(t) - DAMPING * y[1] - y[0]]

    def run(self) -> tuple[float, float, float]:
        """Return seconds per impact, and the errors of phase (rad) and velocity of the last impact."""

        def contact(t: float, y: Sequence[float]) -> float:
            return y[0] - STOP

        contact.terminal, contact.direction = True, 1.0  # type: ignore[attr-defined]
        t, state = PHASE, np.array([STOP, -RESTITUTION * VELOCITY])
        began = time.perf_counter()
        for _ in range(PEER_IMPACTS):
            found = solve_ivp(
                self._slope,
                (t, t + 10.0),
                state,
                rtol=self.tolerance,
                atol=self.tolerance * 1e-3,
                events=contact,
            )
            t, state = found.t[-1], np.array([STOP, -RESTITUTION * found.y[1, -1]])
        seconds = time.perf_counter() - began
        velocity = -state[1] / RESTITUTION
        phase = math.remainder(t - PHASE, PERIOD)
        return seconds / PEER_IMPACTS, abs(phase), abs(velocity - VELOCITY)


def compiled_loop() -> Callable[[int], tuple[float, float]]:
    """Return the loop in C, compiled for this processor: from impacts to phase and velocity of the last one."""
    with tempfile.TemporaryDirectory() as folder:
        built = Path(folder, "plain_loop.so")
        command = [os.environ.get("CC", "cc"), "-O3", "-march=native", "-shared", "-fPIC", "-o", str(built)]
        subprocess.run([*command, str(Path(__file__).with_name("plain_loop.c")), "-lm"], check=True)
        plain_loop = ctypes.CDLL(str(built)).plain_loop
    plain_loop.restype = ctypes.c_double
    plain_loop.argtypes = [ctypes.c_double] * 6 + [ctypes.c_long, ctypes.POINTER(ctypes.c_double)]

    def loop(impacts: int) -> tuple[float, float]:
        velocity = ctypes.c_double()
        given = (DAMPING, FORCE, STOP, RESTITUTION, PHASE, VELOCITY, impacts)
        return plain_loop(*given, ctypes.byref(velocity)), velocity.value

    return loop


def loop_by_numba() -> Callable[[int], tuple[float, float]]:
    """Return the same loop, compiled by numba when it is first called."""
    import numba

    compiled: Callable[[int], tuple[float, float]] = numba.njit(_loop)
    return compiled


def _loop(impacts: int) -> tuple[float, float]:
    """The loop of plain_loop.c, line by line."""
    step, decay, amplitude = PERIOD / 16, DAMPING / 2, FORCE / DAMPING
    fast = math.sqrt(1.0 - decay * decay)
    e, c, s = math.exp(-decay * step), math.cos(fast * step), math.sin(fast * step) / fast
    m11, m12, m21, m22 = e * (c + decay * s), e * s, -e * s, e * (c - decay * s)
    along, across, t, v = math.cos(step), math.sin(step), PHASE, VELOCITY
    for _ in range(impacts):
        p, q, at = amplitude * math.sin(t), amplitude * math.cos(t), STOP
        x, y = STOP - p, -RESTITUTION * v - q
        while True:
            x1, y1 = m11 * x + m12 * y, m21 * x + m22 * y
            p1, q1 = p * along + q * across, q * along - p * across
            if x1 + p1 >= STOP > at:
                a, fa, b, fb, ey, eq = 0.0, at - STOP, step, x1 + p1 - STOP, 0.0, 0.0
                for _ in range(30):
                    tau = b if b == a else b - fb * (b - a) / (fb - fa)
                    g, co, si = math.exp(-decay * tau), math.cos(fast * tau), math.sin(fast * tau) / fast
                    ex, ey = g * (co * x + si * (y + decay * x)), g * (co * y - si * (x + decay * y))
                    ep, eq = amplitude * math.sin(t + tau), amplitude * math.cos(t + tau)
                    a, fa, b, fb = b, fb, tau, ex + ep - STOP
                    if abs(fb) < 1e-15 or fb == fa:
                        break
                t, v = (t + b) % PERIOD, ey + eq
                break
            t, x, y, p, q = t + step, x1, y1, p1, q1
            at = x + p
    return t, v


class Plain:
    """A plain loop over the impacts."""

    def __init__(self, name: str, loop: Callable[[int], tuple[float, float]], impacts: int) -> None:
        self.name, self.impacts, self._loop = name, impacts, loop
        loop(1)

    def run(self) -> tuple[float, float, float]:
        """Return seconds per impact, and the errors of phase (rad) and velocity of the last impact."""
        began = time.perf_counter()
        phase, velocity = self._loop(self.impacts)
        seconds = time.perf_counter() - began
        return seconds / self.impacts, abs(phase - PHASE), abs(velocity - VELOCITY)


def machine(*others: str) -> dict[str, str]:
    """Return the processor and the versions of the packages, for the record of the figures."""
    model = platform.processor()
    if Path("/proc/cpuinfo").is_file():
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        model = next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), model)
    compiler = os.environ.get("CC", "cc")
    try:
        output = subprocess.run([compiler, "--version"], capture_output=True, text=True, check=True).stdout
        compiler = output.splitlines()[0]
    except (OSError, subprocess.CalledProcessError):
        compiler = "unknown"
    packages = {name: version(name) for name in ("numpy", "scipy", *others)}
    return {
        "processor": f"{model} ({platform.machine()})",
        "cores": str(os.cpu_count()),
        "system": platform.platform(),
        "python": platform.python_version(),
        "compiler": compiler,
        **packages,
    }


def measure(impacts: int, repetitions: int) -> list[dict[str, float | str]]:
    """Time all in turns; return medians and the largest errors."""
    candidates: list[Fused | Plain | Peer] = [
        Fused(impacts),
        Plain("a C loop of 40 lines, not certified", compiled_loop(), PLAIN_IMPACTS),
        Plain("the same by numba", loop_by_numba(), PLAIN_IMPACTS),
        Peer(1e-6),
        Peer(1e-10),
    ]
    runs: dict[str, list[tuple[float, float, float]]] = {c.name: [] for c in candidates}
    for turn in range(repetitions):
        for candidate in candidates if turn % 2 == 0 else reversed(candidates):
            runs[candidate.name].append(candidate.run())
    return [
        {
            "name": name,
            "microseconds_per_impact": 1e6 * statistics.median(seconds for seconds, _, _ in found),
            "fastest": 1e6 * min(seconds for seconds, _, _ in found),
            "slowest": 1e6 * max(seconds for seconds, _, _ in found),
            "phase_error": max(phase for _, phase, _ in found),
            "velocity_error": max(velocity for _, _, velocity in found),
        }
        for name, found in runs.items()
    ]


def main() -> int:
    """Measure, print the table, write `bench_fused.json`; return 1 if the ratio is below its goal."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--impacts", type=int, default=1_000_000)
    parser.add_argument("--repetitions", type=int, default=7)
    parser.add_argument("--output", type=Path, default=None)
    options = parser.parse_args()
    rows, host = measure(options.impacts, options.repetitions), machine("numba")
    times = [float(row["microseconds_per_impact"]) for row in rows]
    by_c, by_numba, ratio = (time_ / times[0] for time_ in times[1:4])
    print("; ".join(f"{key} {value}" for key, value in host.items()))
    print(
        f"{'':38}{'us per impact':>14}{'fastest':>10}{'slowest':>10}{'phase error':>13}{'velocity error':>16}"
    )
    for row in rows:
        print(
            f"{row['name']:38}{row['microseconds_per_impact']:14.3f}{row['fastest']:10.3f}{row['slowest']:10.3f}"
            f"{row['phase_error']:13.1e}{row['velocity_error']:16.1e}"
        )
    print(
        f"{options.impacts} impacts, {options.repetitions} runs in turns: the fused Oscillator is {by_c:.1f} times as "
        f"fast as the C loop, {by_numba:.1f} as numba, {ratio:,.0f} as solve_ivp RK45 at rtol 1e-6, and exact to "
        f"{rows[0]['phase_error']:.0e} rad."
    )
    if options.output is not None:
        options.output.mkdir(parents=True, exist_ok=True)
        result = {
            "machine": host,
            "impacts": options.impacts,
            "ratio": ratio,
            "ratio_c_loop": by_c,
            "ratio_numba": by_numba,
            "rows": rows,
        }
        (options.output / "bench_fused.json").write_text(
            json.dumps(result, indent=2) + "\n", encoding="utf-8"
        )
    good = (
        ratio >= 1000.0
        and float(rows[0]["phase_error"]) <= 1e-13
        and float(rows[0]["velocity_error"]) <= 1e-13
    )
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())

"""An up-down sweep of the impact oscillator by a textbook event simulation, independent of the C core.

Free flight in closed form (thesis eqs. 2.12-2.31), the next contact by a step that cannot pass a root, Newton
restitution. Slow and plain on purpose: it makes the data for the tests of readers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.dataset import Direction, Outcome, RunRecord, build_dataset

SCENE = """
[scene]
title = "Impact oscillator"
units = "nondimensional"
[body]
kind = "oscillator"
mass = 1.0
stiffness = 1.0
damping_ratio = 0.05
[forcing]
amplitude = 0.5
angular_frequency = 1.0
[[stop]]
law = "restitution"
position = 1.0
side = "upper"
restitution = 0.7
"""
ZETA, FORCE, STOP, RESTITUTION = 0.05, 0.5, 1.0, 0.7


@dataclass
class Oscillator:
    """The oscillator at one angular frequency, with its state at forcing phase zero."""

    w: float
    displacement: float
    velocity: float

    def __post_init__(self) -> None:
        self.transfer = FORCE / complex(1 - self.w**2, 2 * ZETA * self.w)
        self.period = 2 * math.pi / self.w
        self.damped = math.sqrt(1 - ZETA**2)

    def flow(self, x: float, v: float, phase: float, u: float) -> tuple[float, float]:
        """Return displacement and velocity after a time u, without contact."""
        now = self.transfer * complex(math.cos(phase), math.sin(phase))
        later = self.transfer * complex(math.cos(phase + self.w * u), math.sin(phase + self.w * u))
        h, g = x - now.real, v + self.w * now.imag
        decay = math.exp(-ZETA * u)
        s, c = decay * math.sin(self.damped * u) / self.damped, decay * math.cos(self.damped * u)
        return (c + ZETA * s) * h + s * g + later.real, -s * h + (c - ZETA * s) * g - self.w * later.imag

    def contact(self, x: float, v: float, phase: float, limit: float) -> float | None:
        """Return the time to the next contact, or None if there is none before the limit."""
        now = self.transfer * complex(math.cos(phase), math.sin(phase))
        h, g = x - now.real, v + self.w * now.imag
        bound = math.hypot(h, (g + ZETA * h) / self.damped) + self.w**2 * abs(self.transfer)
        u, here, speed = 0.0, x, v
        for step in range(1000):
            clearance = max(STOP - here, 0.0)
            root = math.sqrt(speed**2 + 2 * bound * clearance)
            ahead = 2 * clearance / (speed + root) if speed > 0 else (root - speed) / bound
            if step and speed > 0 and clearance < 1e-14:
                return u
            u += ahead
            if u >= limit:
                return None
            here, speed = self.flow(x, v, phase, u)
        raise AssertionError("no contact found")

    def advance(self, impacts: list[list[float]] | None, start: float) -> NDArray[np.float64]:
        """Advance by one forcing period; return its largest and smallest displacement and its impacts."""
        x, v, elapsed, hits = self.displacement, self.velocity, 0.0, 0
        extremes = [-math.inf, math.inf]
        while True:
            phase, left = self.w * elapsed, self.period - elapsed
            flight = self.contact(x, v, phase, left)
            if impacts is not None:
                samples = [self.flow(x, v, phase, u)[0] for u in np.linspace(0, flight or left, 400)]
                extremes = [max(extremes[0], *samples), min(extremes[1], *samples)]
            if flight is None:
                self.displacement, self.velocity = self.flow(x, v, phase, left)
                return np.array([min(extremes[0], STOP), extremes[1], hits])
            _, speed = self.flow(x, v, phase, flight)
            elapsed, hits, x, v = elapsed + flight, hits + 1, STOP, -RESTITUTION * speed
            if impacts is not None:
                impacts.append([start + elapsed, self.w * elapsed, speed, (1 + RESTITUTION) * speed, 1])


def run(oscillator: Oscillator, transient: int, recorded: int) -> RunRecord:
    """Let transients decay, then record some periods."""
    for _ in range(transient):
        oscillator.advance(None, 0.0)
    impacts: list[list[float]] = []
    periods = []
    for k in range(recorded):
        strobe = [oscillator.displacement, oscillator.velocity]
        largest, smallest, hits = oscillator.advance(impacts, k * oscillator.period)
        periods.append([largest, smallest, *strobe, hits])
    return RunRecord(
        Outcome.ok,
        "",
        np.array(periods),
        np.array(impacts).reshape(-1, 5),
        np.empty((0, 3)),
        None,
        oscillator.displacement,
        oscillator.velocity,
        0.0,
        1e-3,
    )


def up_down_sweep(points: int, transient: int, recorded: int) -> xr.Dataset:
    """Sweep the angular frequency from 0.6 to 1.6 and back; each run starts from the end of its neighbour."""
    grid = np.linspace(0.6, 1.6, points)
    records, state = [], (0.0, 0.0)
    for values in (grid, grid[::-1]):
        state = (0.0, 0.0)
        for w in values:
            records.append(run(Oscillator(float(w), *state), transient, recorded))
            state = (records[-1].final_displacement, records[-1].final_velocity)
    return build_dataset(
        records,
        coordinates={"angular_frequency": np.concatenate([grid, grid[::-1]])},
        direction=[Direction.up] * points + [Direction.down] * points,
        run_index=np.arange(2 * points),
        units="nondimensional",
        unit_of={"angular_frequency": "rad s-1"},
        attrs={"scene": SCENE},
    )

"""Records of impacting motion with known parameters, simulated by the package's own exact flow."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vibroimpact.analysis.estimation.physics import Forcing, Parameters
from vibroimpact.analysis.recording import Channel, TimeAxis
from vibroimpact.fmus.core import motion

#: Thesis 4.2.5, figure 4.10: F is the static deflection (mm), following y_st = 2.3 mm of figure 4.5.
THESIS = Parameters(
    restitution=0.89,
    damping_ratio=0.1,
    natural_frequency=32.81,
    angular_frequency=64.32,
    static_deflection=2.3,
    phase=0.0,
    stop_position=0.0,
)
#: The worked example of the energy balance: V = 88.24906850683556.
WORKED = Parameters(
    restitution=0.8,
    damping_ratio=0.06,
    natural_frequency=20.0,
    angular_frequency=35.0,
    static_deflection=1.5,
    phase=0.0,
    stop_position=0.4,
)
#: Aperiodic, with impacts of very different strength.
CHAOTIC = Parameters(
    restitution=0.8,
    damping_ratio=0.02,
    natural_frequency=1.0,
    angular_frequency=2.8,
    static_deflection=1.0,
    phase=0.0,
    stop_position=0.0,
)


@dataclass(frozen=True)
class Record:
    """A simulated displacement with its true parameters."""

    time: np.ndarray
    values: np.ndarray
    velocity: np.ndarray
    truth: Parameters

    @property
    def peak(self) -> float:
        return float(np.max(np.abs(self.values)))

    def channel(self, noise: float = 0.0, seed: int = 0) -> Channel:
        """Return the displacement as a channel; `noise` is white, relative to the peak."""
        errors = noise * self.peak * np.random.default_rng(seed).standard_normal(len(self.values))
        return channel_of(self.time, self.values + errors)

    def forcing(self, **changes: float | bool | None) -> Forcing:
        """Return the known force, with changes."""
        known: dict[str, float | bool | None] = {
            "angular_frequency": self.truth.angular_frequency,
            "static_deflection": self.truth.static_deflection,
            "phase": self.truth.phase,
        }
        return Forcing(**(known | changes))  # type: ignore[arg-type]


def channel_of(time: np.ndarray, values: np.ndarray) -> Channel:
    axis = TimeAxis(time, float(time[1] - time[0]))
    return Channel("displacement", values, "m", axis, np.zeros(len(time), np.uint8))


def record_of(
    parameters: Parameters,
    *,
    periods: float = 6.0,
    per_period: float = 100.0,
    settled: float = 60.0,
    start: tuple[float, float] = (0.0, -1.0),
) -> Record:
    """Return a record after a transient; samples fall anywhere in a period, and the first sample has time 0."""
    step = 2.0 * math.pi / parameters.angular_frequency / per_period
    time = np.arange(round(periods * per_period)) * step
    begin = (settled * per_period + 0.37) * step
    x, v = motion(
        parameters.oscillator(),
        start,
        np.append(0.0, begin + time),
        position=parameters.stop_position - parameters.offset,
        restitution=parameters.restitution,
        phase=parameters.phase,
    )
    phase = math.remainder(parameters.phase + parameters.angular_frequency * begin, 2.0 * math.pi)
    truth = Parameters(
        **{name: getattr(parameters, name) for name in Parameters.__dataclass_fields__ if name != "phase"},
        phase=phase % (2.0 * math.pi),
    )
    return Record(time, x[1:] + parameters.offset, v[1:], truth)

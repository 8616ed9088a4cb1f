"""A random force and the displacement of one or two modes, with their parameters: exact for the band-limited force."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.recording import Channel, TimeAxis

RATE = 400.0
BEFORE = 25_536
"""Samples of the force before the record: together with its 40,000 samples they have a fast transform."""


@dataclass(frozen=True)
class Mode:
    """Natural frequency, Hz, damping ratio, and modal constant, 1/kg."""

    frequency: float
    damping_ratio: float
    constant: float = 1.0

    def response(self, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return displacement over force at angular frequencies, rad/s."""
        natural = 2.0 * np.pi * self.frequency
        return self.constant / (natural**2 - omega**2 + 2j * self.damping_ratio * natural * omega)


def channel(name: str, values: NDArray[np.float64], unit: str) -> Channel:
    """Return samples at `RATE` as a channel."""
    axis = TimeAxis(np.arange(len(values)) / RATE, 1.0 / RATE)
    return Channel(name, values, unit, axis, np.zeros(len(values), np.uint8))


def driven(
    modes: tuple[Mode, ...], noise: float, rng: np.random.Generator, samples: int = 40_000
) -> tuple[Channel, Channel]:
    """Return force and displacement; `noise` is relative to the displacement's root mean square."""
    force = rng.normal(size=samples + BEFORE)
    omega = 2.0 * np.pi * np.fft.rfftfreq(len(force), 1.0 / RATE)
    response = sum(mode.response(omega) for mode in modes)
    moved = np.fft.irfft(np.fft.rfft(force) * response, len(force))[BEFORE:]
    moved = moved + noise * np.std(moved) * rng.normal(size=samples)
    return channel("force", force[BEFORE:], "N"), channel("tip", moved, "m")


def drawn_modes(case: int, rng: np.random.Generator) -> tuple[tuple[Mode, ...], float]:
    """Return the modes of a case and its noise: one mode of 20 Hz, in two cases of three with a close second mode."""
    ratio = 10.0 ** rng.uniform(-3.0, np.log10(0.05))
    mode = Mode(20.0, ratio)
    noise = (0.0, 0.01, 0.05, 0.1)[int(rng.integers(4))]
    if case % 3 == 0:
        return (mode,), noise
    apart = rng.uniform(0.6, 3.0) * rng.choice([-1.0, 1.0])
    constant = 10.0 ** rng.uniform(-0.5, 0.5) * rng.choice([-1.0, 1.0])
    return (mode, Mode(20.0 + apart, ratio * 10.0 ** rng.uniform(-0.3, 0.3), constant)), noise

"""Signals for the tests of the Replay FMU, and an instance of it driven by FMPy, an independent importer."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from fmpy import read_model_description
from numpy.typing import NDArray

from support.component_fmu import ComponentFmu
from vibroimpact.fmus.packaging.replay_fmu import ReplaySignal

INTERVAL = 1.0 / 3000.0
COUNT = 600
JUMP = 200
#: Last good sample before and first after a gap of the channel `gappy`; its first two and last three are missing too.
GAP = (100, 131)
DAY = 86400.0
#: Steepest slope of the records, at the jump, 1/s.
STEEPEST = 55.0 / INTERVAL


def noise(seed: int, count: int = COUNT) -> NDArray[np.float64]:
    return np.random.default_rng(seed).normal(size=count)


def base_values() -> NDArray[np.float64]:
    """Return noise with a jump of 50 between two samples."""
    return noise(1) + np.where(np.arange(COUNT) >= JUMP, 50.0, 0.0)


def gappy_values() -> NDArray[np.float64]:
    values = noise(2)
    values[:2] = values[GAP[0] + 1 : GAP[1]] = values[-3:] = np.nan
    return values


def uneven_times() -> NDArray[np.float64]:
    return -0.05 + np.cumsum(np.random.default_rng(3).uniform(1e-4, 1e-3, COUNT))


SIGNALS = {
    "base": ReplaySignal.evenly(base_values(), "m s-2", INTERVAL),
    "gappy": ReplaySignal.evenly(gappy_values(), "9.80665 m s-2", INTERVAL),
    "force": ReplaySignal(uneven_times(), noise(4), "N"),
    "late": ReplaySignal.evenly(noise(5), "1", INTERVAL, start=DAY),
}


class Player(ComponentFmu):
    """An instance of a Replay FMU."""

    def __init__(self, path: Path, start: float = 0.0, **parameters: float) -> None:
        version = str(read_model_description(str(path)).fmiVersion)
        self.start = start
        super().__init__(path, parameters, version=version, start_time=start)

    def now(self, name: str) -> tuple[float, float, bool]:
        return self.get(name), self.get(f"{name}_rate"), bool(self.get(f"{name}_valid"))

    def at(self, name: str, time: float) -> tuple[float, float, bool]:
        """Return value, rate and validity at `time`, which may be before the current time, not before the start."""
        self.time = self.start
        self.step(time - self.start)
        return self.now(name)

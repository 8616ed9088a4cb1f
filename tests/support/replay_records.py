"""Signals that the tests of the Replay FMU play, and an instance of it driven by FMPy as any tool would."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from numpy.typing import NDArray

from vibroimpact.fmus.packaging.replay_fmu import ReplaySignal

INTERVAL = 1.0 / 3000.0
COUNT = 600
JUMP = 200
#: First and last good sample around each gap of the channel `gappy`; its first two and last three are missing too.
GAP = (100, 131)
DAY = 86400.0
#: Steepest slope of the records, that of the jump, 1/s.
STEEPEST = 55.0 / INTERVAL


def noise(seed: int, count: int = COUNT) -> NDArray[np.float64]:
    return np.random.default_rng(seed).normal(size=count)


def base_values() -> NDArray[np.float64]:
    """Noise with a jump of 50 between two samples."""
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


class Player:
    """An instance by FMPy's own class."""

    def __init__(self, path: Path, folder: Path, start: float = 0.0, **parameters: float) -> None:
        description = read_model_description(str(path))
        self.references = {v.name: v.valueReference for v in description.modelVariables}
        self.unzipped = folder if folder.exists() else Path(extract(str(path), str(folder)))
        self.fmu = FMU2Slave(
            guid=description.guid,
            unzipDirectory=str(self.unzipped),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="record",
        )
        self.fmu.instantiate()
        for name, value in parameters.items():
            self.fmu.setReal([self.references[name]], [value])
        self.fmu.setupExperiment(startTime=start)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        self.time = start

    def step(self, size: float) -> None:
        self.fmu.doStep(self.time, size)
        self.time += size

    def now(self, name: str) -> tuple[float, float, bool]:
        value, rate = self.fmu.getReal([self.references[name], self.references[f"{name}_rate"]])
        return value, rate, bool(self.fmu.getBoolean([self.references[f"{name}_valid"]])[0])

    def at(self, name: str, time: float) -> tuple[float, float, bool]:
        self.step(time - self.time)
        return self.now(name)

"""Recordings and scenes of replays for the tests: a board clamped at both ends, hit through its base."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.recording import Channel, Recording, TimeAxis, write_recording

Floats = NDArray[np.float64]

BOARD = """
[body]
kind = "beam"
boundary = "clamped-clamped"
length = 0.1
mass_per_length = 0.3
frequency = 800.0
modes = 1
damping_ratio = 0.01

[sensor]
location = 0.5
gain = 0.9

[replay]
drive = "base_acceleration"
from = "base"
compare = [{ simulated = "beam.sensor.acceleration", measured = "board" }]
"""
G = 9.80665
HIT_RATE = 20_000.0


def channel(name: str, time: Floats, values: Floats, unit: str = "m s-2", trigger: str = "") -> Channel:
    """Return a channel on an axis of its own."""
    axis = TimeAxis(time, float(np.mean(np.diff(time))), trigger=trigger)
    return Channel(name, values, unit, axis, np.zeros(len(time), np.uint8), name, {"role": "measured"})


def pulse(time: Floats, size: float = 4000.0) -> Floats:
    """Return a bell of .2 ms half width at 5 ms, m/s^2."""
    return size * np.exp(-(((time - 0.005) / 0.0002) ** 2))


def written(path: Path, *channels: Channel) -> Path:
    """Write a recording of these channels."""
    write_recording(Recording({one.name: one for one in channels}), path)
    return path


def hit(folder: Path, name: str = "hit.nc", seed: int = 1) -> Path:
    """Write a recording of a board that is hit through its base and rings at 820 Hz."""
    time_axis = np.arange(400) / HIT_RATE
    ringing = np.where(
        time_axis < 0.005, 0.0, np.exp(-60.0 * time_axis) * np.sin(2 * np.pi * 820.0 * time_axis)
    )
    noise = np.random.default_rng(seed).normal(size=len(time_axis))
    base = channel("base", time_axis, pulse(time_axis))
    return written(folder / name, base, channel("board", time_axis, 3000.0 * ringing + noise))

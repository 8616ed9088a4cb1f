"""Records with a known answer for the tests of the replay's comparison: a mode is hit, and a sensor measures it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.recording import Channel, Quality, TimeAxis

Floats = NDArray[np.float64]

INTERVAL, COUNT = 5e-5, 4000
FREQUENCY, DAMPING_RATIO = 200.0, 0.01
HIT = 0.02


def ring(time: Floats, frequency: float = FREQUENCY, damping_ratio: float = DAMPING_RATIO) -> Floats:
    """Return the displacement of a mode hit at 0 with 1 / (natural angular frequency); it rests before."""
    natural = 2.0 * np.pi * frequency
    damped = natural * np.sqrt(1.0 - damping_ratio**2)
    after = np.maximum(time, 0.0)
    return np.exp(-damping_ratio * natural * after) * np.sin(damped * after)


def channel(
    values: Floats,
    *,
    interval: float = INTERVAL,
    limit: float = np.inf,
    uncertainty: float = 0.0,
    name: str = "board",
    axis: TimeAxis | None = None,
) -> Channel:
    """Sample values like a measuring chain that clips at a limit."""
    axis = axis or TimeAxis(interval * np.arange(len(values)), interval, uncertainty)
    quality = np.where(np.abs(values) >= limit, int(Quality.clipped), 0).astype(np.uint8)
    quality[~np.isfinite(values)] = int(Quality.missing)
    return Channel(name, np.clip(values, -limit, limit), "m s-2", axis, quality)


def clock(count: int = COUNT) -> Floats:
    return INTERVAL * np.arange(count)

"""The measuring chain of a simulated channel, from its dataset: its clipping limits, and its sampling delay."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.recording.channels import Quality

Floats = NDArray[np.float64]
NUMBERS = ("sensor_range", "sensitivity", "noise_rms", "range", "bits", "clock_error_ppm", "skew")
"""Attributes of a channel that are numbers, or names of the coordinate with one number for each run."""
_DEVIATIONS = 4.0
"""Standard deviations of the noise by which the end of a sensor's range is lowered: noise hides the end."""


@dataclass(frozen=True, slots=True)
class ChannelChain:
    """The measuring chain of a channel."""

    skew: float = 0.0
    """Delay after the time of the dataset, s; 0 for a variable that is no channel."""
    low: float = -np.inf
    high: float = np.inf
    """Limits, V; a sample outside `low` to `high` is at the end of a range."""
    attrs: Mapping[str, Any] = field(default_factory=dict)
    """Attributes of the dataset: `channel`, the name in the scene, and numbers."""

    def quality(self, values: Floats) -> NDArray[np.uint8]:
        """Return the quality flags of samples, see `Quality`."""
        clipped = (values <= self.low) | (values >= self.high)
        return np.where(clipped, np.uint8(Quality.clipped), np.uint8(0))


def chain_of(attributes: Mapping[Any, Any], runs: Any, row: int) -> ChannelChain:
    """Return the measuring chain of a sampled variable with these attributes, in the run of a row.

    The runs are one-dimensional, and have the coordinates of swept numbers.
    """
    if "channel" not in attributes:
        return ChannelChain()

    def number(name: str) -> float:
        entry = attributes[name]
        return float(runs[entry].values[row] if isinstance(entry, str) else entry)

    known = {name: number(name) for name in NUMBERS if name in attributes}
    if isinstance(attributes.get("skew"), str):  # a swept skew counts from channel to channel
        known["skew"] *= float(attributes["place"])
    low, high = -np.inf, np.inf
    if "range" in known:
        step = 2.0 * known["range"] / 2.0 ** known["bits"]
        low, high = -known["range"], known["range"] - step
    if known.get("sensor_range", 0.0) > 0.0:
        most = known["sensor_range"] - _DEVIATIONS * known.get("noise_rms", 0.0)
        step = 0.5 * (2.0 * known["range"] / 2.0 ** known["bits"]) if "range" in known else 0.0
        low, high = max(low, step - most), min(high, most - step)
    seed = {"noise_seed": int(attributes["noise_seed"])} if "noise_seed" in attributes else {}
    attrs = {"channel": str(attributes["channel"]), **known, **seed}
    return ChannelChain(known.get("skew", 0.0), low, high, attrs)

"""A displacement in the form for estimations: samples, quality mask, and noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vibroimpact.analysis.estimation.noise import Mask, noise_level
from vibroimpact.analysis.estimation.physics import Floats
from vibroimpact.analysis.recording import Channel
from vibroimpact.analysis.recording.units import measured_unit, unit_label
from vibroimpact.fmus.errors import EstimationError

_OTHER_UNITS = {"m s-1": "a velocity", "m s-2": "an acceleration", "N": "a force"}


@dataclass(frozen=True, slots=True)
class Signal:
    """A displacement with an upper stop, mirrored for a lower stop."""

    time: Floats
    values: Floats
    """Unit of the displacement; arrays have shape (sample,), time is in s."""
    good: Mask
    """Samples that are plain measurements."""
    interval: float
    """Mean sampling interval, s."""
    sign: float
    """-1 where the signal was mirrored, else 1."""
    noise: float
    """Standard deviation of the noise."""

    @property
    def side(self) -> str:
        """Side of the stop: `upper` or `lower`."""
        return "upper" if self.sign > 0.0 else "lower"

    @property
    def range(self) -> float:
        """Largest minus smallest good sample."""
        return float(np.ptp(self.values[self.good]))


def refuse_other_quantities(channel: Channel) -> None:
    """Raise EstimationError if a channel has the unit of a velocity, an acceleration or a force."""
    si = measured_unit(channel.unit).si
    if si in _OTHER_UNITS:
        raise EstimationError(
            f"{channel.name}: expected a displacement, got {_OTHER_UNITS[si]} ({unit_label(channel.unit)}). "
            "Measure the displacement, or integrate before the import."
        )


def signal_of(channel: Channel) -> Signal:
    """Return a channel as a signal that is not mirrored, with its noise.

    Fewer than 20 neighbouring good samples raise EstimationError.
    """
    values = np.where(channel.good, channel.values, 0.0)
    interval = float(np.median(np.diff(channel.time)))
    return Signal(channel.time, values, channel.good, interval, 1.0, noise_level(values, channel.good))

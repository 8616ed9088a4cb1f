"""The devices that a virtual rig can model."""

from __future__ import annotations

import math
from dataclasses import dataclass

from vibroimpact.hardware.daqmx import constants

TIMEBASE = 100e6
"""Clock that sample clocks divide by an integer, Hz, as in NI's X Series."""


@dataclass(frozen=True, slots=True)
class Profile:
    """The capabilities of a device."""

    product: str
    category: int
    """NI's number of the product category."""
    bits: int
    """Resolution of inputs and outputs."""
    inputs: int
    outputs: int
    """Number of analog channels, as `inputs`."""
    ranges: tuple[float, ...]
    """Input ranges, V, each to both sides of 0, in ascending order."""
    output_range: float
    """Output range, V, to both sides of 0."""
    conversion_rate: float
    """Conversions per second: of all channels together if they are multiplexed, else of each channel."""
    simultaneous: bool
    """Whether all channels are sampled at once."""
    output_rate: float
    """Samples per second and channel."""
    sees_outputs: bool
    """Whether inputs inside the device measure its outputs, as `Dev1/_ao0_vs_aognd`."""

    def highest_rate(self, channels: int) -> float:
        """Return the highest sample rate for a number of inputs, Hz."""
        return self.conversion_rate if self.simultaneous else self.conversion_rate / max(channels, 1)

    @staticmethod
    def clock_rate(rate: float, highest: float) -> float:
        """Return the rate of the sample clock that is nearest to a rate and not above the highest one, Hz.

        >>> round(Profile.clock_rate(44_100.0, 1e6), 1), Profile.clock_rate(5000.0, 1e6)
        (44091.7, 5000.0)
        """
        # a rate of 1e9 / 3 is itself rounded: a divisor of 3.0000000004 is 3
        least = math.ceil(TIMEBASE / highest * (1.0 - 1e-12))
        return TIMEBASE / max(round(TIMEBASE / rate), least)

    def skew(self) -> float:
        """Return the time between the samples of two neighbouring inputs, s."""
        return 0.0 if self.simultaneous else 1.0 / self.conversion_rate

    def input_range(self, low: float, high: float) -> float | None:
        """Return the smallest range that contains an interval of voltages; None if no range does.

        >>> PROFILES["labpc+"].input_range(-0.3, 0.2)
        0.5
        """
        return next((each for each in self.ranges if -each <= low and high <= each), None)


PROFILES = {
    # board of the thesis: 12 us per conversion; gains of 1 to 100
    "labpc+": Profile(
        product="Lab-PC+ (virtual)",
        category=constants.ProductCategory.E_SERIES_DAQ.value,
        bits=12,
        inputs=8,
        outputs=2,
        ranges=(0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0),
        output_range=5.0,
        conversion_rate=83_300.0,
        simultaneous=False,
        output_rate=83_300.0,
        sees_outputs=False,
    ),
    "xseries": Profile(
        product="X Series (virtual)",
        category=constants.ProductCategory.X_SERIES_DAQ.value,
        bits=16,
        inputs=8,
        outputs=2,
        ranges=(1.0, 2.0, 5.0, 10.0),
        output_range=10.0,
        conversion_rate=1_000_000.0,
        simultaneous=True,
        output_rate=900_000.0,
        sees_outputs=True,
    ),
}

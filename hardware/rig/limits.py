"""Limits of an output: the one place for amplitude and slew."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.errors import UsageError

Floats = NDArray[np.float64]

MOST_AMPLITUDE, MOST_SLEW = 5.0, 2000.0
"""Default limits, V and V/s: 5 V at 63 Hz."""
LEAST_FALL, LONGEST_FALL = 0.05, 60.0
"""Shortest and longest time from any voltage down to 0, s."""
_ROUNDING = 1e-9
"""Relative excess over a limit that rounding may cause."""


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of an output.

    Attributes
    ----------
    amplitude : float
        Voltage on both sides of 0, V.
    slew : float
        Slew from one sample to the next, V/s.

    Raises
    ------
    UsageError
        A limit is no number > 0, or the slew takes more than 60 s from the amplitude to 0.

    Examples
    --------
    >>> Limits(5.0, 2000.0).check(np.array([0.1, 0.2]), 0.0, 10_000.0)
    """

    amplitude: float = MOST_AMPLITUDE
    slew: float = MOST_SLEW

    def __post_init__(self) -> None:
        """Raise UsageError unless both limits are valid."""
        for name, value, unit in (("amplitude", self.amplitude, "V"), ("slew", self.slew, "V/s")):
            if not 0.0 < value < math.inf:
                raise UsageError(f"limits: {name}: expected a number > 0, {unit}, got {value!r}.")
        if self._seconds(self.amplitude) > LONGEST_FALL:
            least = 0.5 * math.pi * self.amplitude / LONGEST_FALL
            raise UsageError(
                f"limits: slew: expected at least {least:.3g} V/s, so that {self.amplitude:g} V come down in "
                f"{LONGEST_FALL:g} s, got {self.slew:g}."
            )

    def check(self, volts: Floats, last: float, rate: float, first: int = 0) -> None:
        """Raise UsageError if samples, shape (sample,), are no numbers or beyond the limits.

        The sample before them is `last`, V; the message counts from `first`, the number of the first sample.
        """
        wrong = ~(np.abs(volts) <= self.amplitude * (1.0 + _ROUNDING))
        if wrong.any():
            place = int(np.argmax(wrong))
            raise UsageError(
                f"output: expected numbers from {-self.amplitude:g} to {self.amplitude:g} V, got {volts[place]:g} at "
                f"sample {first + place}."
            )
        steps = np.abs(np.diff(volts, prepend=last)) * rate
        wrong = ~(steps <= self.slew * (1.0 + _ROUNDING))
        if wrong.any():
            place = int(np.argmax(wrong))
            raise UsageError(
                f"output: expected steps of at most {self.slew:g} V/s, got {steps[place]:.4g} at sample "
                f"{first + place}."
            )

    def fall(self, volts: float, rate: float) -> Fall:
        """Return a smooth fall from a voltage to 0, within the slew."""
        return Fall(volts, math.ceil(self._seconds(abs(volts)) * rate) if volts else 1)

    def _seconds(self, volts: float) -> float:
        return max(0.5 * math.pi * volts / self.slew, LEAST_FALL)


@dataclass(frozen=True, slots=True)
class Fall:
    """A half cosine from a voltage (V), which it does not include, to 0, its last sample.

    >>> Fall(2.0, 4).volts(0, 4).round(3).tolist()
    [1.707, 1.0, 0.293, 0.0]
    """

    start: float
    samples: int

    def volts(self, first: int, count: int) -> Floats:
        """Return samples, V; 0 after the end."""
        numbers = np.minimum(np.arange(first, first + count) + 1.0, self.samples)
        found: Floats = 0.5 * self.start * (1.0 + np.cos(np.pi * (numbers / self.samples)))
        return found

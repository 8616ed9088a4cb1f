"""Waveforms of an output: pure functions of the number of a sample."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Protocol

import numpy as np

from vibroimpact.fmus.errors import UsageError
from vibroimpact.hardware.rig.limits import Floats, Limits

_TURN = 2**64
"""Steps of a phase: an unsigned integer of 64 bits wraps by itself."""
_GROUP = 1024


class Waveform(Protocol):
    """The samples of an output: near 0 V at both ends, and always equal for equal numbers."""

    @property
    def samples(self) -> int | None:
        """Number of samples; None: until it is stopped."""

    def volts(self, first: int, count: int) -> Floats:
        """Return samples from the number `first` on, V, shape (count,)."""


def envelope(numbers: Floats, length: int) -> Floats:
    """Return a smooth rise from 0 at number 0 to 1 at `length` and later: a half cosine."""
    if length == 0:
        return np.ones(numbers.shape)
    risen: Floats = 0.5 - 0.5 * np.cos(np.pi * np.clip(numbers / length, 0.0, 1.0))
    return risen


@dataclass(frozen=True, slots=True)
class Sine:
    """A sine that rises over `ramp`, and falls over it before its end, if it has one.

    Its phase is counted in whole steps of 2**-64 of a turn, from an exact fraction. It is as exact after days as at
    the start.

    Attributes
    ----------
    frequency : float
        Hz, below half of the rate.
    amplitude : float
        V.
    rate : float
        Samples per second.
    ramp : float
        s.
    samples : int or None
        None: until it is stopped.

    Raises
    ------
    UsageError

    Examples
    --------
    >>> Sine(1.0, 1.0, 12.0, 0.0).volts(12 * 10**15, 4).round(6).tolist()
    [0.0, 0.5, 0.866025, 1.0]
    """

    frequency: float
    amplitude: float
    rate: float
    ramp: float
    samples: int | None = None
    _turns: Fraction = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Raise UsageError unless the parameters describe a sine."""
        if not 0.0 < self.rate < math.inf:
            raise UsageError(f"--rate: expected a number > 0, Hz, got {self.rate!r}.")
        if not 0.0 < self.frequency < 0.5 * self.rate:
            raise UsageError(
                f"--frequency: expected a number > 0 and below half of the rate, {0.5 * self.rate:g} Hz, got "
                f"{self.frequency!r}."
            )
        if not 0.0 <= self.amplitude < math.inf:
            raise UsageError(f"--amplitude: expected a number >= 0, V, got {self.amplitude!r}.")
        if not 0.0 <= self.ramp * self.rate < 2.0**53:
            raise UsageError(f"--ramp: expected a number >= 0, s, got {self.ramp!r}.")
        if self.samples is not None and self.samples < 2 * self.rise + 1:
            raise UsageError(
                f"--duration: expected more than twice the ramp of {self.ramp:g} s, got {self.samples / self.rate:g}. "
                "Use a longer duration, or a shorter --ramp."
            )
        object.__setattr__(self, "_turns", Fraction(self.frequency) / Fraction(self.rate))

    @property
    def rise(self) -> int:
        """Samples of the ramp."""
        return math.ceil(self.ramp * self.rate)

    @property
    def steepest(self) -> float:
        """Bound of its slew, V/s."""
        ramp = 0.5 * math.pi * self.rate / self.rise if self.rise else 0.0
        return self.amplitude * (2.0 * math.pi * self.frequency + ramp)

    def refuse_beyond(self, limits: Limits) -> None:
        """Raise UsageError for a sine that would pass limits, before anything is driven.

        Raises
        ------
        UsageError
        """
        if self.amplitude > limits.amplitude:
            raise UsageError(
                f"--amplitude: expected at most {limits.amplitude:g} V, got {self.amplitude:g}. "
                "Use a smaller one, or raise --most-amplitude if what is driven bears it."
            )
        if self.steepest > limits.slew:
            raise UsageError(
                f"--amplitude, --frequency, --ramp: expected at most {limits.slew:g} V/s, got {self.steepest:.4g}. "
                "Use smaller ones or a longer ramp, or raise --most-slew if what is driven bears it."
            )

    def phase(self, first: int, count: int) -> Floats:
        """Return phases of samples in turns, from -1/2 to 1/2."""
        # exact every 1024 samples; between them the steps are whole, their rounding 2**-65 of a turn a sample
        step = np.uint64(round(self._turns * _TURN))
        groups = range(first // _GROUP, (first + count - 1) // _GROUP + 1)
        exact = [int(self._turns * (_GROUP * group) % 1 * _TURN) for group in groups]
        begins = np.array(exact, dtype=np.uint64)[:, np.newaxis]
        steps = (begins + np.arange(_GROUP, dtype=np.uint64) * step).ravel()[first % _GROUP :][:count]
        turns: Floats = steps.view(np.int64) / float(_TURN)
        return turns

    def volts(self, first: int, count: int) -> Floats:
        """Return samples, V."""
        numbers = np.arange(first, first + count, dtype=np.float64)
        level = envelope(numbers, self.rise)
        if self.samples is not None:
            level *= envelope(self.samples - 1.0 - numbers, self.rise)
        found: Floats = self.amplitude * level * np.sin(2.0 * np.pi * self.phase(first, count))
        return found

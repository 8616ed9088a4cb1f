"""The analog inputs of a device, which convert voltages to codes."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.core.measuring import gaussian
from vibroimpact.hardware.virtual_rig.plant import Floats
from vibroimpact.hardware.virtual_rig.tasks import Channel


class Inputs:
    """Converts voltages with the noise on their wires, and holds the faults set by a test.

    `noise` is the rms at an input, V, by the number of the input; an input without entry has no noise. The noise
    depends on the seed, on the number of the input and on the number of samples taken before.
    """

    def __init__(
        self, bits: int, noise: Mapping[int, float] | None = None, seed: int = 0, clock_error: float = 0.0
    ) -> None:
        self._bits, self._noise, self._seed = bits, dict(noise or {}), seed
        self._taken: dict[int, int] = {}
        self._usual_error = clock_error
        self.stuck: dict[int, float | None] = {}
        """Voltage that a stuck input keeps, V, by its number; None: the next sampled value."""
        self.clipped: dict[int, float] = {}
        """Voltage of either sign at which an input saturates, V, by its number."""
        self.clock_error = clock_error
        """Error of the input clock against true time, which the output clock keeps, ppm."""

    def mend(self) -> None:
        """Clear all faults."""
        self.stuck.clear()
        self.clipped.clear()
        self.clock_error = self._usual_error

    def codes(self, channel: Channel, volts: Floats) -> NDArray[np.int16]:
        """Return the codes of voltages on the wire of an input, shape (sample,)."""
        volts = self._noisy(channel.number, volts)
        if channel.number in self.clipped and volts.size:
            end = self.clipped[channel.number]
            volts = np.clip(volts, -end, end)
        if channel.number in self.stuck and volts.size:
            kept = self.stuck[channel.number]
            self.stuck[channel.number] = kept = float(volts[0]) if kept is None else kept
            volts = np.full(volts.shape, kept)
        highest = 2 ** (self._bits - 1)
        step = channel.device_range / highest
        found: NDArray[np.int16] = np.clip(np.rint(volts / step), -highest, highest - 1).astype(np.int16)
        return found

    def _noisy(self, number: int, volts: Floats) -> Floats:
        rms = self._noise.get(number, 0.0)
        if rms == 0.0:
            return volts
        first = self._taken.get(number, 0)
        self._taken[number] = first + volts.size
        return volts + rms * gaussian(self._seed, number, first, volts.size)

    def faults(self, device: str) -> Mapping[str, object]:
        """Return the faults, as the control service reports them."""
        return {
            "stuck": {f"{device}/ai{number}": volts for number, volts in self.stuck.items()},
            "clipped": {f"{device}/ai{number}": volts for number, volts in self.clipped.items()},
            "clock_error": self.clock_error,
        }

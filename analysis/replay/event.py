"""The start of the event in a measured record, and the rest of the channel before it.

Everything here comes from the measured signal alone, so that no parameter of a model can change it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.recording import Channel
from vibroimpact.analysis.replay.spectra import FEWEST_SAMPLES, dominant_frequency
from vibroimpact.fmus.errors import EstimationError

Floats = NDArray[np.float64]

HEAD_SHARE, HEAD_FEWEST = 0.02, 16
"""Samples at the start that give the noise: this share of the record, and at least this number."""
ONSET_LEVEL = 0.1
"""Share of the largest deviation at which the event begins, if that is above the noise."""
NOISE_FACTOR = 6.0
"""Standard deviations of the noise beyond which a sample does not belong to it."""
QUIET_PERIODS = 0.5
"""Length of a quiet start, as a share of a period of the event. An oscillation stays within a tenth of its largest
value only for arccos(.9)/pi = 14 % of a period."""
ENERGY_SHARE = 0.99
"""Share of the energy (sum of squares) that has passed at the end of the event."""


@dataclass(frozen=True, slots=True)
class ChannelEvent:
    """The event in a channel.

    Attributes
    ----------
    onset : float
        s on the clock of the channel, at a tenth of the largest deviation or at six times the noise, whichever is more.
        The first sample if the record does not begin quietly.
    end : float
        s: the time at which 99 % of the energy has passed.
    offset : float
        Value of the channel before the event, in its SI unit; 0 if the record does not begin quietly.
    noise : float
        Standard deviation before the event, in the same unit; NaN if the record does not begin quietly.
    quiet : tuple of float or None
        Start and end (s) of the samples that gave offset and noise.
    period : float
        One over the dominant frequency of the event, s.
    """

    onset: float
    end: float
    offset: float
    noise: float
    quiet: tuple[float, float] | None
    period: float


def find_event(measured: Channel) -> ChannelEvent:
    """Find the event of a channel.

    Raises
    ------
    EstimationError
        Fewer than 16 good samples, or all of one value.
    """
    good = measured.good
    time, values = measured.time[good], measured.si()[good]
    if len(values) < HEAD_FEWEST or np.ptp(values) == 0.0:
        raise EstimationError(
            f"{measured.name}: expected at least {HEAD_FEWEST} good samples that are not all equal, got {len(values)} "
            "good samples. Look at the recording: nothing can be compared with it."
        )
    head = values[: max(HEAD_FEWEST, int(HEAD_SHARE * len(values)))]
    rest, noise = float(np.median(head)), float(np.std(head))
    deviation = np.abs(values - rest)
    level = max(ONSET_LEVEL * float(np.max(deviation)), NOISE_FACTOR * noise)
    first = int(np.argmax(deviation >= level))
    if deviation[first] >= level and first >= len(head):
        event = _after_rest(time, values, rest, noise, first)
        if event is not None:
            return event
    end = _end_of_energy(time, values - np.mean(values))
    return ChannelEvent(float(time[0]), end, 0.0, np.nan, None, _period(time, values, float(time[0]), end))


def _after_rest(time: Floats, values: Floats, rest: float, noise: float, first: int) -> ChannelEvent | None:
    """Return the event that begins at sample `first`; None if the part before it is too short for a rest."""
    # a slow precursor between the noise and the onset belongs to neither
    leaves = int(np.argmax(np.abs(values - rest) > NOISE_FACTOR * noise))
    quiet = values[: max(leaves, HEAD_FEWEST)]
    offset = float(np.mean(quiet))
    onset = float(time[first])
    end = _end_of_energy(time[first:], values[first:] - offset)
    period = _period(time, values - offset, onset, end)
    if onset - float(time[0]) < QUIET_PERIODS * period:
        return None
    return ChannelEvent(
        onset, end, offset, float(np.std(quiet)), (float(time[0]), float(time[len(quiet) - 1])), period
    )


def _end_of_energy(time: Floats, values: Floats) -> float:
    energy = np.cumsum(values**2)
    last = int(np.searchsorted(energy, ENERGY_SHARE * energy[-1]))
    return float(time[min(max(last, FEWEST_SAMPLES), len(time) - 1)])


def _period(time: Floats, values: Floats, start: float, end: float) -> float:
    """Return the dominant period between two instants, or their distance without a dominant period."""
    rows = (time >= start) & (time <= end)
    frequency = dominant_frequency(time[rows], values[rows]).frequency
    return 1.0 / frequency if np.isfinite(frequency) else end - start

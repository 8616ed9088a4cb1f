"""The part of a channel in which a body decays freely, as pairs of instant and value."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.recording import Channel, channel_of
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.messages import Argument, message

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

FEWEST_SAMPLES = 16
"""Number of samples below which the five unknowns of a decaying cosine are not fitted."""
WIDEN = message("Widen ", Argument("start"), " and ", Argument("stop"), ".")


@dataclass(frozen=True, slots=True)
class DecaySamples:
    """Good samples of a free decay; their times are used unchanged, evenly spaced or not.

    Attributes
    ----------
    time : ndarray of float, shape (sample,)
        s, ascending.
    value : ndarray of float, shape (sample,)
        In `unit`.
    unit, name : str
        CF unit and name of the channel.
    reference_time : float
        Reference of amplitudes and phases of fits, s: the start of the chosen window.
    remarks : tuple of str
        Samples that were left out, and the reasons.
    """

    time: Floats
    value: Floats
    unit: str = "1"
    name: str = "displacement"
    reference_time: float = 0.0
    remarks: tuple[str, ...] = ()

    @property
    def mean_interval(self) -> float:
        """Mean sampling interval, s."""
        return float(self.time[-1] - self.time[0]) / (len(self.time) - 1)


def decay_samples(
    channel: Channel | xr.DataArray, start: float | None = None, stop: float | None = None
) -> DecaySamples:
    """Return the samples of a channel in a window in which the body decays freely.

    The window includes both ends, in s. Without a start the decay begins at the largest excursion, unless that lies in
    the first twentieth of the record: then nothing is cut.

    Raises
    ------
    UsageError
        The window is empty, or holds too few good samples.
    """
    channel = channel_of(channel)
    time, good = channel.time, channel.good
    if not np.any(good):
        raise UsageError(f"{channel.name}: expected good samples, got none: all are missing or clipped.")
    remarks: list[str] = []
    if start is None:
        start = _largest_excursion(time[good], channel.values[good])
        if start > time[good][0]:
            remarks.append(
                message(
                    f"the decay is taken from the largest excursion, at {start:.6g} s; ",
                    *(Argument("start"), " sets it."),
                )
            )
    remarks += clock_remark(channel)
    stop = float(time[-1]) if stop is None else stop
    chosen = (time >= start) & (time <= stop)
    bad = int(np.count_nonzero(chosen & ~good))
    if bad:
        remarks.append(f"{bad} clipped or missing samples of the window are left out.")
    chosen &= good
    if np.count_nonzero(chosen) < FEWEST_SAMPLES:
        raise UsageError(
            message(
                f"{channel.name}: expected {FEWEST_SAMPLES} good samples or more from {start:g} to {stop:g} s, got "
                f"{np.count_nonzero(chosen)}; the channel runs from {time[0]:g} to {time[-1]:g} s. ",
                WIDEN,
            )
        )
    return DecaySamples(
        time[chosen], channel.values[chosen], channel.unit, channel.name, float(start), tuple(remarks)
    )


def stretches(number: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Return the places of neighbours with equal numbers, one array for each stretch."""
    return np.split(np.arange(len(number)), np.flatnonzero(np.diff(number)) + 1)


def unit_power(unit: str, power: int) -> str:
    """Return the CF unit of a power of a quantity with this unit."""
    if unit == "1":
        return "1"
    return f"({unit}){power}" if " " in unit else f"{unit}{power}"


def clock_remark(channel: Channel) -> list[str]:
    """Return the warning that all frequencies share the uncertainty of the clock, if it has one."""
    error = channel.axis.interval_uncertainty
    words = (
        f"{channel.name}: the clock of this recording is uncertain by {100 * error:.2g} %, and with it every frequency "
        "and decay rate; the standard errors do not count that. Damping ratios do not change."
    )
    return [words] if error else []


def _largest_excursion(time: Floats, value: Floats) -> float:
    """Return the instant of the largest excursion, or the first instant where that is early."""
    excursion = np.abs(value - np.median(value[len(value) // 2 :]))
    peak = float(time[int(np.argmax(excursion))])
    return peak if peak > time[0] + 0.05 * (time[-1] - time[0]) else float(time[0])

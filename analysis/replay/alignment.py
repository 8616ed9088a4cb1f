"""Lag and polarity between a simulated and a measured signal of separate triggers, from the start of the event only.

A choice of lag and sign over a whole record could hide an error of the model's frequency or damping. Here both come
from the first few periods after the onset; the rest of the record must then agree without further adjustment.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.recording import Channel
from vibroimpact.analysis.replay.event import ChannelEvent, find_event
from vibroimpact.fmus.errors import EstimationError

Floats = NDArray[np.float64]

PERIODS_BEFORE, PERIODS_AFTER = 0.5, 3.0
"""The window of the alignment, in dominant periods of the measured event, from its onset."""
FEWEST_SAMPLES = 8
"""Smallest number of good samples in a window."""
CLEAR_ODDS = 100.0
"""Likelihood ratio of the best to a rival lag or polarity below which the choice is ambiguous."""
POOR_CORRELATION = 0.7
"""Correlation below which the model explains less than half of the start of the event."""
CANDIDATES = 3
"""Number of highest peaks of the correlation, for each polarity, that are refined."""
_LAG_TOLERANCE = 1e-6


class Window(NamedTuple):
    """Start and stop, s on the clock of the measured channel."""

    start: float
    stop: float


@dataclass(frozen=True, slots=True)
class Alignment:
    """The clock and the sign that bring a simulated signal to the measured one.

    The aligned signal is polarity * simulated(t - lag), t on the clock of the measured channel.

    Attributes
    ----------
    lag : float
        s, positive where the measured clock is ahead.
    polarity : int
        +1, or -1 where the measured channel is inverted.
    lag_error : float
        s: root of the sum of squares of two errors. One is the standard error from the residual in the window. The
        other is the difference to the lag of the first half of its energy. Ambiguities are not included. 0 for a given
        lag.
    polarity_margin : float
        Correlation minus the best correlation of the other polarity at any allowed lag; NaN for a given polarity.
    lag_margin : float
        Correlation minus the best one of this polarity at a lag half a period or more away; NaN without one.
    correlation : float
        Pearson correlation of the aligned and the measured signal in the window (good samples only).
    window : Window
    at_bound : bool
        Whether the best lag is the largest allowed one: the true lag may be beyond.
    remarks : tuple of str
        Remarks for the reader: ambiguities, bounds.
    """

    lag: float
    polarity: int
    lag_error: float
    polarity_margin: float
    lag_margin: float
    correlation: float
    window: Window
    at_bound: bool
    remarks: tuple[str, ...] = ()


class Interpolated:
    """A simulated signal between its samples (cubic spline); outside it keeps its first and last value.

    Parameters
    ----------
    time, values : ndarray of float, shape (sample,)
        s, ascending strictly; finite.

    Raises
    ------
    EstimationError
        Fewer than four samples, or values that are not finite.
    """

    def __init__(self, time: Floats, values: Floats) -> None:
        from scipy.interpolate import CubicSpline

        if len(time) < 4 or len(time) != len(values) or not np.all(np.isfinite(values)):
            raise EstimationError(
                f"simulated signal: expected at least 4 finite samples, one for each instant, got {len(time)} "
                f"instants and {int(np.count_nonzero(np.isfinite(values)))} finite samples."
            )
        self.start, self.end = float(time[0]), float(time[-1])
        self._spline = CubicSpline(time, values)

    def __call__(self, time: Floats) -> Floats:
        """Return the values at instants (s)."""
        inside: Floats = self._spline(np.clip(time, self.start, self.end))
        return inside


@dataclass(frozen=True)
class _Start:
    """The good samples of a measured channel in the window, and the simulated signal.

    time (s) and values, shape (sample,); step: sampling interval, s.
    """

    time: Floats
    values: Floats
    step: float
    simulated: Interpolated

    @cached_property
    def deviation(self) -> Floats:
        return self.values - np.mean(self.values)

    def correlation(self, lag: float) -> float:
        """Return the Pearson correlation at a lag; 0 where the simulated signal is constant there."""
        model = self.simulated(self.time - lag)
        model = model - np.mean(model)
        size = float(np.sqrt(np.sum(model**2) * np.sum(self.deviation**2)))
        return float(np.sum(model * self.deviation) / size) if size > 0.0 else 0.0

    def scan(self, most_lag: float) -> tuple[Floats, Floats]:
        """Return all allowed lags, a sampling interval apart, and the correlation at each.

        One Fourier transform replaces a sum for each lag; samples that are not good have no weight.
        """
        from scipy.signal import correlate

        count = round((self.time[-1] - self.time[0]) / self.step) + 1
        grid = self.time[0] + self.step * np.arange(count)
        near = np.clip(np.searchsorted(self.time, grid - 0.5 * self.step), 0, len(self.time) - 1)
        weight = (np.abs(self.time[near] - grid) <= 0.75 * self.step).astype(np.float64)
        target = np.interp(grid, self.time, self.values)
        target = weight * (target - np.sum(weight * target) / np.sum(weight))
        reach = int(np.ceil(most_lag / self.step))
        model = self.simulated(grid[0] + self.step * np.arange(-reach, count + reach))
        model = model - np.mean(model)
        product, total, squares = (
            correlate(signal, kernel, "valid", "fft")
            for signal, kernel in ((model, target), (model, weight), (model**2, weight))
        )
        spread = squares - total**2 / np.sum(weight)
        floor = 1e-12 * float(np.max(squares, initial=0.0))
        size = np.sqrt(np.maximum(spread, floor) * np.sum(target**2))
        found = np.divide(product, size, out=np.zeros_like(product), where=size > 0.0)
        return self.step * np.arange(reach, -reach - 1, -1.0), np.where(spread > floor, found, 0.0)

    def refine(self, lag: float, polarity: int, reach: float, most_lag: float) -> float:
        """Return the lag of the highest correlation within `reach` of a lag."""
        from scipy.optimize import minimize_scalar

        low, high = max(lag - reach, -most_lag), min(lag + reach, most_lag)
        if low >= high:
            return low
        found = minimize_scalar(
            lambda trial: -polarity * self.correlation(trial),
            bounds=(low, high),
            method="bounded",
            options={"xatol": _LAG_TOLERANCE * self.step},
        )
        return min((float(found.x), low, high), key=lambda trial: -polarity * self.correlation(trial))

    def first_half(self) -> _Start:
        """Return the samples up to half of the energy of the window."""
        energy = np.cumsum(self.deviation**2)
        rows = energy <= 0.5 * energy[-1]
        return _Start(self.time[rows], self.values[rows], self.step, self.simulated)


@dataclass(frozen=True, slots=True)
class _Peak:
    """A peak of the correlation: lag (s), polarity, and height in that polarity."""

    lag: float
    polarity: int
    height: float


def align(
    simulated_time: Floats,
    simulated: Floats,
    measured: Channel,
    *,
    most_lag: float,
    event_window: tuple[float, float] | None = None,
    polarity: Literal["auto"] | int = "auto",
    lag: Literal["auto"] | float = "auto",
    event: ChannelEvent | None = None,
) -> Alignment:
    """Estimate lag and polarity between a simulated and a measured signal from the start of the event.

    The lag maximises the correlation of measured(t) and simulated(t - lag) over the good samples of the window. The
    offsets and the gain of both do not matter. The lag can hide one error. A relative frequency error e shifts it by
    about e times the distance from the onset to the centre of the window. By default this distance is 1.5 periods. The
    rest of the record shows the error all the same.

    Parameters
    ----------
    simulated_time, simulated : ndarray of float, shape (simulated sample,)
        s, ascending, on the clock of the drive; any unit. The signal is constant before and after.
    measured : Channel
    most_lag : float
        s; lags from -most_lag to +most_lag are searched.
    event_window : tuple of float, optional
        s from the onset of the measured event, start and end. Default: from half a dominant period of the event
        before its onset to three after.
    polarity : {"auto", 1, -1}
        1 or -1 where the polarity is known.
    lag : "auto" or float
        Lag (s) where it is known, for example 0 for channels with a common trigger.
    event : ChannelEvent, optional
        The event from `find_event`, if it was found before.

    Returns
    -------
    Alignment

    Raises
    ------
    EstimationError
        Fewer than 8 good samples in the window, or no event.

    Examples
    --------
    >>> from vibroimpact.analysis.recording import TimeAxis
    >>> time = np.arange(2000) * 1e-4
    >>> def ring(t):
    ...     return np.where(t > 0.0, np.exp(-30.0 * t) * np.sin(300.0 * t), 0.0)
    >>> axis = TimeAxis(time, 1e-4)
    >>> board = Channel("board", 0.3 - ring(time - 0.0642), "m s-2", axis, np.zeros(2000, np.uint8))
    >>> found = align(time, ring(time - 0.05), board, most_lag=0.04)
    >>> round(found.lag, 6), found.polarity
    (0.0142, -1)
    """
    event = event or find_event(measured)
    start = _start_of_event(Interpolated(simulated_time, simulated), measured, event, event_window)
    window = Window(float(start.time[0]), float(start.time[-1]))
    if lag != "auto":
        return _given_lag(start, float(lag), polarity, window)
    signs = (1, -1) if polarity == "auto" else (polarity,)
    peaks = _peaks(start, signs, most_lag)
    best = max(peaks, key=lambda peak: peak.height)
    others = [peak for peak in peaks if peak.polarity != best.polarity]
    shifted = [
        peak
        for peak in peaks
        if peak.polarity == best.polarity and abs(peak.lag - best.lag) >= 0.5 * event.period
    ]
    at_bound = abs(best.lag) >= most_lag - 1e-3 * start.step
    return Alignment(
        best.lag,
        best.polarity,
        _lag_error(start, best, event.period),
        best.height - max((peak.height for peak in others), default=np.nan),
        best.height - max((peak.height for peak in shifted), default=np.nan),
        best.height,
        window,
        at_bound,
        (
            *_rival_remarks(start, best, others, "the other polarity"),
            *_rival_remarks(start, best, shifted, "the same polarity"),
            *_warnings(best, at_bound),
        ),
    )


def _warnings(best: _Peak, at_bound: bool) -> list[str]:
    found = []
    if at_bound:
        found.append(
            f"the best lag is the largest allowed, {1e3 * best.lag:.4g} ms: the true one may be beyond"
        )
    if best.height < POOR_CORRELATION:
        found.append(
            f"at the start of the event the correlation of simulated and measured is {best.height:.2f} only: "
            "do not rely on lag and polarity"
        )
    return found


def _start_of_event(
    simulated: Interpolated, measured: Channel, event: ChannelEvent, window: tuple[float, float] | None
) -> _Start:
    step = float(np.median(np.diff(measured.time)))
    # noise has a "period" of two samples, too few for a correlation
    after_onset = max(PERIODS_AFTER * event.period, 2 * FEWEST_SAMPLES * step)
    before, after = window or (-PERIODS_BEFORE * event.period, after_onset)
    rows = (measured.time >= event.onset + before) & (measured.time <= event.onset + after) & measured.good
    if np.count_nonzero(rows) < FEWEST_SAMPLES:
        raise EstimationError(
            f"{measured.name}: alignment: expected at least {FEWEST_SAMPLES} good samples from "
            f"{event.onset + before:.6g} s to {event.onset + after:.6g} s, got {np.count_nonzero(rows)}. "
            "Give a longer window."
        )
    return _Start(measured.time[rows], measured.si()[rows], step, simulated)


def _given_lag(start: _Start, lag: float, polarity: Literal["auto"] | int, window: Window) -> Alignment:
    correlation = start.correlation(lag)
    sign = (1 if correlation >= 0.0 else -1) if polarity == "auto" else polarity
    margin = 2.0 * abs(correlation) if polarity == "auto" else np.nan
    return Alignment(lag, sign, 0.0, margin, np.nan, sign * correlation, window, False)


def _peaks(start: _Start, signs: tuple[int, ...], most_lag: float) -> list[_Peak]:
    """Return the highest peaks of the correlation, refined, for each allowed polarity."""
    lags, correlation = start.scan(most_lag)
    found: list[_Peak] = []
    for sign in signs:
        padded = np.concatenate([[-np.inf], sign * correlation, [-np.inf]])
        places = np.flatnonzero((padded[1:-1] >= padded[:-2]) & (padded[1:-1] > padded[2:]))
        for place in places[np.argsort(-padded[places + 1])][:CANDIDATES]:
            lag = start.refine(float(lags[place]), sign, start.step, most_lag)
            found.append(_Peak(lag, sign, sign * start.correlation(lag)))
    return found


def _independent(residual: Floats) -> float:
    """Return the number of independent samples of a correlated residual: n over the sum of its squared correlation."""
    from scipy.fft import rfft

    count = len(residual)
    deviation = residual - np.mean(residual)
    energy = float(np.sum(deviation**2))
    if energy <= 0.0:
        return float(count)
    power = np.abs(rfft(deviation, 2 * count)) ** 2
    # sum over all lags of the squared autocorrelation, by Parseval
    total = (2.0 * float(np.sum(power**2)) - float(power[0] ** 2 + power[-1] ** 2)) / (2 * count) / energy**2
    # the estimated correlations of white noise alone are not 0: their squares sum to about 1
    return max(1.0, count / max(1.0, total - 1.0))


def _residual(start: _Start, peak: _Peak) -> tuple[Floats, Floats]:
    """Return the residual of the measured deviations after the best gain, and the gain times the model's slope."""
    at = start.time - peak.lag
    model = start.simulated(at)
    model = model - np.mean(model)
    energy = float(np.sum(model**2))
    gain = float(np.sum(model * start.deviation)) / energy if energy > 0.0 else 0.0
    half = 0.5 * start.step
    slope = (start.simulated(at + half) - start.simulated(at - half)) / start.step
    # the part of the slope that a gain or an offset can produce carries no information on the lag
    slope = slope - np.mean(slope)
    slope = slope - model * (float(np.sum(slope * model)) / energy if energy > 0.0 else 0.0)
    return start.deviation - gain * model, gain * slope


def _lag_error(start: _Start, best: _Peak, period: float) -> float:
    residual, slope = _residual(start, best)
    information = float(np.sum(slope**2))
    if information <= 0.0:
        return np.inf
    repeated = len(residual) / _independent(residual)
    standard = float(np.sqrt(np.mean(residual**2) * repeated / information))
    half = start.first_half()
    if len(half.time) < FEWEST_SAMPLES:
        return standard
    drift = half.refine(best.lag, best.polarity, 0.25 * period, np.inf) - best.lag
    return float(np.hypot(standard, drift))


def _rival_remarks(start: _Start, best: _Peak, rivals: list[_Peak], what: str) -> list[str]:
    """Return a remark if another lag or polarity is nearly as likely.

    The likelihood of a residual energy E of n independent samples is proportional to E^(-n/2).
    """
    if not rivals:
        return []
    rival = max(rivals, key=lambda peak: peak.height)
    independent = _independent(_residual(start, best)[0])
    energies = [max(1.0 - max(peak.height, 0.0) ** 2, 1e-15) for peak in (best, rival)]
    if 0.5 * independent * np.log(energies[1] / energies[0]) >= np.log(CLEAR_ODDS):
        return []
    return [
        f"ambiguous: {what} with a lag of {1e3 * rival.lag:.4g} ms has the correlation {rival.height:.4f}, "
        f"the best ({1e3 * best.lag:.4g} ms) {best.height:.4f}"
    ]

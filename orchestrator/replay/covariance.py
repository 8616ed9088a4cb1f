"""Errors of numbers that were fitted to replays: what noise of all channels, and the lags found beside, leave open.

Numbers solve sum S e = 0 (e: residual, S: its slope by each number, over all samples), and each lag that was found
from the start of an event solves sum w e = 0 there (w: slope by the lag, less what a gain or an offset does). Both
are linearised together, so that the errors of the lags are in those of the numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.recording import Channel
from vibroimpact.analysis.replay.alignment import Interpolated
from vibroimpact.analysis.replay.comparison import Comparison
from vibroimpact.analysis.replay.event import find_event
from vibroimpact.fmus.errors import EstimationError

Floats = NDArray[np.float64]

#: Samples from which noise is learned.
FEWEST_QUIET = 100


@dataclass(frozen=True, slots=True)
class LagSlopes:
    """What a lag does to the residual of its channel."""

    slope: Floats
    """Derivative of the residual by the lag, 1/s, shape (sample,)."""
    weight: Floats
    """w of the equation that the lag solves, shape (sample,); 0 outside the start of the event."""


def lag_slopes(comparison: Comparison, model: Interpolated, size: float) -> LagSlopes | None:
    """Return what the lag of a comparison does to its residual over `size`; None for a lag that was given."""
    alignment = comparison.alignment
    if not 0.0 < alignment.lag_error < np.inf:
        return None
    time = comparison.measured.time[comparison.scored]
    half = 0.5 * float(np.median(np.diff(time)))
    at = time - alignment.lag
    slope = alignment.polarity * (model(at + half) - model(at - half)) / (2.0 * half * size)
    rows = (time >= alignment.window[0]) & (time <= alignment.window[1])
    weight = np.zeros(len(time))
    if np.count_nonzero(rows) > 2:
        shape = np.column_stack([np.ones(np.count_nonzero(rows)), model(at[rows])])
        weight[rows] = slope[rows] - shape @ np.linalg.lstsq(shape, slope[rows])[0]
    return LagSlopes(slope, weight) if np.any(weight) else None


def covariance_of(
    slopes: Sequence[Floats],
    lags: Sequence[LagSlopes | None],
    residuals: Sequence[Floats],
    disturbances: Sequence[Sequence[Floats]],
) -> Floats:
    """Return the covariance of the numbers, shape (key, key).

    Slopes of the residual of each channel have shape (sample, key); residuals are correlated in time. Disturbances are
    draws of what noise of the drives does to the residuals of all channels: its response rings for longer than any
    estimate from one record's residual can see.
    """
    keys, found = slopes[0].shape[1], [place for place, lag in enumerate(lags) if lag is not None]
    derivatives, weights = [], []
    for place, (slope, lag) in enumerate(zip(slopes, lags, strict=True)):
        by_lags = np.zeros((2, len(slope), len(found)))
        if lag is not None:
            by_lags[:, :, found.index(place)] = lag.slope, lag.weight
        derivatives.append(np.hstack([slope, by_lags[0]]))
        weights.append(np.hstack([slope, by_lags[1]]))
    bread = sum(w.T @ d for w, d in zip(weights, derivatives, strict=True))
    inverse = np.linalg.inv(bread)
    drives = np.zeros_like(bread)
    for drawn in disturbances:
        score = sum(weight.T @ one for weight, one in zip(weights, drawn, strict=True))
        drives += np.outer(score, score) / len(disturbances)
    meats = [_meats(weight, residual) for weight, residual in zip(weights, residuals, strict=True)]
    changing, steady = (
        (inverse @ (sum(kind) + drives) @ inverse.T)[:keys, :keys] for kind in zip(*meats, strict=True)
    )
    larger = np.sqrt(np.maximum(1.0, np.diag(steady) / np.maximum(np.diag(changing), np.finfo(float).tiny)))
    covariance: Floats = changing * np.outer(larger, larger)
    return covariance


def _meats(weight: Floats, residual: Floats) -> tuple[Floats, Floats]:
    """Return the covariance of sum weight * residual twice, correlations fading out over n^(1/2) samples.

    First with a residual that may change (Newey and West): it sees a model that is wrong during the event. It is too
    small where few samples have all the weight, for there their sum is 0 by the fit itself. So also with a residual of
    one autocovariance all over the record.
    """
    scores = weight * residual[:, None]
    count = len(scores)
    reach = min(count - 1, max(1, int(np.sqrt(count))))
    changing: Floats = scores.T @ scores
    steady: Floats = (weight.T @ weight) * float(residual @ residual) / count
    for lag in range(1, reach + 1):
        fading = 1.0 - lag / (reach + 1.0)
        part = scores[lag:].T @ scores[:-lag]
        changing = changing + fading * (part + part.T)
        part = (weight[lag:].T @ weight[:-lag]) * float(residual[lag:] @ residual[:-lag]) / count
        steady = steady + fading * (part + part.T)
    return changing, steady


def quiet_noise(channel: Channel) -> Floats | None:
    """Return what a channel shows before its event, in its SI unit, without drift.

    None where it does not rest for `FEWEST_QUIET` samples: a record may begin with the foot of its pulse.
    """
    if channel.attrs.get("role") == "simulated":
        return None
    try:
        quiet = find_event(channel).quiet
    except EstimationError:
        return None
    if quiet is None:
        return None
    rows = (channel.time >= quiet[0]) & (channel.time <= quiet[1]) & channel.good
    values = channel.si()[rows]
    if len(values) < FEWEST_QUIET:
        return None
    # a drift is none of the noise
    place = np.linspace(-1.0, 1.0, len(values))
    noise: Floats = values - np.polyval(np.polyfit(place, values, 1), place)
    return noise if np.any(noise) else None


def drawn_noise(sample: Floats, count: int, random: np.random.Generator) -> Floats:
    """Return `count` values of noise with the spectrum of a sample of it.

    White noise convolved with the sample: the spectrum is that of the sample, squared and smoothed.
    """
    from scipy.signal import fftconvolve

    white = random.normal(0.0, 1.0 / np.sqrt(len(sample)), count + len(sample) - 1)
    noise: Floats = fftconvolve(white, sample, mode="valid")
    return noise

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
from scipy.signal import fftconvolve

from vibroimpact.analysis.recording import Channel
from vibroimpact.analysis.replay.alignment import Interpolated
from vibroimpact.analysis.replay.comparison import Comparison
from vibroimpact.analysis.replay.event import find_event
from vibroimpact.fmus.errors import EstimationError

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class LagSlopes:
    """What a lag does to the residual of its channel.

    Attributes
    ----------
    slope : ndarray, shape (sample,)
        Derivative of the residual by the lag, 1/s.
    weight : ndarray, shape (sample,)
        w of the equation that the lag solves; 0 outside the start of the event.
    """

    slope: Floats
    weight: Floats


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

    Parameters
    ----------
    slopes : sequence of ndarray, shape (sample, key)
        Of the residual of each channel by each number.
    lags : sequence of LagSlopes or None
    residuals : sequence of ndarray, shape (sample,)
        Correlated in time (Newey and West, lags up to the root of the number of samples).
    disturbances : sequence of sequences of ndarray, shape (sample,)
        Draws of what noise of the drives does to the residuals of all channels: its response rings for longer than
        any estimate from one record's residual can see.
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
    meat = sum(_meat(weight, residual) for weight, residual in zip(weights, residuals, strict=True))
    for drawn in disturbances:
        score = sum(weight.T @ one for weight, one in zip(weights, drawn, strict=True))
        meat = meat + np.outer(score, score) / len(disturbances)
    inverse = np.linalg.inv(bread)
    covariance: Floats = (inverse @ meat @ inverse.T)[:keys, :keys]
    return covariance


def _meat(weight: Floats, residual: Floats) -> Floats:
    """Return the covariance of sum weight * residual, correlations fading out over a lag of n^(1/2) samples."""
    scores = weight * residual[:, None]
    reach = max(1, int(np.sqrt(len(scores))))
    total: Floats = scores.T @ scores
    for lag in range(1, reach + 1):
        part = scores[lag:].T @ scores[:-lag]
        total = total + (1.0 - lag / (reach + 1.0)) * (part + part.T)
    return total


def quiet_noise(channel: Channel) -> Floats | None:
    """Return what a channel shows before its event, in its SI unit, without its mean; None where it never rests."""
    if channel.attrs.get("role") == "simulated":
        return None
    try:
        quiet = find_event(channel).quiet
    except EstimationError:
        return None
    if quiet is None:
        return None
    rows = (channel.time >= quiet[0]) & (channel.time <= quiet[1]) & channel.good
    noise: Floats = channel.si()[rows] - np.mean(channel.si()[rows])
    return noise if np.any(noise) else None


def drawn_noise(sample: Floats, count: int, random: np.random.Generator) -> Floats:
    """Return `count` values of noise with the spectrum of a sample of it.

    White noise convolved with the sample: the spectrum is that of the sample, squared and smoothed.
    """
    white = random.normal(0.0, 1.0 / np.sqrt(len(sample)), count + len(sample) - 1)
    noise: Floats = fftconvolve(white, sample, mode="valid")
    return noise

"""Errors of numbers fitted to replays: from the noise of all channels, and from the lags fitted with them.

Numbers solve sum S e = 0 (e: residual, S: its slope by each number, over all samples). A lag that was found from the
start of an event solves sum w e = 0 there. Its weight w is the slope by the lag, less the effect of a gain or an
offset. Both equations are linearised together, so that the errors of the numbers include the errors of the lags.
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

#: Fewest quiet samples from which the noise of a channel is estimated.
FEWEST_QUIET = 100


@dataclass(frozen=True, slots=True)
class LagSlopes:
    """The effect of a lag on the residual of its channel."""

    slope: Floats
    """Derivative of the residual by the lag, 1/s, shape (sample,)."""
    weight: Floats
    """Weight w of the lag's equation, shape (sample,); 0 outside the start of the event."""


def lag_slopes(comparison: Comparison, model: Interpolated, size: float) -> LagSlopes | None:
    """Return the effect of a comparison's lag on its residual over `size`; None for a given lag."""
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
    draws of the effect of drive noise on the residuals of all channels. The response to this noise rings longer than
    an estimate from one record's residual can cover.
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
    """Return two covariances of sum weight * residual; correlations fade out over n^(1/2) samples.

    The first allows a residual that changes in time (Newey and West): it covers a wrong model during the event. It is
    too small if few samples have all the weight, as the fit itself makes their sum 0. The second assumes one
    autocovariance over the whole record.
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
    """Return the values of a channel before its event, in its SI unit, without drift.

    None unless it rests for `FEWEST_QUIET` samples: a record may begin with the foot of its pulse.
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
    # drift is not noise
    place = np.linspace(-1.0, 1.0, len(values))
    noise: Floats = values - np.polyval(np.polyfit(place, values, 1), place)
    return noise if np.any(noise) else None


def drawn_noise(sample: Floats, count: int, random: np.random.Generator) -> Floats:
    """Return `count` values of noise with the spectrum of a noise sample.

    White noise is convolved with the sample: the spectrum is the squared, smoothed spectrum of the sample.
    """
    from scipy.signal import fftconvolve

    white = random.normal(0.0, 1.0 / np.sqrt(len(sample)), count + len(sample) - 1)
    noise: Floats = fftconvolve(white, sample, mode="valid")
    return noise

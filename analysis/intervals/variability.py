"""The regularity of a train: rate, coefficient of variation, Fano factor.

The standard error of the rate comes from counts in long bins, which keeps the memory of the train. The Fano factor
depends on its bins, so their width is stated and their offset varied.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vibroimpact.analysis.intervals.trains import Floats, IntervalTrain
from vibroimpact.fmus.errors import UsageError

# Number of bins for the standard error of a rate, and of offsets of the first bin for a Fano factor.
RATE_BINS, OFFSETS = 20, 20
# Widths of the Fano curve, in mean intervals, and smallest number of bins for a variance.
CURVE = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
FEWEST_BINS = 10
# Difference of ends, relative to the bin, up to which it is rounding alone.
ROUNDING = 1e-9


@dataclass(frozen=True, slots=True)
class FanoFactor:
    """Variance (ddof 1) over mean of the counts in bins."""

    width: float
    """Width of the bins, s."""
    value: float = float("nan")
    """Value with the first bin at the start of the window; NaN, like the others, for fewer than 10 bins."""
    standard_error: float = float("nan")
    """The value times sqrt(2 / (bins - 1)): as if the counts were normal and independent."""
    lowest: float = float("nan")
    highest: float = float("nan")
    """`lowest` and `highest` over `OFFSETS` offsets of the first bin."""


def rate(train: IntervalTrain) -> tuple[float, float]:
    """Return events per second of observation, and the standard error.

    In a given window the rate is events over duration; otherwise it is intervals over the span from the first event to
    the last. The standard error comes from the counts in 20 long bins (as from any 20 independent repeats); NaN for too
    few events.
    """
    events = len(train.times) - (0 if train.stated else 1)
    value = events / train.duration
    counts = bin_counts(train, (train.window[1] - train.window[0]) / RATE_BINS)
    if len(counts) < FEWEST_BINS or events < 2 * RATE_BINS:
        return value, float("nan")
    relative = np.std(counts, ddof=1) / np.mean(counts) / np.sqrt(len(counts))
    return value, float(value * relative)


def coefficient_of_variation(train: IntervalTrain) -> float:
    """Return standard deviation (ddof 0) over mean of the intervals that count: 1 for a Poisson process."""
    intervals = train.intervals
    return float(np.std(intervals) / np.mean(intervals))


def fano_factor(train: IntervalTrain, width: float) -> FanoFactor:
    """Return the Fano factor of the counts in bins of a width (s).

    The bins start with the window. The rest of the window after the last whole bin, and bins that touch a masked span,
    do not count.
    """
    counts = bin_counts(train, width)
    if len(counts) < FEWEST_BINS:
        return FanoFactor(width)
    value = _variance_to_mean(counts)
    shifted = [_variance_to_mean(bin_counts(train, width, k * width / OFFSETS)) for k in range(OFFSETS)]
    error = value * np.sqrt(2.0 / (len(counts) - 1))
    return FanoFactor(width, value, float(error), min(shifted), max(shifted))


def fano_curve(train: IntervalTrain) -> list[FanoFactor]:
    """Return the Fano factor at several widths, in steps of mean intervals, as far as the train is long enough."""
    mean = float(np.mean(train.intervals))
    factors = (fano_factor(train, mean * multiple) for multiple in CURVE)
    return [factor for factor in factors if np.isfinite(factor.value)]


MOST_BINS = 10**7
"""Number of bins above which counts are 0 or 1 in any recording, and only fill memory."""


def bin_counts(train: IntervalTrain, width: float, offset: float = 0.0) -> Floats:
    """Return the counts in the bins that lie in the window and touch no masked span."""
    start, end = train.window[0] + offset, train.window[1]
    if (end - start) / width > MOST_BINS:
        raise UsageError(
            f"intervals: count_bin: expected at most {MOST_BINS:g} bins in {end - start:g} s, "
            f"got a bin of {width:g} s. Give a longer one."
        )
    number = int((end - start) / width + ROUNDING)
    if number < 1:
        return np.empty(0)
    edges = start + width * np.arange(number + 1)
    # an event at an edge belongs to the bin that begins there, despite rounding
    place = np.searchsorted(edges - ROUNDING * width, train.times, "right") - 1
    inside = place[(place >= 0) & (place < number)]
    counts = np.bincount(inside, minlength=number).astype(np.float64)
    clear = np.ones(number, dtype=np.bool_)
    for first, last in train.masked:
        clear &= (edges[1:] <= first) | (edges[:-1] >= last)
    return counts[clear]


def _variance_to_mean(counts: Floats) -> float:
    mean = float(np.mean(counts))
    return float(np.var(counts, ddof=1) / mean) if mean > 0.0 else float("nan")

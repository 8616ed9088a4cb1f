"""The correlation dimension of intervals: slopes for every embedding, next to those of shuffled surrogates.

A shuffled surrogate has the same intervals in random order. Its slopes come from their distribution; only further
structure of the intervals is dynamics. A slope that keeps growing with the embedding is no dimension.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.results import Rows
from vibroimpact.analysis.intervals.correlation import (
    FEWEST_PAIRS,
    WINDOW,
    CorrelationSums,
    correlation_sums,
    count_pairs,
    fitted_slopes,
)
from vibroimpact.analysis.intervals.trains import Floats, IntervalTrain
from vibroimpact.fmus.core import RADII_PER_OCTAVE

Scale = Literal["raw", "log"]
SCALES: tuple[Scale, ...] = ("raw", "log")

EMBEDDING, SURROGATES, THEILER = 6, 8, 1
MOST_INTERVALS, FEWEST_INTERVALS, FEWEST_DISTINCT = 10_000, 200, 50
# Share of distinct intervals below which a warning about ties is given.
MOSTLY_DISTINCT = 0.9
# Difference of instants, relative to the latest one, up to which it is rounding alone.
ROUNDING = 2.0**-44
# Share of pairs equal in one interval that stay equal in all, above which the motion repeats.
REPEATS = 0.5
# Growth of the slope per embedding below which it is constant. Ratio of its last value to the surrogate's above which
# it keeps up, and above which it is steeper. Ratio of the surrogate's last value to that of noise below which the
# surrogate flattens.
CONSTANT, SIMILAR, STEEPER, FLATTER = 0.15, 0.85, 1.3, 0.75
# Distance from its last value within which a slope has saturated.
SATURATION = 0.2
# Smallest number of successive embeddings with a slope for a verdict.
FEWEST_SLOPES = 3
# Slope in the lower half of the window minus that in the upper half above which the intervals contain noise. Measured:
# up to .09 without noise (Henon's and the logistic map, a torus); .3, .5, 1.4, 1.7 for Henon's with 1, 2, 5, 10 %.
NOISE_SLOPE = 0.25
# Slope up to which a stretch is a plateau, and smallest share of all pairs beyond it.
FLAT, LEFT_OUT = 0.1, 0.1


def interval_dimension(
    train: IntervalTrain, scale: Scale, *, embedding: int = EMBEDDING, theiler: int = THEILER, seed: int = 0
) -> tuple[Rows, dict[str, Any]]:
    """Return the correlation sums of a train's intervals, their slopes, those of shuffled surrogates, and a verdict.

    Heavy-tailed intervals flatten the raw slopes falsely: use their logarithms. At most the first 10,000 are used;
    `embedding` is the largest m, and pairs at most `theiler` places apart do not count. If the intervals do not
    suffice, the variables have no radii, and the attributes have the reason in words.
    """
    values = _values(train, scale)
    reason = _refusal(train, values, embedding)
    if reason:
        nothing = np.empty((embedding, 0), np.int64)
        sums = CorrelationSums(np.empty(0), nothing, np.ones(embedding, np.int64))
        slopes = np.full(embedding, 0.0 if reason.startswith("slope 0") else np.nan)
        rows = _rows(scale, sums, slopes, [sums], np.full((SURROGATES, embedding), np.nan))
        return rows, _attributes(scale, reason)
    values = values[:MOST_INTERVALS]
    sums = correlation_sums(values, embedding, theiler=theiler)
    # radii between two points of a grid carry no information
    above = 2.0 * train.resolution / (float(np.median(train.intervals)) if scale == "log" else 1.0)
    slopes = fitted_slopes(sums, above=above)
    rng = np.random.default_rng(seed)
    shuffled = [
        correlation_sums(_shuffled(values, rng), embedding, theiler=theiler, radii=sums.radii)
        for _ in range(SURROGATES)
    ]
    others = np.array([fitted_slopes(s, above=above) for s in shuffled])
    words = verdict(slopes, others.mean(axis=0))
    if words.startswith("saturation"):
        words += _noise(sums, above)
    words += _plateau(sums)
    attributes = _attributes(scale, words, _warnings(train, values))
    return _rows(scale, sums, slopes, shuffled, others), attributes | {"theiler": theiler}


def _rows(
    scale: Scale, sums: CorrelationSums, slopes: Floats, shuffled: list[CorrelationSums], others: Floats
) -> Rows:
    """Return the variables of one scale; `others`: slopes of the surrogates, shape (surrogate, embedding)."""
    kind, unit = {"raw": ("intervals", "s"), "log": ("ln(interval / 1 s)", "1")}[scale]
    by_m, radius = "embedding", f"radius_{scale}"
    both = (by_m, radius)
    sum_of, slope_of = "correlation sum of", "correlation slope of"
    mean_sums = np.mean([each.sums for each in shuffled], axis=0)
    mean_slopes = np.mean([each.local_slopes for each in shuffled], axis=0)
    spread, words = others.std(axis=0, ddof=1), f"{slope_of} shuffled {kind}, standard deviation"
    return {
        f"slope_{scale}": (by_m, slopes, "1", f"{slope_of} {kind}"),
        f"surrogate_slope_{scale}": (by_m, others.mean(axis=0), "1", f"{slope_of} shuffled {kind}, mean"),
        f"surrogate_spread_{scale}": (by_m, spread, "1", words),
        f"correlation_sum_{scale}": (both, sums.sums, "1", f"{sum_of} {kind}"),
        f"local_slope_{scale}": (both, sums.local_slopes, "1", f"local slope of {kind}, over half an octave"),
        f"surrogate_sum_{scale}": (both, mean_sums, "1", f"{sum_of} shuffled {kind}, mean"),
        f"surrogate_local_slope_{scale}": (both, mean_slopes, "1", f"local slope of shuffled {kind}, mean"),
        by_m: (by_m, np.arange(1, len(slopes) + 1), "1", "numbers in a delay vector"),
        radius: (radius, sums.radii, unit, "radius in the max norm"),
    }


def _attributes(scale: Scale, words: str, warnings: Iterable[str] = ()) -> dict[str, Any]:
    return {
        f"dimension_{scale}": words,
        f"dimension_{scale}_warnings": "\n".join(warnings),
        "slope_window": list(WINDOW),
    }


def verdict(slopes: Floats, surrogate: Floats) -> str:
    """Return the verdict on slopes for m = 1, 2, ... and those of a shuffled surrogate, in words.

    Embeddings without a slope on either side are left out and named. On a coarse grid C of m = 1 may be above the
    window at every radius. In a short train C of the largest m may be below it.

    >>> verdict(np.array([0.9, 1.2, 1.2, 1.2]), np.array([0.9, 1.8, 2.7, 3.6]))
    'saturation at 1.20 from m = 2 on, where the surrogate goes on to 3.60: low-dimensional'
    """
    first, stop = _longest_run(np.isfinite(slopes) & np.isfinite(surrogate))
    if stop - first < FEWEST_SLOPES:
        return "not decided: too few radii with C in the window"
    found = _verdict(slopes[first:stop], surrogate[first:stop], first + 1)
    missing = [str(place + 1) for place in range(len(slopes)) if not first <= place < stop]
    return found + (
        f"; without m = {', '.join(missing)}: too few radii with C in the window" if missing else ""
    )


def _longest_run(known: NDArray[np.bool_]) -> tuple[int, int]:
    """Return the start and the end of the longest run of True; of equally long runs the first."""
    edges = np.flatnonzero(np.diff(known, prepend=False, append=False)).tolist()
    runs = zip(edges[::2], edges[1::2], strict=True)
    return max(runs, key=lambda run: run[1] - run[0], default=(0, 0))


def _verdict(slopes: Floats, surrogate: Floats, lowest: int) -> str:
    """Return the verdict on finite slopes of successive embeddings, the first of which is m = `lowest`."""
    if np.all(slopes == 0.0):
        return "slope 0 at every embedding: a finite number of points, a periodic motion"
    top, against, highest = slopes[-1], surrogate[-1], lowest + len(slopes) - 1
    numbers = f"{top:.2f} at m = {highest}, shuffled {against:.2f}"
    growth, expected = np.diff(slopes)[-2:].mean(), np.diff(surrogate)[-2:].mean()
    if top > STEEPER * against:
        return f"no saturation: noise at these radii, about an ordered motion ({numbers})"
    if against < FLATTER * highest * min(surrogate[0] / lowest, 1.0) and top > SIMILAR * against:
        return f"flattens as its shuffled surrogate does ({numbers}): the distribution, not dynamics; no dimension"
    if top > SIMILAR * against and growth > CONSTANT:
        return f"no saturation: noise-like, as its shuffled surrogate ({numbers})"
    if growth < CONSTANT * max(expected, 1.0):
        first = int(np.argmax(slopes > top - max(SATURATION, 0.1 * top))) + lowest
        return (
            f"saturation at {top:.2f} from m = {first} on, where the surrogate goes on to {against:.2f}: "
            "low-dimensional"
        )
    return f"not decided: grows slower than its shuffled surrogate, but does not stand still ({numbers})"


def _noise(sums: CorrelationSums, above: float) -> str:
    """Return in words whether the slope is steeper at small radii, where noise fills the embedding.

    A motion has its dimension at all radii; noise adds its own dimension below its size.
    """
    (low, high), middle = WINDOW, float(np.sqrt(WINDOW[0] * WINDOW[1]))
    small = fitted_slopes(sums, above=above, window=(low, middle))[1:]
    large = fitted_slopes(sums, above=above, window=(middle, high))[1:]
    steeper = np.nan_to_num(small - large, nan=0.0)
    place = int(np.argmax(steeper))
    if steeper[place] < NOISE_SLOPE:
        return ""
    return (
        f", but with noise in it: at m = {place + 2} the slope is {small[place]:.2f} for C up to {middle:g} and "
        f"{large[place]:.2f} above, and the dimension of the motion is lower than the saturation"
    )


def _plateau(sums: CorrelationSums) -> str:
    """Return the range of radii over which C is constant for an octave or more, at the largest m, in words."""
    near, share = sums.near[-1], sums.sums[-1]
    start = near[:-RADII_PER_OCTAVE]
    flat = (start >= FEWEST_PAIRS) & (near[RADII_PER_OCTAVE:] <= start * 2.0**FLAT)
    flat &= share[RADII_PER_OCTAVE:] < 1.0 - LEFT_OUT
    places = np.flatnonzero(flat)
    if not len(places):
        return ""
    low, high = sums.radii[places[0]], sums.radii[places[-1] + RADII_PER_OCTAVE]
    return (
        f"; slope 0 at radii from {low:.2g} to {high:.2g} (C = {share[places[0]]:.2g}): "
        "there the intervals look like a finite number of points"
    )


def _rounded(train: IntervalTrain) -> Floats:
    """Return the intervals, s, made equal if they differ only by rounding; NaN where masked."""
    quantum = max(float(np.max(np.abs(train.times))) * ROUNDING, float(np.finfo(np.float64).tiny))
    steps: Floats = np.rint(train.separated / quantum)
    # rounding may separate equal intervals: join neighbouring steps
    known = np.isfinite(steps)
    order, place = np.unique(steps[known], return_inverse=True)
    group = np.cumsum(np.diff(order, prepend=order[:1]) > 2.0)
    steps[known] = order[np.searchsorted(group, group)][place] * quantum
    return steps


def _values(train: IntervalTrain, scale: Scale) -> Floats:
    values = _rounded(train)
    if scale == "raw":
        return values
    # coincident events have no logarithm: vectors do not cross them
    return np.asarray(np.log(np.where(values > 0.0, values, np.nan)))


def _refusal(train: IntervalTrain, values: Floats, embedding: int) -> str:
    known, distinct = _counted(values)
    if known < FEWEST_INTERVALS:
        return f"refused: expected at least {FEWEST_INTERVALS} intervals, got {known}"
    if count_pairs(np.isfinite(values[:MOST_INTERVALS]), embedding, 0) < FEWEST_INTERVALS:
        return f"refused: too few successive intervals without a mask between them for vectors of {embedding}"
    if distinct == 1:
        return "slope 0: all intervals are the same, a periodic motion"
    if distinct >= FEWEST_DISTINCT:
        return ""
    if _repeats(values, embedding):
        return f"slope 0: {distinct} distinct intervals in an order that repeats, a periodic motion"
    grid = f" (they lie on a grid of {train.resolution:.3g} s)" if train.resolution > 0.0 else ""
    return (
        f"refused: only {distinct} distinct intervals among {known}{grid}; expected at least "
        f"{FEWEST_DISTINCT}: below their spacing every slope is that of the grid"
    )


def _repeats(values: Floats, embedding: int) -> bool:
    """Return whether equal intervals stay equal, as in a periodic motion."""
    known = np.unique(values[np.isfinite(values)])
    spacing = float(np.min(np.diff(known)))
    sums = correlation_sums(
        values[: FEWEST_INTERVALS * 5] / spacing, embedding, radii=np.array([0.5, 0.5625])
    )
    same = sums.sums[:, 0]
    return bool(same[-1] > REPEATS * same[0])


def _shuffled(values: Floats, rng: np.random.Generator) -> Floats:
    """Return the values in random order; unknown values keep their places."""
    shuffled = values.copy()
    known = np.isfinite(values)
    shuffled[known] = rng.permutation(values[known])
    return shuffled


def _warnings(train: IntervalTrain, values: Floats) -> list[str]:
    known, distinct = _counted(values)
    lines = [
        f"with {known} intervals no slope above about {2.0 * np.log10(known):.1f} can be told "
        "(2 log10 of their number)"
    ]
    if len(train.separated) > len(values):
        lines.append(f"only the first {len(values)} of {len(train.separated)} intervals are used")
    if distinct < MOSTLY_DISTINCT * known:
        lines.append(
            f"ties: only {distinct} of {known} intervals are distinct; small radii are not trustworthy"
        )
    return lines


def _counted(values: Floats) -> tuple[int, int]:
    """Return the number of known values, and of distinct known values."""
    known = values[np.isfinite(values)]
    return len(known), len(np.unique(known))

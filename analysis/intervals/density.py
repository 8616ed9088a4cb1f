"""Probability density of the intervals: a histogram and a kernel estimate, both with their width stated."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.intervals.trains import Floats

# Smallest and largest number of points of the kernel estimate; largest number of bins of the histogram.
FEWEST_POINTS, MOST_POINTS, MOST_BINS = 64, 30_000, 400
# Smallest bandwidth, relative to the median interval, below which two intervals count as equal.
FINEST = 0.005
# Smallest prominence of a peak, relative to its height and in standard errors of the estimate there; smallest height,
# relative to the highest peak.
PROMINENCE, SIGNIFICANT, LOWEST_PEAK = 0.3, 2.5, 0.02
# Integral of the squared Gaussian kernel of bandwidth 1: variance of the estimate over density / (number * bandwidth).
ROUGHNESS = 0.2821
# Width of the window about the mean that holds a quarter of a normal distribution, in standard deviations.
QUARTER_WINDOW = 0.6373
# Reach of a kernel, in bandwidths.
REACH = 4.0


@dataclass(frozen=True, slots=True)
class Density:
    """Density of the intervals, 1/s."""

    at: Floats
    """Intervals (s), shape (point,)."""
    kernel: Floats
    """The Gaussian kernel estimate at these intervals, shape (point,)."""
    bandwidth: float
    """Standard deviation of the kernel, s."""
    edges: Floats
    """Edges of the bins, s, shape (bin + 1,)."""
    histogram: Floats
    """Density in each bin, shape (bin,)."""
    peaks: Floats
    """Intervals at which the kernel estimate has a distinct maximum, s, ascending."""

    @property
    def bin_width(self) -> float:
        """Width of a bin of the histogram, s."""
        return float(self.edges[1] - self.edges[0])


def interval_density(intervals: Floats, *, resolution: float = 0.0) -> Density:
    """Return the density of intervals.

    The bandwidth is Silverman's rule for the spread of the intervals within their densest cluster: narrow bands that
    are far apart stay apart. Bins are one bandwidth wide, in whole multiples of the grid of the instants. Intervals
    and grid (`resolution`) are in s; no width is smaller than the grid.

    >>> density = interval_density(np.tile([0.2, 0.8], 50))
    >>> [round(float(peak), 2) for peak in density.peaks]
    [0.2, 0.8]
    """
    width = _bandwidth(intervals, resolution)
    low, high = float(intervals.min()), float(intervals.max())
    at, kernel = _kernel_estimate(intervals, width, max(low - REACH * width, 0.0), high + REACH * width)
    edges = _edges(low, high, width, resolution)
    histogram = np.histogram(intervals, edges)[0] / (len(intervals) * (edges[1] - edges[0]))
    return Density(at, kernel, width, edges, histogram, at[_distinct(kernel, len(intervals) * width)])


def _bandwidth(intervals: Floats, resolution: float) -> float:
    """Return Silverman's bandwidth for the spread within clusters, s; at least the grid, and .5 % of the median."""
    sigma = spread_within(intervals)
    return max(0.9 * sigma / math.pow(len(intervals), 0.2), resolution, FINEST * typical_interval(intervals))


def typical_interval(intervals: Floats) -> float:
    """Return the median interval, or the mean where most events coincide, s."""
    return float(np.median(intervals)) or float(np.mean(intervals))


def spread_within(intervals: Floats) -> float:
    """Return the standard deviation within the densest cluster of the intervals, s.

    It follows from the shortest window that holds a quarter of all intervals, as if their density there were normal. It
    is narrow for bands, and equals the spread of a single hump.
    """
    ordered = np.sort(intervals)
    quarter = max(len(ordered) // 4, 1)
    shortest = float(np.min(ordered[quarter:] - ordered[:-quarter])) if len(ordered) > quarter else 0.0
    return min(shortest / QUARTER_WINDOW, float(np.std(intervals)))


def _kernel_estimate(intervals: Floats, width: float, low: float, high: float) -> tuple[Floats, Floats]:
    """Return a grid, fine against the kernel, and the estimate on it: binned, then convolved."""
    points = int(np.clip(np.ceil((high - low) / (width / 4.0)), FEWEST_POINTS, MOST_POINTS))
    at = np.linspace(low, high, points)
    step = at[1] - at[0]
    nearest = np.rint((intervals - low) / step).astype(np.intp)
    counts = np.bincount(nearest, minlength=points).astype(np.float64)
    half = int(np.ceil(REACH * width / step))
    kernel = np.exp(-0.5 * (np.arange(-half, half + 1) * step / width) ** 2)
    estimate = np.convolve(counts, kernel / kernel.sum(), mode="full")[half : half + points]
    return at, estimate / (estimate.sum() * step)


def _edges(low: float, high: float, width: float, resolution: float) -> Floats:
    step = max(width, (high - low) / MOST_BINS)
    if resolution > 0.0:
        step = resolution * np.ceil(step / resolution - 1e-9)
        # bins begin half-way between the points of the grid
        first = (np.floor(low / resolution + 1e-6) - 0.5) * resolution
    else:
        first = low - 0.5 * step
    bins = max(int(np.ceil((high - first) / step + 1e-9)), 1)
    return np.asarray(first + step * np.arange(bins + 1))


def _distinct(kernel: Floats, effective: float) -> NDArray[np.intp]:
    """Return the places of distinct peaks; `effective`: number of intervals times bandwidth, s."""
    from scipy.signal import find_peaks

    padded = np.concatenate([[0.0], kernel, [0.0]])
    places, found = find_peaks(padded, height=LOWEST_PEAK * kernel.max(), prominence=0.0)
    heights, prominences = found["peak_heights"], found["prominences"]
    error = np.sqrt(ROUGHNESS * heights / effective)
    chosen = prominences >= np.maximum(PROMINENCE * heights, SIGNIFICANT * error)
    chosen |= heights == kernel.max()
    return np.asarray(places[chosen] - 1)

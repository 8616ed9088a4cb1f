"""The variables of the report on intervals: one function for each question, every variable with unit and name."""

from __future__ import annotations

import numpy as np

from vibroimpact.analysis.dataset.results import Rows
from vibroimpact.analysis.intervals.cycles import Cycle
from vibroimpact.analysis.intervals.delay_shares import CELLS, expected_shares, observed_shares
from vibroimpact.analysis.intervals.density import Density
from vibroimpact.analysis.intervals.gaps import MissedBeats
from vibroimpact.analysis.intervals.lattice import Lattice, Share
from vibroimpact.analysis.intervals.trains import IntervalTrain
from vibroimpact.analysis.intervals.variability import (
    coefficient_of_variation,
    fano_curve,
    fano_factor,
    rate,
)

# Difference of the share of delay points at (I, I) from its value for independent misses, above which it is reported.
LARGEST_EXCESS = 0.1


def interval_part(train: IntervalTrain) -> Rows:
    """Return the intervals in their order; delay vectors are successive intervals without a NaN."""
    along, begins = "interval_number", train.times[:-1]
    return {
        "interval": (along, train.separated, "s", "interspike interval, NaN where masked"),
        "interval_start": (along, begins, "s", "instant at which the interval begins"),
    }


def variability_part(train: IntervalTrain, count_bin: float | None) -> Rows:
    """Return rate, coefficient of variation and Fano factors."""
    value, error = rate(train)
    mean, median = float(np.mean(train.intervals)), float(np.median(train.intervals))
    varies = coefficient_of_variation(train)
    fano = fano_factor(train, count_bin or float(f"{mean:.0e}"))
    curve = fano_curve(train)
    widths, factors = np.array([f.width for f in curve]), np.array([f.value for f in curve])
    fano_error, of_error = fano.standard_error, "standard error of the"
    relative = "standard deviation (ddof 0) over mean of the intervals"
    of_bins = "variance (ddof 1) over mean of the counts, bins from the window's start"
    places = "Fano factor over 20 places of the first bin"
    return {
        "duration": ((), train.duration, "s", "observed time, without masked spans"),
        "rate": ((), value, "Hz", "events per second"),
        "rate_standard_error": ((), error, "Hz", f"{of_error} rate, from the counts in 20 long bins"),
        "mean_interval": ((), mean, "s", "mean interval"),
        "median_interval": ((), median, "s", "median interval"),
        "coefficient_of_variation": ((), varies, "1", relative),
        "fano_factor": ((), fano.value, "1", of_bins),
        "fano_standard_error": ((), fano_error, "1", f"{of_error} Fano factor, of independent bins"),
        "fano_bin": ((), fano.width, "s", "bin of the Fano factor"),
        "fano_lowest": ((), fano.lowest, "1", f"smallest {places}"),
        "fano_highest": ((), fano.highest, "1", f"largest {places}"),
        "fano_curve_bin": ("fano_point", widths, "s", "bin of the Fano curve"),
        "fano_curve": ("fano_point", factors, "1", "Fano factor over the bin"),
    }


def density_part(density: Density, cycle: Cycle) -> Rows:
    """Return the density of the intervals and the motion read from them."""
    at, bins, starts = "density_point", "density_bin", density.edges[:-1]
    return {
        "density_at": (at, density.at, "s", "interval"),
        "density": (at, density.kernel, "s-1", "Gaussian kernel density of the intervals"),
        "density_bandwidth": ((), density.bandwidth, "s", "standard deviation of the kernel"),
        "histogram_start": (bins, starts, "s", "lower edge of the bin"),
        "histogram": (bins, density.histogram, "s-1", "histogram of the intervals, as a density"),
        "histogram_bin_width": ((), density.bin_width, "s", "width of the bins"),
        "density_peak": ("peak", density.peaks, "s", "interval at a distinct peak of the density"),
        "cycle_impacts": ((), cycle.impacts, "1", "p of P(p,q), the smallest allowed; 0: no cycle"),
        "cycle_periods": ((), cycle.periods, "1", "q of P(p,q); 0: not known"),
        "cycle_duration": ((), cycle.duration, "s", "sum of the intervals of one cycle"),
    }


def gap_part(train: IntervalTrain, gaps: MissedBeats) -> tuple[Rows, str]:
    """Return the gaps of a nearly periodic train, and their number or the reason for a refusal, in words."""
    starts, lengths = train.times[gaps.place], np.diff(train.times)[gaps.place]
    spread = "robust coefficient of variation of the intervals about their local median"
    words = f"{len(gaps.place)} found, {int(gaps.missing.sum())} missed beats"
    rows: Rows = {
        "gap_start": ("gap", starts, "s", "last event before the gap"),
        "gap_length": ("gap", lengths, "s", "length of the gap"),
        "gap_missing": ("gap", gaps.missing, "1", "beats missing in the gap"),
        "interval_ratio": ("interval_number", gaps.ratio, "1", "interval over the median of its neighbours"),
        "local_spread": ((), gaps.spread, "1", spread),
    }
    return rows, f"not looked for: {gaps.reason}" if gaps.reason else words


def lattice_part(train: IntervalTrain, lattice: Lattice) -> tuple[Rows, str]:
    """Return missed and spurious spikes, the shares of the delay points that they explain, and both in words."""
    observed = expected = np.full(len(CELLS), np.nan)
    words = lattice.reason
    if not words:
        observed = observed_shares(train, lattice)
        expected = expected_shares(lattice.missed.value, lattice.spurious.value)
        words = (
            f"{lattice.counted_missed} of {lattice.places} places without a spike, "
            f"{lattice.counted_spurious} spikes between the places"
        )
        if abs(observed[0] - expected[0]) > LARGEST_EXCESS:
            words += (
                f"; but {100 * observed[0]:.0f} % of the delay points lie at (I, I), where independent misses leave "
                f"{100 * expected[0]:.0f} %: they are not independent, or this is another motion"
            )
    cell = "delay_cell"
    from_both = "the same, from the probabilities of missed and spurious spikes"
    rows: Rows = {
        "lattice_interval": ((), lattice.interval, "s", "interval of the lattice of true spikes"),
        "lattice_jitter": ((), lattice.jitter, "s", "standard deviation of true spikes about the lattice"),
        **_share("missed", lattice.missed, "a true spike is missed"),
        **_share("spurious", lattice.spurious, "a true interval has a spurious spike"),
        "delay_share": (cell, observed, "1", "part of the delay points in the cell"),
        "delay_share_expected": (cell, expected, "1", from_both),
        cell: (cell, list(CELLS), "1", "cell of the delay plot, I: lattice interval"),
    }
    return rows, words


def _share(name: str, share: Share, words: str) -> Rows:
    return {
        f"{name}_probability": ((), share.value, "1", f"probability that {words}"),
        f"{name}_standard_error": ((), share.standard_error, "1", f"standard error: {words}"),
        f"{name}_upper": ((), share.upper, "1", f"upper 95 % bound: {words}"),
    }

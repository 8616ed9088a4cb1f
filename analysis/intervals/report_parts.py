"""The variables of the report on intervals: one function for each question, every variable with unit and name."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from vibroimpact.analysis.intervals.cycles import Cycle
from vibroimpact.analysis.intervals.delay_shares import CELLS, expected_shares, observed_shares
from vibroimpact.analysis.intervals.density import Density
from vibroimpact.analysis.intervals.dimension import Dimension
from vibroimpact.analysis.intervals.gaps import MissedBeats
from vibroimpact.analysis.intervals.lattice import Lattice, Share
from vibroimpact.analysis.intervals.trains import IntervalTrain
from vibroimpact.analysis.intervals.variability import (
    FanoFactor,
    coefficient_of_variation,
    fano_curve,
    fano_factor,
    rate,
    usual_bin,
)

# Of all delay points, at the main one: more than this beside what missed and spurious spikes explain is said.
UNEXPLAINED = 0.1

Variable = tuple[Any, Any, dict[str, str]]


def variable(dims: str | tuple[str, ...], values: Any, units: str, long_name: str) -> Variable:
    """Return a variable with its unit and its name in words; no dimension: a number."""
    return (dims or (), values, {"units": units, "long_name": long_name})


def interval_part(train: IntervalTrain) -> xr.Dataset:
    """Return the intervals in their order; delay vectors are successive ones without a NaN."""
    return xr.Dataset(
        {
            "interval": variable(
                "interval_number", train.separated, "s", "interspike interval, NaN where masked"
            ),
            "interval_start": variable(
                "interval_number", train.times[:-1], "s", "instant at which the interval begins"
            ),
        }
    )


def variability_part(train: IntervalTrain, count_bin: float | None) -> xr.Dataset:
    """Return rate, coefficient of variation and Fano factors."""
    found = rate(train)
    fano = fano_factor(train, count_bin if count_bin is not None else usual_bin(train))
    return xr.Dataset(
        {
            "duration": variable("", train.duration, "s", "observed time, without masked spans"),
            "rate": variable("", found.value, "Hz", "events per second"),
            "rate_standard_error": variable(
                "", found.standard_error, "Hz", "standard error of the rate, from the counts in 20 long bins"
            ),
            "mean_interval": variable("", float(np.mean(train.intervals)), "s", "mean interval"),
            "median_interval": variable("", float(np.median(train.intervals)), "s", "median interval"),
            "coefficient_of_variation": variable(
                "",
                coefficient_of_variation(train),
                "1",
                "standard deviation (ddof 0) over mean of the intervals",
            ),
            **_fano(fano),
            **_fano_curve(fano_curve(train)),
        }
    )


def density_part(density: Density, cycle: Cycle) -> xr.Dataset:
    """Return the density of the intervals and the motion read from them."""
    return xr.Dataset(
        {
            "density_at": variable("density_point", density.at, "s", "interval"),
            "density": variable(
                "density_point", density.kernel, "s-1", "Gaussian kernel density of the intervals"
            ),
            "density_bandwidth": variable("", density.bandwidth, "s", "standard deviation of the kernel"),
            "histogram_start": variable("density_bin", density.edges[:-1], "s", "lower edge of the bin"),
            "histogram": variable(
                "density_bin", density.histogram, "s-1", "histogram of the intervals, as a density"
            ),
            "histogram_bin_width": variable("", density.bin_width, "s", "width of the bins"),
            "density_peak": variable(
                "peak", density.peaks, "s", "interval at a distinct peak of the density"
            ),
            "cycle_impacts": variable(
                "", cycle.impacts, "1", "p of P(p,q), the smallest allowed; 0: no cycle"
            ),
            "cycle_periods": variable("", cycle.periods, "1", "q of P(p,q); 0: not known"),
            "cycle_duration": variable("", cycle.duration, "s", "sum of the intervals of one cycle"),
        },
        attrs={"cycle": cycle.words},
    )


def gap_part(train: IntervalTrain, gaps: MissedBeats) -> xr.Dataset:
    """Return the gaps of a nearly periodic train."""
    found = len(gaps.place)
    words = (
        f"not looked for: {gaps.reason}"
        if gaps.reason
        else f"{found} found, {int(gaps.missing.sum())} missed beats"
    )
    return xr.Dataset(
        {
            "gap_start": variable("gap", train.times[gaps.place], "s", "last event before the gap"),
            "gap_length": variable("gap", np.diff(train.times)[gaps.place], "s", "length of the gap"),
            "gap_missing": variable("gap", gaps.missing, "1", "beats missing in the gap"),
            "interval_ratio": variable(
                "interval_number", gaps.ratio, "1", "interval over the median of its neighbours"
            ),
            "local_spread": variable(
                "",
                gaps.spread,
                "1",
                "robust coefficient of variation of the intervals about their local median",
            ),
        },
        attrs={"gaps": words},
    )


def lattice_part(train: IntervalTrain, lattice: Lattice) -> xr.Dataset:
    """Return missed and spurious spikes, and the shares of the delay points that they explain."""
    refused = bool(lattice.reason)
    unknown = np.full(len(CELLS), np.nan)
    observed = unknown if refused else observed_shares(train, lattice)
    expected = unknown if refused else expected_shares(lattice.missed.value, lattice.spurious.value)
    words = lattice.reason or (
        f"{lattice.counted_missed} of {lattice.places} places without a spike, "
        f"{lattice.counted_spurious} spikes between the places"
    )
    if not refused and abs(observed[0] - expected[0]) > UNEXPLAINED:
        words += (
            f"; but {100 * observed[0]:.0f} % of the delay points lie at (I, I), where independent misses leave "
            f"{100 * expected[0]:.0f} %: they are not independent, or this is another motion"
        )
    return xr.Dataset(
        {
            "lattice_interval": variable("", lattice.interval, "s", "interval of the lattice of true spikes"),
            "lattice_jitter": variable(
                "", lattice.jitter, "s", "standard deviation of true spikes about the lattice"
            ),
            **_share("missed", lattice.missed, "a true spike is missed"),
            **_share("spurious", lattice.spurious, "a true interval has a spurious spike"),
            "delay_share": variable("delay_cell", observed, "1", "part of the delay points in the cell"),
            "delay_share_expected": variable(
                "delay_cell", expected, "1", "the same, from the probabilities of missed and spurious spikes"
            ),
        },
        coords={
            "delay_cell": variable(
                "delay_cell", list(CELLS), "1", "cell of the delay plot, I: lattice interval"
            )
        },
        attrs={"lattice": words},
    )


def dimension_part(dimension: Dimension) -> xr.Dataset:
    """Return correlation sums and slopes on one scale, beside those of shuffled surrogates."""
    scale, kind = dimension.scale, {"raw": "intervals", "log": "ln(interval / 1 s)"}[dimension.scale]
    by_m, by_radius = ("embedding",), ("embedding", f"radius_{scale}")
    sums = dimension.sums
    empty = np.empty((len(dimension.slopes), 0))
    variables = {
        f"slope_{scale}": variable(by_m, dimension.slopes, "1", f"correlation slope of {kind}"),
        f"surrogate_slope_{scale}": variable(
            by_m, dimension.surrogate_slopes, "1", f"correlation slope of shuffled {kind}, mean"
        ),
        f"surrogate_spread_{scale}": variable(
            by_m, dimension.surrogate_spread, "1", f"correlation slope of shuffled {kind}, standard deviation"
        ),
        f"correlation_sum_{scale}": variable(
            by_radius, empty if sums is None else sums.sums, "1", f"correlation sum of {kind}"
        ),
        f"local_slope_{scale}": variable(
            by_radius,
            empty if sums is None else sums.local_slopes,
            "1",
            f"local slope of {kind}, over half an octave",
        ),
        f"surrogate_sum_{scale}": variable(
            by_radius, dimension.surrogate_sums, "1", f"correlation sum of shuffled {kind}, mean"
        ),
        f"surrogate_local_slope_{scale}": variable(
            by_radius, dimension.surrogate_local_slopes, "1", f"local slope of shuffled {kind}, mean"
        ),
    }
    radii = np.empty(0) if sums is None else sums.radii
    coords = {
        "embedding": variable(
            "embedding", np.arange(1, len(dimension.slopes) + 1), "1", "numbers in a delay vector"
        ),
        f"radius_{scale}": variable(
            f"radius_{scale}", radii, "s" if scale == "raw" else "1", "radius in the max norm"
        ),
    }
    attrs: dict[str, Any] = {
        f"dimension_{scale}": dimension.words,
        f"dimension_{scale}_warnings": "\n".join(dimension.warnings),
        "slope_window": list(dimension.window),
    }
    if sums is not None:
        attrs["theiler"] = sums.theiler
    return xr.Dataset(variables, coords=coords, attrs=attrs)


def _fano(fano: FanoFactor) -> dict[str, Variable]:
    return {
        "fano_factor": variable(
            "", fano.value, "1", "variance (ddof 1) over mean of the counts, bins from the window's start"
        ),
        "fano_standard_error": variable(
            "", fano.standard_error, "1", "standard error of the Fano factor, of independent bins"
        ),
        "fano_bin": variable("", fano.width, "s", "bin of the Fano factor"),
        "fano_lowest": variable("", fano.lowest, "1", "smallest Fano factor over 20 places of the first bin"),
        "fano_highest": variable(
            "", fano.highest, "1", "largest Fano factor over 20 places of the first bin"
        ),
    }


def _fano_curve(curve: list[FanoFactor]) -> dict[str, Variable]:
    return {
        "fano_curve_bin": variable(
            "fano_point", np.array([f.width for f in curve]), "s", "bin of the Fano curve"
        ),
        "fano_curve": variable(
            "fano_point", np.array([f.value for f in curve]), "1", "Fano factor over the bin"
        ),
    }


def _share(name: str, share: Share, words: str) -> dict[str, Variable]:
    return {
        f"{name}_probability": variable("", share.value, "1", f"probability that {words}"),
        f"{name}_standard_error": variable("", share.standard_error, "1", f"standard error: {words}"),
        f"{name}_upper": variable("", share.upper, "1", f"upper 95 % bound: {words}"),
    }

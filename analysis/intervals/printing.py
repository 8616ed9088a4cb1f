"""The report on intervals as printed tables and sentences."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import xarray as xr

from vibroimpact.analysis.intervals.dimension import SCALES
from vibroimpact.fmus.printing import table, with_error
from vibroimpact.fmus.terminal import Terminal


def print_intervals(console: Terminal, report: xr.Dataset) -> None:
    """Print the report of `interval_report`: numbers with their errors, verdicts with their reasons."""
    numbers = {str(name): float(value) for name, value in report.data_vars.items() if value.ndim == 0}
    rows = (*_rows(report, numbers), *_lattice_rows(report, numbers))
    console.print(table("Intervals", "<quantity", "<value", "<how", rows=rows))
    for heading, verdict in (("Motion", "cycle"), ("Lattice", "lattice"), ("Gaps", "gaps")):
        console.print(f"{heading}: {report.attrs[verdict]}.", soft_wrap=True)
    _print_gaps(console, report)
    _print_dimension(console, report)


# Largest number of gaps printed one by one.
_MOST_GAPS = 20


def _rows(report: xr.Dataset, numbers: Mapping[str, float]) -> Iterator[tuple[str, str, str]]:
    attributes = report.attrs
    begin, end = attributes["window"]
    window = f"from {begin:.6g} to {end:.6g} s ({attributes['window_from']}), {attributes['masked_spans']} masked spans"
    yield "events", str(attributes["events"]), window
    rate = numbers["rate"]
    per_minute = f"{60.0 * rate:.2f} per minute; standard error from 20 long bins"
    yield "rate", with_error(rate, numbers["rate_standard_error"], "Hz"), per_minute
    median = f"mean; median {numbers['median_interval']:.5g} s"
    yield "interval", f"{numbers['mean_interval']:.5g} s", median
    variation = f"{numbers['coefficient_of_variation']:.4f}"
    yield "coefficient of variation", variation, "standard deviation (ddof 0) over mean"
    yield (
        "Fano factor",
        with_error(numbers["fano_factor"], numbers["fano_standard_error"]),
        f"ddof 1, bins of {numbers['fano_bin']:.4g} s from the window's start; "
        f"{numbers['fano_lowest']:.4f} to {numbers['fano_highest']:.4f} with other offsets",
    )
    peaks = report["density_peak"].values
    places = ", ".join(f"{peak:.4g}" for peak in peaks[:6]) + (", ..." if len(peaks) > 6 else "")
    widths = f"bandwidth {numbers['density_bandwidth']:.3g} s, bins of {numbers['histogram_bin_width']:.3g} s"
    yield "peaks of the density", str(len(peaks)), f"at {places} s; {widths}"


def _lattice_rows(report: xr.Dataset, numbers: Mapping[str, float]) -> Iterator[tuple[str, str, str]]:
    interval = numbers["lattice_interval"]
    if not np.isfinite(interval):
        return
    scatter = f"true spikes scatter by {numbers['lattice_jitter']:.2g} s about it"
    yield "lattice interval", f"{interval:.6g} s", scatter
    for name, words in (("missed", "per true spike"), ("spurious", "per true interval")):
        value = with_error(numbers[f"{name}_probability"], numbers[f"{name}_standard_error"])
        yield f"{name} spikes", value, f"{words}; below {numbers[f'{name}_upper']:.2g} with 95 % confidence"
    columns = (report[name].values for name in ("delay_cell", "delay_share", "delay_share_expected"))
    for cell, share, expected in zip(*columns, strict=True):
        yield f"delay points, {cell}", f"{share:.4f}", f"{expected:.4f} from these probabilities"


def _print_gaps(console: Terminal, report: xr.Dataset) -> None:
    if not report.sizes["gap"]:
        return
    columns = (report[name].values for name in ("gap_start", "gap_length", "gap_missing"))
    shown = list(zip(*columns, strict=True))[:_MOST_GAPS]
    rows = ((f"{start:.4f}", f"{length:.4f}", str(missing)) for start, length, missing in shown)
    console.print(table("Gaps", ">after, s", ">length, s", ">beats missing", rows=rows))
    if report.sizes["gap"] > _MOST_GAPS:
        console.print(f"and {report.sizes['gap'] - _MOST_GAPS} more")


def _print_dimension(console: Terminal, report: xr.Dataset) -> None:
    low, high = report.attrs["slope_window"]
    if any(np.isfinite(report[f"slope_{scale}"].values).any() for scale in SCALES):
        console.print(f"Slope of the correlation sum, C from {low:g} to {high:g}")
        rows = table("", ">m", ">raw", ">shuffled", ">log", ">shuffled")
        for m in report["embedding"].values:
            cells = (cell for scale in SCALES for cell in _slope_cells(report, scale, int(m)))
            rows.add_row(str(m), *cells)
        console.print(rows)
    for scale in SCALES:
        words = report.attrs[f"dimension_{scale}"]
        console.print(f"Dimension of {scale} intervals: {words}.", soft_wrap=True)
    warnings = dict.fromkeys(
        line for scale in SCALES for line in report.attrs[f"dimension_{scale}_warnings"].splitlines()
    )
    for line in warnings:
        console.print(f"Note: {line}.", soft_wrap=True)


def _slope_cells(report: xr.Dataset, scale: str, m: int) -> tuple[str, str]:
    names = (f"slope_{scale}", f"surrogate_slope_{scale}", f"surrogate_spread_{scale}")
    slope, surrogate, spread = (float(report[name].sel(embedding=m)) for name in names)
    shuffled = f"{surrogate:.2f} ± {spread:.2f}"
    return (f"{slope:.2f}" if np.isfinite(slope) else "-"), (shuffled if np.isfinite(surrogate) else "-")

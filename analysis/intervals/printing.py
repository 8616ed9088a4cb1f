"""What the intervals tell, as tables and sentences."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from vibroimpact.fmus.printing import table, with_error
from vibroimpact.fmus.terminal import Terminal


def print_intervals(console: Terminal, report: xr.Dataset) -> None:
    """Print the report of `interval_report`: numbers with their doubt, verdicts with their reasons."""
    rows = table("Intervals", "<quantity", "<value", "<how")
    for row in (*_rows(report), *_lattice_rows(report)):
        rows.add_row(*row)
    console.print(rows)
    console.print(f"Motion: {report.attrs['cycle']}.", soft_wrap=True)
    console.print(f"Lattice: {report.attrs['lattice']}.", soft_wrap=True)
    console.print(f"Gaps: {report.attrs['gaps']}.", soft_wrap=True)
    _print_gaps(console, report)
    _print_dimension(console, report)


# Gaps printed one by one.
_MOST_GAPS = 20


def _rows(report: xr.Dataset) -> Iterator[tuple[str, str, str]]:
    window = report.attrs["window"]
    yield (
        "events",
        str(report.attrs["events"]),
        f"from {window[0]:.6g} to {window[1]:.6g} s ({report.attrs['window_from']}), "
        f"{report.attrs['masked_spans']} masked spans",
    )
    value = _number(report, "rate")
    per_minute = f"{60.0 * value:.2f} per minute; standard error from 20 long bins"
    yield "rate", with_error(value, _number(report, "rate_standard_error"), "Hz"), per_minute
    yield (
        "interval",
        f"{_number(report, 'mean_interval'):.5g} s",
        f"mean; median {_number(report, 'median_interval'):.5g} s",
    )
    yield (
        "coefficient of variation",
        f"{_number(report, 'coefficient_of_variation'):.4f}",
        "standard deviation (ddof 0) over mean",
    )
    yield (
        "Fano factor",
        with_error(_number(report, "fano_factor"), _number(report, "fano_standard_error")),
        f"ddof 1, bins of {_number(report, 'fano_bin'):.4g} s from the window's start; "
        f"{_number(report, 'fano_lowest'):.4f} to {_number(report, 'fano_highest'):.4f} with other offsets",
    )
    peaks = report["density_peak"].values
    places = ", ".join(f"{peak:.4g}" for peak in peaks[:6]) + (", ..." if len(peaks) > 6 else "")
    yield (
        "peaks of the density",
        str(len(peaks)),
        f"at {places} s; bandwidth {_number(report, 'density_bandwidth'):.3g} s, "
        f"bins of {_number(report, 'histogram_bin_width'):.3g} s",
    )


def _lattice_rows(report: xr.Dataset) -> Iterator[tuple[str, str, str]]:
    if not np.isfinite(_number(report, "lattice_interval")):
        return
    yield (
        "lattice interval",
        f"{_number(report, 'lattice_interval'):.6g} s",
        f"true spikes scatter by {_number(report, 'lattice_jitter'):.2g} s about it",
    )
    for name, words in (("missed", "per true spike"), ("spurious", "per true interval")):
        value = with_error(_number(report, f"{name}_probability"), _number(report, f"{name}_standard_error"))
        yield (
            f"{name} spikes",
            value,
            f"{words}; below {_number(report, f'{name}_upper'):.2g} with 95 % confidence",
        )
    shares = zip(
        report["delay_cell"].values, report["delay_share"], report["delay_share_expected"], strict=True
    )
    for cell, share, expected in shares:
        how = f"{float(expected):.4f} from these probabilities"
        yield f"delay points, {cell}", f"{float(share):.4f}", how


def _print_gaps(console: Terminal, report: xr.Dataset) -> None:
    if not report.sizes["gap"]:
        return
    rows = table("Gaps", ">after, s", ">length, s", ">beats missing")
    columns = (report[name].values for name in ("gap_start", "gap_length", "gap_missing"))
    for start, length, missing in list(zip(*columns, strict=True))[:_MOST_GAPS]:
        rows.add_row(f"{start:.4f}", f"{length:.4f}", str(missing))
    console.print(rows)
    if report.sizes["gap"] > _MOST_GAPS:
        console.print(f"and {report.sizes['gap'] - _MOST_GAPS} more")


def _print_dimension(console: Terminal, report: xr.Dataset) -> None:
    scales = ("raw", "log")
    low, high = report.attrs["slope_window"]
    if any(np.isfinite(report[f"slope_{scale}"].values).any() for scale in scales):
        console.print(f"Slope of the correlation sum, C from {low:g} to {high:g}")
        rows = table("", ">m", ">raw", ">shuffled", ">log", ">shuffled")
        for m in report["embedding"].values:
            cells = (cell for scale in scales for cell in _slope_cells(report, scale, int(m)))
            rows.add_row(str(m), *cells)
        console.print(rows)
    for scale, kind in zip(scales, ("raw intervals", "log intervals"), strict=True):
        words = report.attrs[f"dimension_{scale}"]
        console.print(f"Dimension of {kind}: {words}.", soft_wrap=True)
    warnings = dict.fromkeys(
        line for scale in scales for line in report.attrs[f"dimension_{scale}_warnings"].splitlines()
    )
    for line in warnings:
        console.print(f"Note: {line}.", soft_wrap=True)


def _slope_cells(report: xr.Dataset, scale: str, m: int) -> tuple[str, str]:
    at = report.sel(embedding=m)
    slope, surrogate = _number(at, f"slope_{scale}"), _number(at, f"surrogate_slope_{scale}")
    shuffled = f"{surrogate:.2f} ± {_number(at, f'surrogate_spread_{scale}'):.2f}"
    return (f"{slope:.2f}" if np.isfinite(slope) else "-"), (shuffled if np.isfinite(surrogate) else "-")


def _number(report: xr.Dataset, name: str) -> float:
    return float(report[name])

"""Comparisons as a printed table."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from rich.table import Table

from vibroimpact.analysis.recording.units import measured_unit, unit_label
from vibroimpact.analysis.replay.comparison import Comparison
from vibroimpact.analysis.replay.held import MOST_ERROR, instant
from vibroimpact.analysis.replay.replay_dataset import comparison_names
from vibroimpact.analysis.replay.spectra import DominantFrequency
from vibroimpact.fmus.printing import table, with_error
from vibroimpact.fmus.terminal import Terminal

_MOST_WINDOWS = 12


def print_comparison(console: Terminal, comparisons: Sequence[Comparison]) -> None:
    """Print the scores of comparisons, a column for each, and the remarks for a reader.

    Parameters
    ----------
    console : Terminal
    comparisons : sequence of Comparison
    """
    names = comparison_names(comparisons)
    rows = table("Simulated against measured", "<score", *(f">{name}" for name in names))
    for heading, cell in _ROWS:
        cells = [cell(comparison) for comparison in comparisons]
        if any(cells):
            rows.add_row(heading, *cells)
    _add_windows(rows, comparisons)
    console.print(rows)
    for name, comparison in zip(names, comparisons, strict=True):
        for remark in comparison.remarks:
            console.print(f"{name}: {remark}")


def _percent(value: float) -> str:
    return f"{value:.2f} %" if np.isfinite(value) else "-"


def _lag(comparison: Comparison) -> str:
    found = comparison.alignment
    if found.lag_error <= 0.0:
        return f"{1e3 * found.lag:.4f} ms (given)"
    return with_error(1e3 * found.lag, 1e3 * found.lag_error, "ms")


def _margin(value: float) -> str:
    return f"{value:.3f}" if np.isfinite(value) else "-"


def _frequency(line: DominantFrequency) -> str:
    return with_error(line.frequency, line.uncertainty, "Hz")


def _offset(comparison: Comparison) -> str:
    """Return the offset in the unit of the channel."""
    unit = measured_unit(comparison.measured.unit)
    label = "" if unit.cf == "1" else f" {unit_label(unit.cf)}"
    return f"{comparison.offset / unit.factor:.4g}{label}"


def _counts(comparison: Comparison) -> str:
    return ", ".join(f"{count} {why.replace('_', ' ')}" for why, count in comparison.counts.items() if count)


def _peaks(comparison: Comparison) -> str:
    peaks = comparison.peaks
    if peaks is None:
        return ""
    return f"{100 * peaks.worst:.1f} % of {len(peaks.time)}" if len(peaks.time) else "no peaks"


def _events(comparison: Comparison) -> str:
    match = comparison.events
    if match is None:
        return ""
    return f"{len(match.measured)} matched, {len(match.missed)} missed, {len(match.extra)} extra"


_ROWS: tuple[tuple[str, Callable[[Comparison], str]], ...] = (
    ("simulated", lambda c: c.simulated_name),
    ("variance accounted for", lambda c: _percent(c.variance)),
    ("  of a perfect model (noise)", lambda c: _percent(c.noise_ceiling)),
    (f"error within {100 * MOST_ERROR:.0f} %", lambda c: c.held.words),
    ("best gain", lambda c: f"{c.gain:.4f}"),
    ("lag", _lag),
    ("polarity", lambda c: f"{c.alignment.polarity:+d}"),
    ("correlation at the start", lambda c: f"{c.alignment.correlation:.4f}"),
    ("  less the other polarity's", lambda c: _margin(c.alignment.polarity_margin)),
    ("  less the next best lag's", lambda c: _margin(c.alignment.lag_margin)),
    ("onset of the event", lambda c: instant(c.event.onset)),
    ("offset removed", _offset),
    ("measured frequency", lambda c: _frequency(c.measured_frequency)),
    ("simulated frequency", lambda c: _frequency(c.simulated_frequency)),
    ("  resolved within", lambda c: f"{c.measured_frequency.resolution:.3g} Hz"),
    ("worst error of a peak", _peaks),
    ("events", _events),
    ("samples", _counts),
)


def _add_windows(rows: Table, comparisons: Sequence[Comparison]) -> None:
    """Add a row for each window: requested windows first, then running windows, in ms from the onset."""
    requested = [dict(zip(c.windows, c.window_variance, strict=True)) for c in comparisons]
    running = [dict(zip(c.running, c.running_variance, strict=True)) for c in comparisons]
    for heading, scored in (("window", requested), ("running", running)):
        spans = sorted({span for scores in scored for span in scores})
        if len(spans) > _MOST_WINDOWS:
            # the windows of the channels differ; the dataset and the figure have them
            continue
        for span in spans:
            cells = [_percent(scores[span]) if span in scores else "" for scores in scored]
            rows.add_row(f"  {heading} {instant(span[0])} to {instant(span[1])}", *cells)

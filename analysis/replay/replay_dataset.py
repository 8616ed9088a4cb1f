"""Comparisons as a dataset: signals on the clock of the recording, and the scores of each comparison."""

from __future__ import annotations

from collections.abc import Sequence
from operator import attrgetter
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.assembling import new_axis
from vibroimpact.analysis.dataset.results import Rows, described
from vibroimpact.analysis.recording import TimeAxis
from vibroimpact.analysis.recording.channels import QUALITY_FLAGS
from vibroimpact.analysis.recording.units import measured_unit
from vibroimpact.analysis.replay.comparison import Comparison
from vibroimpact.analysis.replay.scoring import Span

Floats = NDArray[np.float64]

# One number for each comparison: name, unit, words, and its attribute in a comparison.
_NUMBERS = (
    ("variance_accounted_for", "%", "variance accounted for, all scored samples", "variance"),
    ("noise_ceiling", "%", "variance that a perfect model would account for", "noise_ceiling"),
    ("gain", "1", "factor that would bring the simulated signal nearest", "gain"),
    ("lag", "s", "measured clock less clock of the drive", "alignment.lag"),
    ("lag_error", "s", "standard error of the lag", "alignment.lag_error"),
    ("polarity", "1", "sign given to the simulated signal", "alignment.polarity"),
    ("polarity_margin", "1", "correlation less that of the other polarity", "alignment.polarity_margin"),
    ("lag_margin", "1", "correlation less that of the next best lag", "alignment.lag_margin"),
    ("alignment_correlation", "1", "correlation at the start of the event", "alignment.correlation"),
    ("alignment_start", "s", "first instant used for the alignment", "alignment.window.start"),
    ("alignment_stop", "s", "last instant used for the alignment", "alignment.window.stop"),
    ("lag_at_bound", "1", "1 where the lag is the largest allowed", "alignment.at_bound"),
    ("onset", "s", "onset of the measured event", "event.onset"),
    ("measured_frequency", "Hz", "dominant frequency of the measured event", "measured_frequency.frequency"),
    (
        "simulated_frequency",
        "Hz",
        "dominant frequency of the simulated event",
        "simulated_frequency.frequency",
    ),
    (
        "frequency_resolution",
        "Hz",
        "frequencies closer than this are one line",
        "measured_frequency.resolution",
    ),
    ("frequency_uncertainty", "Hz", "from the sampling interval alone", "measured_frequency.uncertainty"),
)
# Counts of samples in `Comparison.counts`, in words.
_COUNTS = {
    "scored": "samples that were scored",
    "clipped": "clipped samples, not scored",
    "missing": "missing or overrange samples, not scored",
    "not_simulated": "good samples outside the simulated time",
}


def comparison_names(comparisons: Sequence[Comparison]) -> list[str]:
    """Return a name for each comparison: the name of its channel, numbered if it occurs again."""
    names: list[str] = []
    for comparison in comparisons:
        name, number = comparison.measured.name, 1
        while name in names:
            number += 1
            name = f"{comparison.measured.name}_{number}"
        names.append(name)
    return names


def comparison_dataset(comparisons: Sequence[Comparison]) -> xr.Dataset:
    """Return comparisons as one dataset, ready for `write_results(kind="replay")`.

    Signals `NAME_measured`, `NAME_simulated`, `NAME_residual` (SI, minus the offset) and `NAME_quality` are on `time`,
    or on `time_2`, ... for channels with further time axes, always the clock of the recording. Scores have the
    dimension `comparison`; scores in windows also have `window` or `running_window` (s from the onset). Extremes and
    events are `NAME_peak_...`, `NAME_event_...`. The attribute `remarks` has the remarks for a reader, line by line.

    Parameters
    ----------
    comparisons : sequence of Comparison
        At least one.
    """
    names = comparison_names(comparisons)
    variables: dict[str, Any] = {}
    axes: dict[int, tuple[str, TimeAxis]] = {}
    for name, comparison in zip(names, comparisons, strict=True):
        axis, number = comparison.measured.axis, len(axes) + 1
        dimension, _ = axes.setdefault(id(axis), ("time" if number == 1 else f"time_{number}", axis))
        variables |= _signals(name, comparison, dimension)
        variables |= described({**_peaks(name, comparison), **_events(name, comparison)})
    windows = [(comparison.windows, comparison.window_variance) for comparison in comparisons]
    running = [(comparison.running, comparison.running_variance) for comparison in comparisons]
    variables |= described(
        {
            **_scores(comparisons),
            **_windows("window", "window from the onset", windows),
            **_windows("running_window", "running window from the onset", running),
        }
    )
    coordinates = described({"comparison": ("comparison", names, "1", "measured channel")})
    for name, axis in axes.values():
        known = {"interval_uncertainty": axis.interval_uncertainty, "trigger": axis.trigger}
        attrs = {"units": "s", "long_name": "time of the recording", **known}
        coordinates[name] = new_axis(name, axis.time, attrs)
    remarks = [f"{name}: {line}" for name, c in zip(names, comparisons, strict=True) for line in c.remarks]
    return xr.Dataset(variables, coordinates, {"remarks": "\n".join(remarks)})


def _scores(comparisons: Sequence[Comparison]) -> Rows:
    """Return one value for each comparison: its numbers, counts, name of the simulated signal, and held span."""
    along = "comparison"

    def numbers(path: str) -> Floats:
        return np.array([float(attrgetter(path)(comparison)) for comparison in comparisons])

    counts = [comparison.counts for comparison in comparisons]
    simulated = [comparison.simulated_name for comparison in comparisons]
    held = [comparison.held.words for comparison in comparisons]
    return {
        **{name: (along, numbers(path), unit, words) for name, unit, words, path in _NUMBERS},
        **{
            f"samples_{why}": (along, np.array([float(each[why]) for each in counts]), "1", words)
            for why, words in _COUNTS.items()
        },
        "simulated_name": (along, simulated, "1", "what was compared"),
        "held": (along, held, "1", "where the error stays within what is trusted"),
    }


def _signals(name: str, comparison: Comparison, dimension: str) -> dict[str, Any]:
    channel, simulated = comparison.measured, comparison.simulated_name
    unit = measured_unit(channel.unit).si
    label = channel.label or channel.name
    known = {"offset_removed": comparison.offset, "noise": comparison.event.noise}
    signals: dict[str, tuple[Any, str, dict[str, Any]]] = {
        "measured": (comparison.values, f"{label}, measured, less its offset", known),
        "simulated": (comparison.simulated, f"{simulated}, simulated, aligned", {}),
        "residual": (comparison.residual, f"{label}, measured less simulated", {}),
    }
    variables: dict[str, Any] = {
        f"{name}_{role}": (dimension, values, {"units": unit, "long_name": words, "role": role} | more)
        for role, (values, words, more) in signals.items()
    }
    quality = {"units": "1", "long_name": f"quality of {label}"} | QUALITY_FLAGS
    return variables | {f"{name}_quality": (dimension, channel.quality, quality)}


def _peaks(name: str, comparison: Comparison) -> Rows:
    peaks = comparison.peaks
    if peaks is None:
        return {}
    unit, along = measured_unit(comparison.measured.unit).si, f"{name}_peak"
    instants, errors = peaks.time + comparison.event.onset, peaks.relative_error
    return {
        f"{along}_time": (along, instants, "s", "instant of the measured extreme"),
        f"{along}_measured": (along, peaks.measured, unit, "measured extreme"),
        f"{along}_simulated": (along, peaks.simulated, unit, "simulated extreme"),
        f"{along}_error": (along, errors, "1", "relative error of the simulated extreme"),
        f"{along}_delay": (along, peaks.delay, "s", "simulated less measured instant"),
    }


def _events(name: str, comparison: Comparison) -> Rows:
    match = comparison.events
    if match is None:
        return {}
    matched, event = f"{name}_matched", f"{name}_event"
    alone = "simulated event without a measured one, on the measured clock"
    return {
        f"{event}_matched": (matched, match.measured, "s", "measured event that has a simulated one"),
        f"{event}_missed": (f"{name}_missed", match.missed, "s", "measured event without a simulated one"),
        f"{event}_extra": (f"{name}_extra", match.extra, "s", alone),
        f"{event}_delay": (matched, match.delay, "s", "simulated less measured instant"),
    }


def _windows(name: str, words: str, scored: Sequence[tuple[list[Span], Floats]]) -> Rows:
    """Return start, stop and score of the windows of each comparison; NaN stands for missing windows."""
    most = max(len(spans) for spans, _ in scored)
    if not most:
        return {}
    table = np.full((3, len(scored), most), np.nan)
    for row, (spans, variance) in enumerate(scored):
        for place, span in enumerate(spans):
            table[:, row, place] = (*span, variance[place])
    shape = ("comparison", name)
    return {
        f"{name}_start": (shape, table[0], "s", f"start of a {words}"),
        f"{name}_stop": (shape, table[1], "s", f"stop of a {words}"),
        f"{name}_variance": (shape, table[2], "%", f"variance accounted for in a {words}"),
    }

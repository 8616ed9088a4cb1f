"""Comparisons as a dataset: signals on the clock of the recording, and the scores of each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.recording import Quality, TimeAxis
from vibroimpact.analysis.recording.units import measured_unit
from vibroimpact.analysis.replay.comparison import Comparison
from vibroimpact.analysis.replay.scoring import Span

Floats = NDArray[np.float64]

# One number for each comparison: name, unit, in words, and where it is found.
_NUMBERS: tuple[tuple[str, str, str, Callable[[Comparison], float]], ...] = (
    ("variance_accounted_for", "%", "variance accounted for, all scored samples", lambda c: c.variance),
    ("noise_ceiling", "%", "variance that a perfect model would account for", lambda c: c.noise_ceiling),
    ("gain", "1", "factor that would bring the simulated signal nearest", lambda c: c.gain),
    ("lag", "s", "measured clock less clock of the drive", lambda c: c.alignment.lag),
    ("lag_error", "s", "standard error of the lag", lambda c: c.alignment.lag_error),
    ("polarity", "1", "sign given to the simulated signal", lambda c: c.alignment.polarity),
    (
        "polarity_margin",
        "1",
        "correlation less that of the other polarity",
        lambda c: c.alignment.polarity_margin,
    ),
    ("lag_margin", "1", "correlation less that of the next best lag", lambda c: c.alignment.lag_margin),
    (
        "alignment_correlation",
        "1",
        "correlation at the start of the event",
        lambda c: c.alignment.correlation,
    ),
    ("alignment_start", "s", "first instant used for the alignment", lambda c: c.alignment.window[0]),
    ("alignment_stop", "s", "last instant used for the alignment", lambda c: c.alignment.window[1]),
    ("lag_at_bound", "1", "1 where the lag is the largest allowed", lambda c: c.alignment.at_bound),
    ("onset", "s", "onset of the measured event", lambda c: c.event.onset),
    (
        "measured_frequency",
        "Hz",
        "dominant frequency of the measured event",
        lambda c: c.measured_frequency.frequency,
    ),
    (
        "simulated_frequency",
        "Hz",
        "dominant frequency of the simulated event",
        lambda c: c.simulated_frequency.frequency,
    ),
    (
        "frequency_resolution",
        "Hz",
        "frequencies closer than this are one line",
        lambda c: c.measured_frequency.resolution,
    ),
    (
        "frequency_uncertainty",
        "Hz",
        "from the sampling interval alone",
        lambda c: c.measured_frequency.uncertainty,
    ),
    ("samples_scored", "1", "samples that were scored", lambda c: c.counts["scored"]),
    ("samples_clipped", "1", "clipped samples, not scored", lambda c: c.counts["clipped"]),
    ("samples_missing", "1", "missing or overrange samples, not scored", lambda c: c.counts["missing"]),
    (
        "samples_not_simulated",
        "1",
        "good samples outside the simulated time",
        lambda c: c.counts["not_simulated"],
    ),
)


def comparison_names(comparisons: Sequence[Comparison]) -> list[str]:
    """Return a name for each comparison: that of its channel, numbered where it comes again."""
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

    Signals `NAME_measured`, `NAME_simulated`, `NAME_residual` (SI, less the offset) and `NAME_quality` are on `time`,
    or `time_2`, ... for channels of further time axes, always the clock of the recording. Scores have the dimension
    `comparison`; those in windows `window` and `running_window` as well (s from the onset). Extremes and events are
    `NAME_peak_...`, `NAME_event_...`. What a reader must know is in the attribute `remarks`, line by line.

    Parameters
    ----------
    comparisons : sequence of Comparison
        At least one.
    """
    names = comparison_names(comparisons)
    variables: dict[str, Any] = {}
    axes: list[TimeAxis] = []
    for name, comparison in zip(names, comparisons, strict=True):
        place = next((k for k, axis in enumerate(axes) if axis is comparison.measured.axis), len(axes))
        if place == len(axes):
            axes.append(comparison.measured.axis)
        variables |= _signals(name, comparison, "time" if place == 0 else f"time_{place + 1}")
        variables |= _peaks(name, comparison) | _events(name, comparison)
    for name, unit, words, read in _NUMBERS:
        numbers = np.array([float(read(comparison)) for comparison in comparisons])
        variables[name] = ("comparison", numbers, _attrs(unit, words))
    simulated = [comparison.simulated_name for comparison in comparisons]
    variables["simulated_name"] = ("comparison", simulated, _attrs("1", "what was compared"))
    held = [comparison.held.words for comparison in comparisons]
    variables["held"] = ("comparison", held, _attrs("1", "where the error stays within what is trusted"))
    variables |= _windows(
        "window",
        "window from the onset",
        [(comparison.windows, comparison.window_variance) for comparison in comparisons],
    )
    variables |= _windows(
        "running_window",
        "running window from the onset",
        [(comparison.running, comparison.running_variance) for comparison in comparisons],
    )
    coordinates: dict[str, Any] = {"comparison": ("comparison", names, _attrs("1", "measured channel"))}
    for place, axis in enumerate(axes):
        name = "time" if place == 0 else f"time_{place + 1}"
        attrs = _attrs("s", "time of the recording") | {
            "interval_uncertainty": axis.interval_uncertainty,
            "trigger": axis.trigger,
        }
        coordinates[name] = (name, axis.time, attrs)
    remarks = [f"{name}: {line}" for name, c in zip(names, comparisons, strict=True) for line in c.remarks]
    return xr.Dataset(variables, coordinates, {"remarks": "\n".join(remarks)})


def _attrs(unit: str, words: str) -> dict[str, Any]:
    return {"units": unit, "long_name": words}


def _signals(name: str, comparison: Comparison, dimension: str) -> dict[str, Any]:
    channel = comparison.measured
    unit = measured_unit(channel.unit).si
    label = channel.label or channel.name
    known = {"role": "measured", "offset_removed": comparison.offset, "noise": comparison.event.noise}
    flags = {
        "flag_masks": np.array([int(flag) for flag in Quality], dtype=np.uint8),
        "flag_meanings": " ".join(str(flag.name) for flag in Quality),
    }
    measured = _attrs(unit, f"{label}, measured, less its offset") | known
    simulated = _attrs(unit, f"{comparison.simulated_name}, simulated, aligned") | {"role": "simulated"}
    residual = _attrs(unit, f"{label}, measured less simulated") | {"role": "residual"}
    quality = _attrs("1", f"quality of {label}") | flags
    return {
        f"{name}_measured": (dimension, comparison.values, measured),
        f"{name}_simulated": (dimension, comparison.simulated, simulated),
        f"{name}_residual": (dimension, comparison.residual, residual),
        f"{name}_quality": (dimension, channel.quality, quality),
    }


def _peaks(name: str, comparison: Comparison) -> dict[str, Any]:
    peaks = comparison.peaks
    if peaks is None:
        return {}
    unit, dimension = measured_unit(comparison.measured.unit).si, f"{name}_peak"
    onset = comparison.event.onset
    return {
        f"{name}_peak_time": (dimension, peaks.time + onset, _attrs("s", "instant of the measured extreme")),
        f"{name}_peak_measured": (dimension, peaks.measured, _attrs(unit, "measured extreme")),
        f"{name}_peak_simulated": (dimension, peaks.simulated, _attrs(unit, "simulated extreme")),
        f"{name}_peak_error": (
            dimension,
            peaks.relative_error,
            _attrs("1", "relative error of the simulated extreme"),
        ),
        f"{name}_peak_delay": (dimension, peaks.delay, _attrs("s", "simulated less measured instant")),
    }


def _events(name: str, comparison: Comparison) -> dict[str, Any]:
    match = comparison.events
    if match is None:
        return {}
    parts = (
        ("matched", match.measured, "measured event that has a simulated one"),
        ("missed", match.missed, "measured event without a simulated one"),
        ("extra", match.extra, "simulated event without a measured one, on the measured clock"),
    )
    found: dict[str, Any] = {
        f"{name}_event_{part}": (f"{name}_{part}", times, _attrs("s", words)) for part, times, words in parts
    }
    delay = _attrs("s", "simulated less measured instant")
    return found | {f"{name}_event_delay": (f"{name}_matched", match.delay, delay)}


def _windows(name: str, words: str, scored: Sequence[tuple[list[Span], Floats]]) -> dict[str, Any]:
    """Return start, stop and score of windows, NaN where a comparison has fewer than another."""
    most = max(len(spans) for spans, _ in scored)
    if not most:
        return {}
    table = np.full((3, len(scored), most), np.nan)
    for row, (spans, variance) in enumerate(scored):
        for place, span in enumerate(spans):
            table[:, row, place] = (*span, variance[place])
    shape = ("comparison", name)
    return {
        f"{name}_start": (shape, table[0], _attrs("s", f"start of a {words}")),
        f"{name}_stop": (shape, table[1], _attrs("s", f"stop of a {words}")),
        f"{name}_variance": (shape, table[2], _attrs("%", f"variance accounted for in a {words}")),
    }

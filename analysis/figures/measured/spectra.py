"""Figures of spectra, amplitude or power density: of a run, of a recording, of both signals of a replay."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vibroimpact.analysis.figures.measured.recordings import MOST_PANELS, short_name, spans_of
from vibroimpact.analysis.figures.measured.replay import comparison_of
from vibroimpact.analysis.figures.motion.series import sampled_variables, samples_within
from vibroimpact.analysis.figures.page import (
    LINE,
    MARK,
    STOP,
    Floats,
    canvas,
    legend_outside,
    page_style,
    title,
)
from vibroimpact.analysis.figures.scene_text import forcing_rate, in_scene_order
from vibroimpact.analysis.figures.window import View
from vibroimpact.analysis.recording import Recording
from vibroimpact.analysis.spectral_density import spectral_density
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.fmus.units import written_unit

_PANEL_MM = 38
_FEWEST = 16
# Deviation from even spacing, over the mean interval, above which samples have no spectrum.
_UNEVEN = 0.01
# Shares of the largest amplitude: frequencies end at the last one above the first, amplitudes begin at the second.
_LAST, _FLOOR = 1e-2, 1e-5
# Largest number of points of a line; longer lines show the largest value of each span.
_MOST_POINTS = 600
_MULTIPLES = "multiples of the forcing frequency"
_MULTIPLE_LINE: dict[str, Any] = {"color": STOP, "linestyle": ":", "linewidth": 0.5, "zorder": 0}
_LEAST_MULTIPLES, _MOST_MULTIPLES = 10, 20


class _Signal(NamedTuple):
    """The signal of one line."""

    name: str
    unit: str
    time: Floats
    values: Floats
    colour: str = LINE


class _Spectrum(NamedTuple):
    """A spectrum to draw over the frequency.

    `of` returns angular frequencies (rad/s) and heights of a signal. `power` is 2 where heights are squares of
    amplitudes. `quantity` names the heights for a unit; `words` describe the method.
    """

    of: Callable[[_Signal], tuple[Floats, Floats]]
    power: int
    quantity: Callable[[str], str]
    words: list[str]


def _amplitudes(rate: float | None) -> _Spectrum:
    def of(signal: _Signal) -> tuple[Floats, Floats]:
        return amplitude_spectrum(signal.name, signal.time, signal.values, rate)

    return _Spectrum(of, 1, lambda unit: f"amplitude ({unit})", [])


def _densities(segment: int | None, is_angular: bool) -> _Spectrum:
    """Return densities; over the angular frequency if the axis shows it."""
    words: list[str] = []

    def of(signal: _Signal) -> tuple[Floats, Floats]:
        interval, values = _even_part(signal.name, signal.time, signal.values)
        found = spectral_density(values - values.mean(), 1.0 / interval, segment)
        words[:] = found.words.split(": ")
        return 2.0 * np.pi * found.frequency, found.density / (2.0 * np.pi if is_angular else 1.0)

    def quantity(unit: str) -> str:
        squared = f"({unit})" if "/" in unit or " " in unit else unit
        return "density (-)" if is_angular else f"density ({squared}²/Hz)"

    return _Spectrum(of, 2, quantity, words)


def draw_run_spectrum(dataset: xr.Dataset, view: View, *, density: bool = False) -> Figure:
    """Draw the amplitude spectra of the sampled variables of one run, with the multiples of its forcing frequency.

    A harmonic motion of amplitude A is a peak of height A. A forced motion is cut to whole periods, so that the
    multiples lie on the grid of the frequencies. The axis of a nondimensional scene is the angular frequency. A
    density uses all samples.
    """
    if not sampled_variables(dataset):
        raise DatasetError(
            "figure: expected a time series of the run, got none recorded. "
            'Set time_series = { rate = ..., variables = ["displacement"] } in [record].'
        )
    samples = samples_within(dataset, view)
    names = in_scene_order(dataset, sampled_variables(samples))[:MOST_PANELS]
    time = samples["time"].values
    signals = [
        [_Signal(title(samples[name]), str(samples[name].attrs["units"]), time, samples[name].values)]
        for name in names
    ]
    is_angular = dataset.attrs.get("units_system") == "nondimensional"
    rate = forcing_rate(dataset, samples)
    spectrum = _densities(view.segment, is_angular) if density else _amplitudes(rate)
    return _draw_panels(signals, rate, spectrum, is_run=True, is_angular=is_angular)


def draw_recording_spectrum(recording: Recording, view: View, *, density: bool = False) -> Figure:
    """Draw the spectrum of each channel of a recording, from its longest stretch without a gap."""
    channels = [channel for channel in recording.channels.values() if channel.axis.interval is not None]
    if not channels:
        raise DatasetError(
            f"{recording.title}: expected a channel of evenly spaced samples, got none. "
            "Only such samples have a spectrum."
        )
    parts = [channel.between(*view.window.part(channel.time)) for channel in channels[:MOST_PANELS]]
    spectrum = _densities(view.segment, False) if density else _amplitudes(None)
    signals = [[_Signal(part.name, part.unit, part.time, part.values)] for part in parts]
    return _draw_panels(signals, None, spectrum)


def draw_replay_spectrum(dataset: xr.Dataset, view: View, *, density: bool = False) -> Figure:
    """Draw the spectra of a measured signal and of its replay over each other."""
    name, words = comparison_of(dataset, view.recording)
    measured = dataset[f"{name}_measured"]
    time = measured[str(measured.dims[0])].values
    start, stop = view.window.part(time)
    rows = (time >= start) & (time <= stop)
    signals = [
        _Signal(
            kind, str(measured.attrs["units"]), time[rows], dataset[f"{name}_{kind}"].values[rows], colour
        )
        for kind, colour in (("measured", LINE), ("simulated", MARK))
    ]
    spectrum = _densities(view.segment, False) if density else _amplitudes(None)
    figure = _draw_panels([signals], None, spectrum)
    figure.axes[0].set_title(f"{name}, {words}" if words else name, fontsize=7.5, loc="left")
    return figure


def _draw_panels(
    panels: Sequence[Sequence[_Signal]],
    rate: float | None,
    spectrum: _Spectrum,
    *,
    is_run: bool = False,
    is_angular: bool = False,
) -> Figure:
    """Draw a panel for each group of signals; all signals of a run have the frequency range of the first one.

    The rate is the angular frequency of the forcing, rad/s.
    """
    factor = 1.0 if is_angular else 0.5 / math.pi
    with page_style():
        figure = canvas(10 + _PANEL_MM * len(panels) + (8 if spectrum.power > 1 else 0))
        axes = figure.subplots(len(panels), 1, squeeze=False, sharex=is_run)[:, 0]
        end = None
        for axis, signals in zip(axes, panels, strict=True):
            spectra = [spectrum.of(signal) for signal in signals]
            end = _end(spectra, rate, spectrum.power) if end is None or not is_run else end
            _draw_panel(axis, signals, spectra, factor, end, spectrum)
            if rate is not None:
                for multiple in range(1, min(int(end / rate), _MOST_MULTIPLES) + 1):
                    axis.axvline(factor * rate * multiple, label=_MULTIPLES, **_MULTIPLE_LINE)
        words = ["angular frequency (-)" if is_angular else "frequency (Hz)", *spectrum.words]
        axes[-1].set_xlabel("\n".join(words))
        legend_outside(figure, axes[0], ncols=3)
        figure.align_ylabels(axes)
    return figure


def _end(spectra: Sequence[tuple[Floats, Floats]], rate: float | None, power: int) -> float:
    """Return the largest angular frequency to show, rad/s."""
    end = 0.0 if rate is None else _LEAST_MULTIPLES * rate
    for frequency, height in spectra:
        high = np.flatnonzero(height > _LAST**power * height.max())
        end = max(end, 1.1 * float(frequency[high[-1]]) if high.size else 0.0)
    highest = min(float(frequency[-1]) for frequency, _ in spectra)
    return min(end, highest) or highest


def _draw_panel(
    axis: Axes,
    signals: Sequence[_Signal],
    spectra: Sequence[tuple[Floats, Floats]],
    factor: float,
    end: float,
    spectrum: _Spectrum,
) -> None:
    """Draw spectra of one unit; `factor` converts an angular frequency to the axis."""
    lowest = math.inf
    for signal, (frequency, amplitude) in zip(signals, spectra, strict=True):
        inside = frequency <= end
        # the mean was removed
        inside[0] = False
        places, heights = _upper_edge(frequency[inside], amplitude[inside])
        # amplitudes have the same range in every figure
        lowest = min(lowest, 0.3 * float(heights.min(initial=math.inf)) if spectrum.power > 1 else 0.0)
        words = signal.name if len(signals) > 1 else None
        axis.plot(factor * places, heights, color=signal.colour, linewidth=0.6, label=words, rasterized=True)
    largest = max(float(amplitude.max()) for _, amplitude in spectra)
    axis.set_xlim(0.0, factor * end)
    if largest > 0.0:
        axis.set_yscale("log")
        axis.set_ylim(max(_FLOOR**spectrum.power * largest, lowest), 3.0**spectrum.power * largest)
    axis.set_ylabel(spectrum.quantity(written_unit(signals[0].unit)))
    axis.set_title(short_name(signals[0].name), fontsize=7.5, loc="left", pad=2)


def _upper_edge(frequency: Floats, amplitude: Floats) -> tuple[Floats, Floats]:
    """Return the largest amplitude of each span of frequencies, so that no peak is lost."""
    per_span = -(-len(frequency) // _MOST_POINTS) or 1
    starts = np.arange(0, len(frequency), per_span)
    if not starts.size:
        return frequency, amplitude
    return frequency[starts], np.maximum.reduceat(amplitude, starts)


def amplitude_spectrum(
    name: str, time: Floats, values: Floats, rate: float | None = None
) -> tuple[Floats, Floats]:
    """Return the amplitude spectrum of the longest stretch without a gap, mean removed (Hann window).

    Instants (s) are evenly spaced, NaN marks missing values, and the stretch is cut to whole periods of `rate` (rad/s).
    Angular frequency (rad/s) and amplitude have shape (sample // 2 + 1,). A harmonic motion of amplitude A with a
    frequency on the grid has the height A. DatasetError, with the name: the samples are uneven, or fewer than 16 are in
    a row.

    >>> time = np.arange(1000) / 100.0
    >>> frequency, amplitude = amplitude_spectrum("x", time, 3.0 + 2.0 * np.cos(8.0 * np.pi * time))
    >>> place = int(amplitude.argmax())
    >>> round(float(frequency[place]) / (2.0 * np.pi), 6), round(float(amplitude[place]), 6)
    (4.0, 2.0)
    """
    interval, values = _even_part(name, time, values)
    count = len(values)
    if rate is not None:
        period = 2.0 * math.pi / (rate * interval)
        # everything, where it is less than a whole period
        count = round(math.floor(count / period + _UNEVEN) * period) or count
    count = min(count, len(values))
    weights = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(count) / count)
    swing = values[:count] - np.mean(values[:count])
    amplitude = np.asarray(2.0 * np.abs(np.fft.rfft(weights * swing)) / weights.sum(), dtype=np.float64)
    frequency: Floats = np.arange(len(amplitude), dtype=np.float64) * (2.0 * np.pi / (count * interval))
    return frequency, amplitude


def _even_part(name: str, time: Floats, values: Floats) -> tuple[float, Floats]:
    """Return the sampling interval (s) and the values of the longest stretch without a gap."""
    first, stop = max(spans_of(np.isfinite(values)), key=np.ptp, default=(0, 0))
    time, values = time[first:stop], values[first:stop]
    if len(time) < _FEWEST:
        raise DatasetError(
            f"figure: {name}: expected {_FEWEST} samples without a gap for a spectrum, got {len(time)}."
        )
    interval = float(time[-1] - time[0]) / (len(time) - 1)
    if np.abs(np.diff(time) - interval).max() > _UNEVEN * interval:
        raise DatasetError(f"figure: {name}: expected evenly spaced samples for a spectrum, got uneven ones.")
    return interval, values

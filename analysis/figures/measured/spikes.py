"""Figure of the spikes of a channel: the signal, its detection statistic, and the largest spike close up."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vibroimpact.analysis.figures.families import Drawing, Family, register, whole
from vibroimpact.analysis.figures.measured.recordings import outline
from vibroimpact.analysis.figures.page import COLOURS, LINE, MARK, STOP, canvas, legend_above, page_style
from vibroimpact.analysis.spikes.report import SpikeReport
from vibroimpact.analysis.spikes.waveforms import WAVEFORMS

_PANEL_MM = 42
_UNITS = {"m s-2": "m/s²", "1": "-"}
#: Number of points above which a line is drawn as the band between its extremes.
_MOST_POINTS = 20_000
#: Number of spikes above which their marks are small.
_MOST_LARGE_MARKS = 40
#: Range of the close-up, in lengths of the pulse, before and after its middle.
_BEFORE, _AFTER = 1.0, 3.0
_DASHES = {"half_sine": "-", "haversine": "--", "bell": ":"}


def draw_spikes(report: SpikeReport) -> Figure:
    """Draw signal and baseline, statistic and threshold, and the largest spike with its fitted curves."""
    with page_style():
        panels = [_draw_signal, _draw_statistic]
        if report.dataset.sizes["spike"]:
            panels.append(_draw_close_up)
        figure = canvas(_PANEL_MM * len(panels))
        for axis, draw in zip(figure.subplots(len(panels), 1), panels, strict=True):
            draw(axis, report)
    return figure


def _unit(report: SpikeReport) -> str:
    return _UNITS.get(report.found.unit, report.found.unit)


def _draw_signal(axis: Axes, report: SpikeReport) -> None:
    found = report.found
    _line(axis, found.time, found.signal, color=LINE, label="signal")
    words = "drift and cycle" if found.method != "threshold" else "baseline"
    _line(axis, found.time, found.baseline, color=MARK, label=words, linewidth=0.5)
    height = axis.get_xaxis_transform()
    times = report.dataset["spike_time"].values
    size = 3.0 if len(times) <= _MOST_LARGE_MARKS else 1.0
    axis.plot(times, np.full(len(times), 0.97), "v", color=STOP, markersize=size, transform=height)
    axis.set_ylabel(f"{report.dataset.attrs['channel']} ({_unit(report)})")
    axis.set_xlim(float(found.time[0]), float(found.time[-1]))
    legend_above(axis, ncols=2)


def _draw_statistic(axis: Axes, report: SpikeReport) -> None:
    """Draw magnitudes over the threshold, on a logarithmic axis so that noise and spikes both show."""
    found = report.found
    scores = found.method == "cycle_median"
    magnitude = np.abs(found.statistic)
    _line(axis, found.time, np.maximum(magnitude, 0.01 * found.threshold), color=LINE)
    axis.axhline(found.threshold, color=MARK, label="threshold")
    axis.axhline(found.lower_threshold, color=MARK, linestyle=":", label="spike ends below")
    axis.set(yscale="log", xlabel="time (s)", xlim=(float(found.time[0]), float(found.time[-1])))
    axis.set_ylabel("robust score (-)" if scores else f"from baseline ({_unit(report)})")
    legend_above(axis, ncols=2)


def _draw_close_up(axis: Axes, report: SpikeReport) -> None:
    """Draw the largest complete spike: its samples, and the curves fitted to it."""
    data, found = report.dataset, report.found
    axis.set_ylabel(f"from baseline ({_unit(report)})")
    spike = data.isel(spike=int(np.argmax(np.abs(data["spike_peak"].values))))
    middle, length = float(spike["spike_peak_time"]), float(spike["spike_length"])
    first, stop = np.searchsorted(found.time, [middle - _BEFORE * length, middle + _AFTER * length])
    scale, unit = (1e3, "ms") if length < 0.5 else (1.0, "s")
    time = scale * (found.time[first:stop] - middle)
    axis.plot(
        time, found.residual[first:stop], ".-", color=LINE, markersize=2, linewidth=0.4, label="samples"
    )
    fine = np.linspace(middle - _BEFORE * length, middle + _BEFORE * length, 400)
    for place, (name, waveform) in enumerate(WAVEFORMS.items()):
        fit = spike.sel(waveform=name)
        if not np.isfinite(float(fit["spike_fit_peak"])):
            continue
        curve = float(fit["spike_fit_peak"]) * waveform.value(
            (fine - float(fit["spike_fit_middle"])) / float(fit["spike_fit_length"])
        )
        mark = " (chosen)" if name == data.attrs["waveform"] else ""
        axis.plot(
            scale * (fine - middle),
            curve,
            color=COLOURS[place + 1],
            linestyle=_DASHES[name],
            label=name.replace("_", "-") + mark,
        )
    if found.method != "cycle_median":
        sign = np.sign(float(spike["spike_peak"]))
        axis.axhline(sign * found.threshold, color=STOP, linewidth=0.4)
    axis.set_xlabel(f"time from the peak at {middle:.5g} s ({unit})")
    axis.margins(x=0.0)
    legend_above(axis, ncols=2)


def _line(axis: Axes, time: np.ndarray, values: np.ndarray, **style: Any) -> None:
    """Draw a line; a long line is drawn by its extremes."""
    if len(time) > _MOST_POINTS:
        time, values = outline(time, values, -(-4 * len(time) // _MOST_POINTS))
    axis.plot(time, values, rasterized=True, **style)


register(
    Family(
        "spike report",
        "the spikes of a signal",
        {"recording": Drawing(whole(draw_spikes))},
        type=SpikeReport,
        is_of_results=False,
    )
)

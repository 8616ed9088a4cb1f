"""The command `vibroimpact spikes`: find spikes, and analyse the intervals between them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset.outputs import refuse_places, writing
from vibroimpact.analysis.dataset.results import write_results
from vibroimpact.analysis.intervals import interval_report, print_intervals, seams
from vibroimpact.analysis.operations.spikes import Spikes
from vibroimpact.analysis.recording import EventTrain, Recording, open_signals
from vibroimpact.analysis.recording.channels import Floats
from vibroimpact.analysis.recording.rules import masked_spans
from vibroimpact.analysis.spikes import Mechanics, SpikeReport, SpikeSettings, spike_report
from vibroimpact.analysis.spikes.printing import print_spikes
from vibroimpact.analysis.spikes.report import unobserved
from vibroimpact.fmus.errors import EstimationError, UsageError
from vibroimpact.fmus.messages import Spelling, joined, spelled, typed
from vibroimpact.fmus.terminal import Terminal, wide_terminal

#: Number of spikes below which no statistics of intervals are computed.
_FEWEST_FOR_INTERVALS = 3


def find_spikes(options: Spikes, spelling: Spelling = typed) -> None:
    """Find the spikes of a channel, or analyse the intervals of an event train; print, write and draw the results."""
    data, output, figure = options.data, options.output, options.figure
    settings, mechanics = _settings(options), _mechanics(options)
    refuse_places(options, [data], results_kind="spikes", source=data.name)
    recording = open_signals(data, options.run)
    console = wide_terminal(spelling)
    for remark in recording.remarks_counted:
        console.print(remark, style="yellow")
    report = None
    try:
        if options.events is not None or not recording.channels:
            train = recording.event_train(options.events)
            dataset = _trains(console, train, options, masked_spans(train))
        else:
            report, dataset = _spikes(console, recording, options, settings, mechanics)
    except EstimationError as problem:
        raise problem.named(data) from problem
    dataset = dataset.assign_attrs(spelled(dataset.attrs, spelling), source=data.name)
    if output is not None:
        with writing(output):
            write_results(dataset, output)
        console.print(f"Dataset written to {output}.")
    if figure is not None:
        with writing(figure):
            _draw(report, dataset, figure)
        console.print(f"Figure written to {figure}.")


def _settings(options: Spikes) -> SpikeSettings:
    threshold = options.threshold
    part = threshold is not None and threshold.strip().endswith("%")
    return SpikeSettings(
        method=options.method,
        threshold=None if threshold is None or part else number(threshold, "--threshold"),
        threshold_part=number(threshold.strip()[:-1], "--threshold") / 100.0 if threshold and part else None,
        hysteresis=options.hysteresis,
        minimum_samples=options.minimum_samples,
        merge=options.merge,
        polarity=options.polarity,
        noise=options.noise,
        false_alarms=options.false_alarms,
        baseline_window=options.baseline,
        rms_window=options.rms_window,
        period=options.period,
    )


def _mechanics(options: Spikes) -> Mechanics:
    impulses = numbers(options.known_impulses)
    return Mechanics(
        options.mass, options.restitution, options.sensitivity, impulses, waveform=options.waveform
    )


def number(text: str, option: str) -> float:
    """Return the number of an option that was given as text; other text raises UsageError."""
    try:
        return float(text)
    except ValueError as problem:
        raise UsageError(f"{option}: expected a number, got {text!r}.") from problem


def numbers(text: str | None) -> Floats | None:
    """Return numbers separated by commas as an array; None stays None."""
    if text is None:
        return None
    return np.array([number(part, "--known-impulses") for part in text.split(",")])


def _spikes(
    console: Terminal,
    recording: Recording,
    options: Spikes,
    settings: SpikeSettings,
    mechanics: Mechanics,
) -> tuple[SpikeReport, xr.Dataset]:
    """Find and print the spikes of a channel, and their intervals where there are enough."""
    report = spike_report(recording.channel(options.channel), settings, mechanics)
    print_spikes(console, report)
    dataset = report.dataset
    if dataset.sizes["spike"] < _FEWEST_FOR_INTERVALS:
        return report, dataset
    # the observed time begins with the first spike: before it, another spike may have been cut off
    train = EventTrain("spikes", dataset["spike_time"].values)
    more = _trains(console, train, options, unobserved(report))
    remarks = joined("\n", (each.attrs["remarks"] for each in (dataset, more) if each.attrs.get("remarks")))
    merged = xr.merge([dataset, more], combine_attrs="drop_conflicts", join="outer", compat="override")
    return report, merged.assign_attrs(remarks=remarks)


def _trains(
    console: Terminal,
    train: EventTrain,
    options: Spikes,
    masked: tuple[tuple[float, float], ...] = (),
) -> xr.Dataset:
    """Print and return the statistics of the intervals of a train."""
    if options.seams is not None and len(train.times):
        masked += seams(options.seams, train.window or (float(train.times[0]), float(train.times[-1])))
    dataset = interval_report(
        train.times,
        window=train.window,
        masked=masked,
        forcing_period=options.forcing_period,
        resolution=train.resolution,
        count_bin=options.count_bin,
        embedding=options.embedding,
        theiler=options.theiler,
    )
    print_intervals(console, dataset)
    return dataset


def _draw(report: SpikeReport | None, dataset: xr.Dataset, path: Path) -> None:
    """Write the figure of the spikes, or of the intervals where there are only intervals."""
    # matplotlib takes half a second to import; spikes alone do not pay for it.
    from vibroimpact.analysis import figures
    from vibroimpact.analysis.figures.measured.intervals import draw_intervals
    from vibroimpact.analysis.figures.measured.spikes import draw_spikes

    figures.save(draw_intervals(dataset) if report is None else draw_spikes(report), path)

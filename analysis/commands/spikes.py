"""The command `spikes`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vibroimpact.analysis.dataset.outputs import FORCE_HELP, refuse_outputs, refuse_overwriting, writing
from vibroimpact.fmus.errors import EstimationError, UsageError
from vibroimpact.fmus.terminal import Terminal

if TYPE_CHECKING:
    import xarray as xr

    from vibroimpact.analysis.recording import EventTrain, Recording
    from vibroimpact.analysis.recording.channels import Floats
    from vibroimpact.analysis.spikes import Mechanics, SpikeReport, SpikeSettings

#: Fewer spikes have no statistics of intervals.
_FEWEST_FOR_INTERVALS = 3

#: Of the correlation dimension: `intervals.dimension` has the same, and takes long to load.
_EMBEDDING, _THEILER = 6, 1


@dataclass(frozen=True, slots=True)
class _IntervalOptions:
    """What the command line says of the intervals between spikes; see `interval_report`."""

    forcing_period: float | None
    count_bin: float | None
    seams: float | None
    embedding: int
    theiler: int


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("spikes")(spikes)


def spikes(
    data: Annotated[Path, typer.Argument(help="Recording, or dataset of a run (.nc).")],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Dataset to write (.nc).")] = None,
    figure: Annotated[Path | None, typer.Option(help="Figure to write: .png, .pdf or .svg.")] = None,
    channel: Annotated[str | None, typer.Option(help="Channel to look for spikes in.")] = None,
    events: Annotated[str | None, typer.Option(help="Event train: only its intervals are looked at.")] = None,
    run: Annotated[int | None, typer.Option(help="run_index, in a dataset of several runs.", min=0)] = None,
    method: Annotated[
        str, typer.Option(help="auto, threshold, cycle_median (smooth shocks) or cycle_threshold.")
    ] = "auto",
    threshold: Annotated[
        str | None,
        typer.Option(help="SI unit of the channel, or 5% of the largest value; else from the noise."),
    ] = None,
    hysteresis: Annotated[float, typer.Option(help="A spike ends below this part of the threshold.")] = 0.5,
    minimum_samples: Annotated[int, typer.Option(help="Fewer samples above the threshold are no spike.")] = 4,
    merge: Annotated[
        float | None, typer.Option(help="Excursions closer than this (s) are one spike with its ringing.")
    ] = None,
    polarity: Annotated[str, typer.Option(help="both, positive or negative.")] = "both",
    noise: Annotated[
        float | None, typer.Option(help="Standard deviation of normal noise, SI unit; else from the data.")
    ] = None,
    false_alarms: Annotated[float, typer.Option(help="Noise peaks above the threshold to expect.")] = 0.01,
    baseline: Annotated[
        float | None, typer.Option(help="Window of the baseline, s; else from the data.")
    ] = None,
    rms_window: Annotated[
        float | None, typer.Option(help="Window for smooth shocks, s; else a tenth of a cycle.")
    ] = None,
    period: Annotated[
        float | None, typer.Option(help="Period of the excitation, s; else from the data.")
    ] = None,
    mass: Annotated[float | None, typer.Option(help="Effective mass of the contact, kg.")] = None,
    restitution: Annotated[float | None, typer.Option(help="Coefficient of restitution, 0 to 1.")] = None,
    sensitivity: Annotated[float | None, typer.Option(help="Of the load cell, V/N.")] = None,
    known_impulses: Annotated[
        str | None, typer.Option(help="Impulses of the spikes, N s, with commas: the sensitivity is fitted.")
    ] = None,
    waveform: Annotated[str, typer.Option(help="auto, half_sine, haversine or bell.")] = "auto",
    forcing_period: Annotated[float | None, typer.Option(help="By which intervals are folded, s.")] = None,
    count_bin: Annotated[float | None, typer.Option(help="Bin of the Fano factor, s.")] = None,
    seams: Annotated[float | None, typer.Option(help="Mask the intervals over multiples of this, s.")] = None,
    embedding: Annotated[
        int, typer.Option(help="Largest embedding of the correlation dimension.", min=2)
    ] = _EMBEDDING,
    theiler: Annotated[
        int, typer.Option(help="Theiler window: vectors no further apart than this are no pair.", min=0)
    ] = _THEILER,
    force: Annotated[bool, typer.Option("--force", help=FORCE_HELP)] = False,
) -> None:
    """Find impacts and shocks in a signal: instants, peaks, impulses, contact times, intervals.

    Example: vibroimpact spikes smd05.nc --channel base -o spikes.nc --figure spikes.png
    """
    from vibroimpact.analysis.dataset.results import write_results
    from vibroimpact.analysis.recording import open_signals
    from vibroimpact.analysis.recording.rules import masked_spans
    from vibroimpact.analysis.spikes import Mechanics, SpikeSettings

    refuse_outputs([data], output, figure)
    same = ("spikes", data.name)
    refuse_overwriting(output, force, lambda there: (there.get("results_kind"), there.get("source")) == same)
    part = threshold is not None and threshold.strip().endswith("%")
    settings = SpikeSettings(
        method=method,
        threshold=None if threshold is None or part else _number(threshold, "--threshold"),
        threshold_part=_number(threshold.strip()[:-1], "--threshold") / 100.0 if threshold and part else None,
        hysteresis=hysteresis,
        minimum_samples=minimum_samples,
        merge=merge,
        polarity=polarity,
        noise=noise,
        false_alarms=false_alarms,
        baseline_window=baseline,
        rms_window=rms_window,
        period=period,
    )
    intervals = _IntervalOptions(forcing_period, count_bin, seams, embedding, theiler)
    mechanics = Mechanics(mass, restitution, sensitivity, _numbers(known_impulses), waveform=waveform)
    recording = open_signals(data, run)
    console = Terminal()
    for remark in recording.remarks_counted:
        console.print(remark, style="yellow")
    report = None
    try:
        if events is not None or not recording.channels:
            train = recording.event_train(events)
            dataset = _trains(console, train, intervals, masked_spans(train))
        else:
            report, dataset = _spikes(console, recording, channel, settings, mechanics, intervals)
    except EstimationError as problem:
        raise EstimationError(f"{data}: {problem}") from problem
    dataset = dataset.assign_attrs(source=data.name)
    if output is not None:
        with writing(output):
            write_results(dataset, output, kind="spikes")
        console.print(f"Dataset written to {output}.")
    if figure is not None:
        with writing(figure):
            _draw(report, dataset, figure)
        console.print(f"Figure written to {figure}.")


def _number(text: str, option: str) -> float:
    try:
        return float(text)
    except ValueError as problem:
        raise UsageError(f"{option}: expected a number, got {text!r}.") from problem


def _numbers(text: str | None) -> Floats | None:
    """Return numbers separated by commas as an array; None stays None."""
    import numpy as np

    if text is None:
        return None
    return np.array([_number(part, "--known-impulses") for part in text.split(",")])


def _spikes(
    console: Terminal,
    recording: Recording,
    channel: str | None,
    settings: SpikeSettings,
    mechanics: Mechanics,
    intervals: _IntervalOptions,
) -> tuple[SpikeReport, xr.Dataset]:
    """Find and print the spikes of a channel, and their intervals where there are enough."""
    import xarray as xr

    from vibroimpact.analysis.recording import EventTrain
    from vibroimpact.analysis.spikes import spike_report
    from vibroimpact.analysis.spikes.printing import print_spikes
    from vibroimpact.analysis.spikes.report import unobserved

    report = spike_report(recording.channel(channel), settings, mechanics)
    print_spikes(console, report)
    dataset = report.dataset
    if dataset.sizes["spike"] < _FEWEST_FOR_INTERVALS:
        return report, dataset
    # what was observed begins with the first spike: before it, one may have been cut off
    train = EventTrain("spikes", dataset["spike_time"].values)
    more = _trains(console, train, intervals, unobserved(report))
    remarks = "\n".join(each.attrs["remarks"] for each in (dataset, more) if each.attrs.get("remarks"))
    merged = xr.merge([dataset, more], combine_attrs="drop_conflicts", join="outer", compat="override")
    return report, merged.assign_attrs(remarks=remarks)


def _trains(
    console: Terminal,
    train: EventTrain,
    options: _IntervalOptions,
    masked: tuple[tuple[float, float], ...] = (),
) -> xr.Dataset:
    """Print and return what the intervals of a train tell."""
    from vibroimpact.analysis.intervals import interval_report, print_intervals, seams

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
    """Write the figure of the spikes, or that of the intervals where there are only these."""
    from vibroimpact.analysis import figures

    if report is None:
        from vibroimpact.analysis.figures.intervals import draw_intervals

        figures.save(draw_intervals(dataset), path)
        return
    from vibroimpact.analysis.figures.spikes import draw_spikes

    figures.save(draw_spikes(report), path)

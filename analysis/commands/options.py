"""The commands of this package and their options.

What a command does is imported when it is called: `--help` loads nothing heavy.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from vibroimpact.analysis.commands.estimate_options import WindowEnd, WindowStart, estimate
from vibroimpact.analysis.commands.shared_options import DatasetFile, FigureFile, Force
from vibroimpact.fmus.commands import commands as fmu_commands

AnyFile = Annotated[
    Path, typer.Argument(help="Dataset, recording or results (.nc), or the folder of a campaign.")
]
#: Of the correlation dimension: `intervals.dimension` has the same, and takes long to load.
EMBEDDING, THEILER = 6, 1
#: Of the intervals of Sobol indices: `sensitivity.report` has the same, and takes long to load.
LEVEL, RESAMPLES = 0.95, 1000
_KINDS_HELP = (
    "auto; of a sweep bifurcation, branches, classes, map, impacts-per-period, impact-frequency, strobe, shapes, "
    "scores; of a run run, portrait, strobe, impact-map, return-map, spectrum, density, energies; of a recording or "
    "replay spectrum and density too; of a benchmark convergence, work-precision."
)


def register(app: typer.Typer) -> None:
    """Add the commands of this package to the command line; only here recordings can be read for `fmu replay`."""
    app.command("plot")(plot)
    app.add_typer(estimate, name="estimate")
    app.command("spikes")(spikes)
    app.command("describe")(describe)
    app.command("sensitivity")(sensitivity)
    app.command("classify")(classify)
    fmu_commands.command("replay")(replay_fmu)


def plot(
    file: AnyFile,
    output: Annotated[Path, typer.Option("--output", "-o", help="Figure to write: .png, .pdf or .svg.")],
    kind: Annotated[str, typer.Option(help=_KINDS_HELP)] = "auto",
    run: Annotated[
        int | None, typer.Option(help="run_index of the run to draw; alone it implies --kind run.", min=0)
    ] = None,
    recording: Annotated[
        str | None,
        typer.Option(help="Recording of a replay, fitted or not: a1.nc, or the name of a comparison."),
    ] = None,
    start: WindowStart = None,
    stop: WindowEnd = None,
    periods: Annotated[
        float | None,
        typer.Option(help="Length of the window in forcing periods, after --from or before --to."),
    ] = None,
    over: Annotated[
        Path | None,
        typer.Option(help="Another sweep, drawn below: the simulated one of a measured one.", metavar="FILE"),
    ] = None,
    segment: Annotated[
        int | None, typer.Option(help="Of a density: samples of a segment, a power of two; else 1024.")
    ] = None,
    variable: Annotated[
        str | None,
        typer.Option(
            help="Of a bifurcation diagram or branches: what is drawn, such as displacement_max, strobe_displacement, "
            "impact_phase.",
            metavar="NAME",
        ),
    ] = None,
    title: Annotated[str | None, typer.Option(help='Title above the figure; "" for none.')] = None,
    width: Annotated[float | None, typer.Option(help="Width of the figure, mm; else one column, 85.")] = None,
    height: Annotated[float | None, typer.Option(help="Height of the figure, mm.")] = None,
) -> None:
    """Draw a dataset: a bifurcation diagram, maps over two parameters, one run, a recording, a replay, estimates.

    Example: vibroimpact plot campaign/dataset.nc -o bifurcation.png

    A measured sweep over the simulated one: vibroimpact plot sweep --over campaign -o both.png
    """
    from vibroimpact.analysis.commands.plot import draw_file

    options: dict[str, Any] = {"recording": recording, "start": start, "stop": stop, "periods": periods}
    options |= {"segment": segment, "variable": variable, "title": title, "width": width, "height": height}
    draw_file(file, output, kind, run, options, over)


def spikes(
    data: Annotated[Path, typer.Argument(help="Recording, or dataset of a run (.nc).")],
    output: DatasetFile = None,
    figure: FigureFile = None,
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
    sensitivity: Annotated[
        float | None, typer.Option(help="Of the load cell, V/N; else that of a simulated one.")
    ] = None,
    known_impulses: Annotated[
        str | None, typer.Option(help="Impulses of the spikes, N s, with commas: the sensitivity is fitted.")
    ] = None,
    waveform: Annotated[str, typer.Option(help="auto, half_sine, haversine or bell.")] = "auto",
    forcing_period: Annotated[float | None, typer.Option(help="By which intervals are folded, s.")] = None,
    count_bin: Annotated[float | None, typer.Option(help="Bin of the Fano factor, s.")] = None,
    seams: Annotated[float | None, typer.Option(help="Mask the intervals over multiples of this, s.")] = None,
    embedding: Annotated[
        int, typer.Option(help="Largest embedding of the correlation dimension.", min=2)
    ] = EMBEDDING,
    theiler: Annotated[
        int, typer.Option(help="Theiler window: vectors no further apart than this are no pair.", min=0)
    ] = THEILER,
    force: Force = False,
) -> None:
    """Find impacts and shocks in a signal: instants, peaks, impulses, contact times, intervals.

    Example: vibroimpact spikes smd05.nc --channel base -o spikes.nc --figure spikes.png
    """
    from vibroimpact.analysis.commands.spikes import IntervalOptions, find_spikes, number, numbers
    from vibroimpact.analysis.spikes import Mechanics, SpikeSettings

    part = threshold is not None and threshold.strip().endswith("%")
    settings = SpikeSettings(
        method=method,
        threshold=None if threshold is None or part else number(threshold, "--threshold"),
        threshold_part=number(threshold.strip()[:-1], "--threshold") / 100.0 if threshold and part else None,
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
    intervals = IntervalOptions(forcing_period, count_bin, seams, embedding, theiler)
    mechanics = Mechanics(mass, restitution, sensitivity, numbers(known_impulses), waveform=waveform)
    find_spikes(data, output, figure, channel, events, run, settings, mechanics, intervals, force)


def describe(file: AnyFile) -> None:
    """Say what a file holds: what made it, its dimensions, each variable with its meaning, unit and values.

    Example: vibroimpact describe run.nc
    """
    from vibroimpact.analysis.commands.describe import describe_file

    describe_file(file)


def sensitivity(
    file: Annotated[Path, typer.Argument(help="Dataset of a campaign with drawn keys (.nc), or its folder.")],
    output: DatasetFile = None,
    figure: FigureFile = None,
    of: Annotated[
        list[str] | None,
        typer.Option(
            help="Quantity to look at, displacement_range or another; again for more; default: all."
        ),
    ] = None,
    level: Annotated[float, typer.Option(help="Of the bootstrap intervals, 0 to 1.")] = LEVEL,
    resamples: Annotated[int, typer.Option(help="Of the bootstrap.")] = RESAMPLES,
    seed: Annotated[int, typer.Option(help="Of the bootstrap.")] = 0,
    force: Force = False,
) -> None:
    """Say how much of the variance of each result each drawn key of a campaign accounts for (Sobol indices).

    First order: by the key alone; total: with all that it takes part in; each with a bootstrap interval. The sweep of
    the scene has two keys or more with a distribution, and sample = { design = "saltelli", points = 256 }.

    Example: vibroimpact sensitivity campaign -o sensitivity.nc --figure sensitivity.png
    """
    from vibroimpact.analysis.commands.sensitivity import show_sensitivity

    show_sensitivity(file, output, figure, of or (), level, resamples, seed, force)


def classify(
    file: Annotated[Path, typer.Argument(help="Dataset of runs (.nc), or the folder of a campaign.")],
    output: DatasetFile = None,
    figure: FigureFile = None,
    force: Force = False,
) -> None:
    """Say what each run of a dataset is: P(p,q), chaos, rest, sticking, no impacts, or unknown and why.

    From the strobe and the extrema of each recorded period. A slow transient is told from a doubled period by its
    distances, which shrink by a constant factor; 40 recorded periods tell chaos.

    Example: vibroimpact classify campaign -o classes.nc --figure classes.png
    """
    from vibroimpact.analysis.commands.classify import show_classes

    show_classes(file, output, figure, force)


def replay_fmu(
    recording: Annotated[Path, typer.Argument(help="Recording (.nc), or a dataset with time series.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="FMU to write.")],
    channel: Annotated[
        list[str] | None, typer.Option(help="Channel to play; again for more; default: all.")
    ] = None,
    si: Annotated[
        bool, typer.Option("--si", help="Play values in SI units: g becomes m/s2, mV becomes V.")
    ] = False,
    run: Annotated[int | None, typer.Option(help="run_index, of a dataset of several runs.", min=0)] = None,
    fmi: Annotated[str, typer.Option(help="FMI version, 3.0 or 2.0.")] = "3.0",
    platform: Annotated[
        str | None, typer.Option(help="Machines it is for: all, or names, as for `fmu export`.")
    ] = None,
) -> None:
    """Make an FMU that plays recorded channels in this or another tool: value, slope, validity. Needs no compiler.

    Example: vibroimpact fmu replay a0.nc --channel base --si -o a0.fmu

    For a tool of FMI 2.0 on Windows: vibroimpact fmu replay a0.nc --fmi 2.0 --platform x86_64-windows -o a0.fmu
    """
    from vibroimpact.analysis.commands.replay_fmu import build_player

    build_player(recording, output, channel or (), si, run, fmi, platform)

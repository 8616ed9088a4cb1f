"""Operation `spikes`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from vibroimpact.fmus.operations import (
    DatasetFile,
    FigureFile,
    Force,
    Operation,
    Option,
    Positional,
    Request,
    operation,
)

#: Embedding and Theiler window of the correlation dimension, as in `intervals.dimension`, which loads slowly.
EMBEDDING, THEILER = 6, 1


@operation("analysis.commands.spikes:find_spikes")
class Spikes(Operation):
    """Find impacts and shocks in a signal: instants, peaks, impulses, contact times, intervals.

    Example: vibroimpact spikes smd05.nc --channel base -o spikes.nc --figure spikes.png
    """

    data: Annotated[Path, Positional(help="Recording, or dataset of a run (.nc).")]
    output: DatasetFile = None
    figure: FigureFile = None
    channel: Annotated[str | None, Option(request=Request(), help="Channel to look for spikes in.")] = None
    events: Annotated[
        str | None, Option(request=Request(), help="Event train: only its intervals are looked at.")
    ] = None
    run: Annotated[
        int | None,
        Option(request=Request(least=0, most=2**31), help="run_index, in a dataset of several runs.", min=0),
    ] = None
    method: Annotated[
        str, Option(help="auto, threshold, cycle_median (smooth shocks) or cycle_threshold.")
    ] = "auto"
    threshold: Annotated[
        str | None,
        Option(help="SI unit of the channel, or 5% of the largest value; else from the noise."),
    ] = None
    hysteresis: Annotated[float, Option(help="A spike ends below this part of the threshold.")] = 0.5
    minimum_samples: Annotated[int, Option(help="Fewer samples above the threshold are no spike.")] = 4
    merge: Annotated[
        float | None, Option(help="Excursions closer than this (s) are one spike with its ringing.")
    ] = None
    polarity: Annotated[str, Option(help="both, positive or negative.")] = "both"
    noise: Annotated[
        float | None, Option(help="Standard deviation of normal noise, SI unit; else from the data.")
    ] = None
    false_alarms: Annotated[float, Option(help="Noise peaks above the threshold to expect.")] = 0.01
    baseline: Annotated[float | None, Option(help="Window of the baseline, s; else from the data.")] = None
    rms_window: Annotated[
        float | None, Option(help="Window for smooth shocks, s; else a tenth of a cycle.")
    ] = None
    period: Annotated[float | None, Option(help="Period of the excitation, s; else from the data.")] = None
    mass: Annotated[float | None, Option(help="Effective mass of the contact, kg.")] = None
    restitution: Annotated[float | None, Option(help="Coefficient of restitution, 0 to 1.")] = None
    sensitivity: Annotated[
        float | None, Option(help="Of the load cell, V/N; else that of a simulated one.")
    ] = None
    known_impulses: Annotated[
        str | None, Option(help="Impulses of the spikes, N s, with commas: the sensitivity is fitted.")
    ] = None
    waveform: Annotated[str, Option(help="auto, half_sine, haversine or bell.")] = "auto"
    forcing_period: Annotated[
        float | None, Option(request=Request(above=0), help="By which intervals are folded, s.")
    ] = None
    count_bin: Annotated[float | None, Option(help="Bin of the Fano factor, s.")] = None
    seams: Annotated[float | None, Option(help="Mask the intervals over multiples of this, s.")] = None
    embedding: Annotated[int, Option(help="Largest embedding of the correlation dimension.", min=2)] = (
        EMBEDDING
    )
    theiler: Annotated[
        int, Option(help="Theiler window: vectors no further apart than this are no pair.", min=0)
    ] = THEILER
    force: Force = False

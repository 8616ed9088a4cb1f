"""Figures of the modes of a body: their shapes along a beam, their energies over time."""

from __future__ import annotations

import re

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from vibroimpact.analysis.figures.motion.series import first_after_impacts, samples_within, with_gaps
from vibroimpact.analysis.figures.page import COLOURS, LINE, STOP, canvas, label, legend_outside, unit_symbol
from vibroimpact.analysis.figures.window import View
from vibroimpact.fmus.errors import DatasetError

_MODAL = re.compile(r"modal_energy_([0-9]+)")
_START = re.compile(r"displacement_start_([0-9]+)")


def draw_energies(dataset: xr.Dataset, view: View) -> Figure:
    """Draw the total energy of a run and the energies of its modes over time, with its impacts."""
    samples = samples_within(dataset, view)
    modal = [(int(m[1]), m[0]) for m in map(_MODAL.fullmatch, map(str, samples.data_vars)) if m]
    if not modal or not {"energy_kinetic", "energy_potential"} <= set(map(str, samples.data_vars)):
        raise DatasetError(
            "figure: expected kinetic, potential and modal energies in the time series, got not all of them. "
            'Set variables = ["energy.kinetic", "energy.potential", "modal_energy[1]", ...] in time_series.'
        )
    jumps = first_after_impacts(dataset, view.run, samples["time"].values)
    time = with_gaps(samples["time"].values, jumps)
    figure = canvas(95)
    above, below = figure.subplots(2, 1, sharex=True)
    total = samples["energy_kinetic"].values + samples["energy_potential"].values
    above.plot(time, with_gaps(total, jumps), color=LINE, rasterized=True)
    for place, name in sorted(modal):
        colour = COLOURS[(place - 1) % len(COLOURS)]
        below.plot(time, with_gaps(samples[name].values, jumps), color=colour, label=f"mode {place}")
    unit = unit_symbol(samples["energy_kinetic"])
    above.set_ylabel(f"total energy ({unit})")
    below.set_ylabel(f"energy of a mode ({unit})")
    below.set_xlabel(label(samples["time"]))
    for axis in (above, below):
        axis.set_ylim(bottom=0.0)
        axis.margins(x=0.0)
        for instant in samples["time"].values[jumps]:
            axis.axvline(instant, color=STOP, linewidth=0.4, zorder=0)
    legend_outside(figure, below, ncols=4)
    return figure


def draw_shapes(dataset: xr.Dataset) -> Figure:
    """Draw the shapes of the modes in which a beam was released, over its length.

    The dataset is a sweep of `sensor.location` and `body.displacement_start[j]`. Runs that start in a single mode are
    drawn, each shape divided by its largest value.
    """
    runs = dataset.vibroimpact.runs
    starts = sorted((int(m[1]), m[0]) for m in map(_START.fullmatch, map(str, runs.variables)) if m)
    if not starts or "location" not in runs or "displacement" not in dataset:
        raise DatasetError(
            "figure: expected a sweep of sensor.location and body.displacement_start[j], with displacement in the "
            "time series, got another dataset. See examples/thesis/figure_7_2.toml."
        )
    # the first sample of each run
    first = np.searchsorted(dataset["sample_run"].values, runs["run_id"].values)
    displacement = dataset["displacement"].values[first]
    moved = np.stack([runs[name].values != 0 for _, name in starts], axis=1)
    figure = canvas(70)
    axis = figure.subplots()
    for place, (number, _) in enumerate(starts):
        alone = moved[:, place] & (moved.sum(axis=1) == 1)
        order = np.argsort(runs["location"].values[alone])
        along, shape = runs["location"].values[alone][order], displacement[alone][order]
        axis.plot(
            along, shape / np.abs(shape).max(), color=COLOURS[place % len(COLOURS)], label=f"mode {number}"
        )
    axis.axhline(0.0, color=STOP, linewidth=0.4, zorder=0)
    axis.set(
        xlim=(0.0, 1.0), xlabel="location (fraction of the length)", ylabel="mode shape / its largest (-)"
    )
    legend_outside(figure, axis, ncols=3)
    return figure

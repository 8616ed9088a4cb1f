"""Figure of the impact frequency of a body along a sweep, with a shifted natural frequency: thesis figure 2.7."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from vibroimpact.analysis.dataset.schema import scene_of
from vibroimpact.analysis.figures.page import COLOURS, STOP, Floats, canvas, label, legend_outside
from vibroimpact.analysis.figures.scene_text import table
from vibroimpact.analysis.figures.sweep.diagrams import varied, wrong_sweep
from vibroimpact.analysis.orbits.resonances import frequency_shift
from vibroimpact.fmus.errors import DatasetError

_FEWEST = 2


def draw_impact_frequency(dataset: xr.Dataset) -> Figure:
    """Draw the mean angular frequency of the impacts of each run over the swept key.

    The curve of thesis (2.35) is drawn too if an undamped mass is released at rest, without a force. The curve is exact
    for an elastic stop.
    """
    swept = varied(dataset)
    if len(swept) != 1 or "impact_time" not in dataset:
        raise DatasetError(wrong_sweep("one swept parameter and impacts", dataset))
    runs = dataset.vibroimpact.runs
    values = runs[swept[0]].values.astype(np.float64)
    often = _frequencies(dataset, runs["run_id"].values)
    if not np.isfinite(often).any():
        raise DatasetError(f"figure: expected a run with {_FEWEST} impacts or more, got none.")
    figure = canvas(62)
    axis = figure.subplots()
    axis.plot(
        values, often, "o", color=COLOURS[1], markersize=2.5, fillstyle="none", label="simulated impacts"
    )
    curve = _shifted(dataset, swept[0], values)
    if curve is not None:
        axis.plot(*curve, color=COLOURS[0], zorder=0, label=r"$\omega_n \pi / \arccos(-a / x_{max})$")
    axis.axvline(0.0, color=STOP, linewidth=0.4, zorder=0)
    unit = "-" if dataset.attrs.get("units_system") == "nondimensional" else "rad/s"
    axis.set(xlabel=label(dataset[swept[0]]), ylabel=f"angular frequency of impacts ({unit})")
    axis.set_xlim(float(values.min()), float(values.max()))
    axis.set_ylim(bottom=0.0)
    legend_outside(figure, axis, ncols=2)
    return figure


def _frequencies(dataset: xr.Dataset, run_ids: Floats) -> Floats:
    """Return 2 pi over the mean interval between impacts of each run, rad/s; NaN for too few impacts."""
    owners = dataset["impact_run"].values
    order = np.argsort(owners, kind="stable")
    times, owners = dataset["impact_time"].values[order], owners[order]
    found = np.full(run_ids.size, np.nan)
    for place, number in enumerate(run_ids):
        own = times[slice(*np.searchsorted(owners, [number, number + 1]))]
        if own.size >= _FEWEST and own[-1] > own[0]:
            found[place] = 2.0 * np.pi * (own.size - 1) / (own[-1] - own[0])
    return found


def _shifted(dataset: xr.Dataset, swept: str, positions: Floats) -> tuple[Floats, Floats] | None:
    """Return the curve of an undamped mass released from below its upper stop; None for any other scene."""
    scene = scene_of(dataset.attrs)
    stops = scene.get("stop", [])
    body = table(scene, "body")
    is_free = (
        isinstance(scene.get("body"), dict)
        and not scene.get("forcing")
        and len(stops) == 1
        and stops[0].get("side", "upper") == "upper"
    )
    names = ("mass", "stiffness", "damping", "displacement_start", "velocity_start")
    if not (is_free and swept == "position" and body.get("kind", "oscillator") == "oscillator"):
        return None
    if not all(name in dataset.variables for name in names):
        return None
    mass, stiffness, damping, start, speed = (float(dataset[name]) for name in names)
    if damping != 0.0 or speed != 0.0 or not start < 0.0 < stiffness:
        return None
    ratio = np.sort(positions) / -start
    inside = (ratio > -1.0) & (ratio <= 1.0)
    return np.sort(positions)[inside], np.sqrt(stiffness / mass) * frequency_shift(ratio[inside])

"""Figures for one journal column: sweeps, single runs, and how coupling errors fall with the step.

The only package that imports matplotlib; it draws without a display.
"""

from __future__ import annotations

from typing import Literal

from vibroimpact.analysis.figures.style import page_style

# isort: split
import xarray as xr
from matplotlib.figure import Figure

from vibroimpact.analysis.figures.estimates import draw_estimates
from vibroimpact.analysis.figures.intervals import draw_intervals
from vibroimpact.analysis.figures.ladder import convergence
from vibroimpact.analysis.figures.modal import draw_energies, draw_shapes
from vibroimpact.analysis.figures.page import COLUMN_WIDTH, label, save
from vibroimpact.analysis.figures.portraits import draw_impact_map, draw_portrait
from vibroimpact.analysis.figures.recordings import draw_recording
from vibroimpact.analysis.figures.replay import draw_replay
from vibroimpact.analysis.figures.runs import draw_run
from vibroimpact.analysis.figures.scores import draw_scores
from vibroimpact.analysis.figures.series import draw_series
from vibroimpact.analysis.figures.sweeps import (
    draw_bifurcation,
    draw_map,
    largest_impact_velocity,
    varied,
)
from vibroimpact.fmus.errors import DatasetError

__all__ = [
    "COLUMN_WIDTH",
    "Figure",
    "Kind",
    "convergence",
    "draw",
    "draw_bifurcation",
    "draw_energies",
    "draw_estimates",
    "draw_impact_map",
    "draw_intervals",
    "draw_map",
    "draw_portrait",
    "draw_recording",
    "draw_replay",
    "draw_results",
    "draw_run",
    "draw_scores",
    "draw_series",
    "draw_shapes",
    "label",
    "largest_impact_velocity",
    "save",
]

Kind = Literal["auto", "bifurcation", "run", "convergence", "portrait", "impact-map", "energies", "shapes"]

_DRAWERS = {
    "portrait": draw_portrait,
    "impact-map": draw_impact_map,
    "energies": draw_energies,
    "shapes": draw_shapes,
}


_RESULTS = {"replay": draw_replay, "estimates": draw_estimates, "spikes": draw_intervals}


def draw_results(dataset: xr.Dataset, kind: str) -> Figure:
    """Draw the dataset of an analysis, as `write_results` wrote it.

    Raises
    ------
    DatasetError
        Nothing is drawn of this kind.
    """
    if kind not in _RESULTS:
        known = ", ".join(_RESULTS)
        raise DatasetError(f"results: expected a kind that can be drawn ({known}), got {kind!r}.")
    return _RESULTS[kind](dataset)


def draw(dataset: xr.Dataset, kind: Kind = "auto", run: int | None = None) -> Figure:
    """Draw a dataset as `open_dataset` gives it, or what a benchmark measured.

    Parameters
    ----------
    dataset : xarray.Dataset
    kind : {"auto", "bifurcation", "run", "convergence", "portrait", "impact-map", "energies", "shapes"}
        `auto` draws a single run where nothing is swept or a run is named, else a bifurcation diagram, or
        colour maps over two swept parameters; of a campaign of replays its scores. `convergence`: see
        `convergence`. `portrait`, `impact-map`: one run in the phase plane, and its impacts by phase and velocity.
        `energies`, `shapes`: of the modes.
    run : int, optional
        `run_index` of the run to draw.

    Returns
    -------
    matplotlib.figure.Figure
        One column (85 mm) wide.

    Raises
    ------
    DatasetError
        If the dataset does not hold what the figure shows.
    """
    if kind == "convergence":
        return convergence(dataset)
    swept = varied(dataset)
    with page_style():
        if kind == "run" or (kind == "auto" and (run is not None or not swept)):
            return draw_run(dataset, run)
        if kind in _DRAWERS:
            return _DRAWERS[kind](dataset, run)
        if kind == "auto" and "variance_accounted_for" in dataset:
            return draw_scores(dataset)
        if len(swept) == 1:
            return draw_bifurcation(dataset)
        if len(swept) == 2:
            return draw_map(dataset)
    raise DatasetError(
        f"figure: expected one or two swept parameters, got {len(swept)} ({', '.join(swept) or 'none'}). "
        "Select some in Python before drawing, or draw one run."
    )

"""The family of datasets of runs, with its figures and the choice of the default one."""

from __future__ import annotations

from functools import partial

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from vibroimpact.analysis.figures.families import Drawing, Family, register, whole
from vibroimpact.analysis.figures.measured.spectra import draw_run_spectrum
from vibroimpact.analysis.figures.motion.modal import draw_energies, draw_shapes
from vibroimpact.analysis.figures.motion.portraits import draw_impact_map, draw_portrait, draw_return_map
from vibroimpact.analysis.figures.motion.runs import draw_run
from vibroimpact.analysis.figures.motion.series import sampled_variables
from vibroimpact.analysis.figures.motion.steps import draw_steps
from vibroimpact.analysis.figures.motion.strobe import draw_strobe
from vibroimpact.analysis.figures.orbits.branches import BRANCH, draw_branches
from vibroimpact.analysis.figures.study.scores import draw_scores
from vibroimpact.analysis.figures.sweep.classes import KIND as CLASS_KIND
from vibroimpact.analysis.figures.sweep.classes import draw_classes
from vibroimpact.analysis.figures.sweep.diagrams import (
    draw_bifurcation,
    draw_impacts_per_period,
    draw_map,
    varied,
    wrong_sweep,
)
from vibroimpact.analysis.figures.sweep.impact_frequency import draw_impact_frequency
from vibroimpact.analysis.figures.sweep.measured_sweep import draw_measured_sweep
from vibroimpact.analysis.figures.window import View
from vibroimpact.fmus.errors import DatasetError, UsageError

_SINGLE = ("run", "window")
_OF_SWEEP = ("over", "variable")


def _swept(dataset: xr.Dataset, count: int, *names: str) -> bool:
    return len(varied(dataset)) == count and any(name in dataset.variables for name in names)


def _has_pair(dataset: xr.Dataset) -> bool:
    names = sampled_variables(dataset)
    return any("displacement" in n and n.replace("displacement", "velocity") in names for n in names)


def _has_phases(dataset: xr.Dataset) -> bool:
    return "impact_phase" in dataset and bool(np.isfinite(dataset["impact_phase"].values).any())


def _draw_sweep(dataset: xr.Dataset, view: View) -> Figure:
    if view.over is None and "measurement_flags" not in dataset:
        return draw_bifurcation(dataset, view.variable)
    if view.variable is not None:
        raise UsageError(
            "figure: variable: expected none for a measured sweep, which has its displacement range, got one."
        )
    return draw_measured_sweep(dataset, view.over)


def _usual(data: xr.Dataset, view: View) -> str:
    """Return the default kind of figure for a dataset of runs."""
    swept = varied(data)
    for column, kind in ((BRANCH, "branches"), (CLASS_KIND, "classes")):
        if column in data and view.run is None and swept:
            return kind
    if view.run is not None or not swept:
        return "run"
    if "variance_accounted_for" in data:
        return "scores"
    if len(swept) > 2:
        raise DatasetError(wrong_sweep("one or two swept parameters", data))
    return "bifurcation" if len(swept) == 1 else "map"


register(
    Family(
        "runs",
        "a dataset of runs",
        {
            "bifurcation": Drawing(
                _draw_sweep, lambda data: _swept(data, 1, "displacement_range", "impact_velocity"), _OF_SWEEP
            ),
            "branches": Drawing(
                lambda data, view: draw_branches(data, view.over, view.variable),
                lambda data: BRANCH in data,
                _OF_SWEEP,
            ),
            "classes": Drawing(whole(draw_classes), lambda data: CLASS_KIND in data),
            "map": Drawing(
                whole(draw_map),
                lambda data: _swept(data, 2, "displacement_range", "impact_velocity"),
            ),
            "impacts-per-period": Drawing(
                whole(draw_impacts_per_period),
                lambda data: _swept(data, 2, "impacts_per_period"),
            ),
            "impact-frequency": Drawing(
                whole(draw_impact_frequency),
                lambda data: _swept(data, 1, "impact_time") and data.sizes.get("impact", 0) > 1,
            ),
            "strobe": Drawing(draw_strobe, lambda data: "strobe_displacement" in data, ("run",)),
            "run": Drawing(
                draw_run,
                lambda data: (
                    bool(sampled_variables(data)) or "displacement_max" in data or "impact_velocity" in data
                ),
                _SINGLE,
            ),
            "steps": Drawing(draw_steps, lambda data: data.sizes.get("chosen_step", 0) > 0, _SINGLE),
            "portrait": Drawing(draw_portrait, _has_pair, _SINGLE),
            "impact-map": Drawing(draw_impact_map, _has_phases, _SINGLE),
            "return-map": Drawing(draw_return_map, lambda data: data.sizes.get("impact", 0) > 1, _SINGLE),
            "spectrum": Drawing(draw_run_spectrum, lambda data: bool(sampled_variables(data)), _SINGLE),
            "density": Drawing(
                partial(draw_run_spectrum, density=True),
                lambda data: bool(sampled_variables(data)),
                (*_SINGLE, "segment"),
            ),
            "energies": Drawing(
                draw_energies,
                lambda data: "modal_energy_1" in data and {"energy_kinetic", "energy_potential"} <= set(data),
                _SINGLE,
            ),
            "shapes": Drawing(
                whole(draw_shapes),
                lambda data: "location" in varied(data) and "displacement_start_1" in varied(data),
            ),
            "scores": Drawing(
                whole(draw_scores),
                lambda data: "variance_accounted_for" in data and bool(varied(data)),
            ),
        },
        usual=_usual,
        is_of_results=False,
    )
)

"""A study of accuracy as a dataset."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset.results import ResultTable
from vibroimpact.orchestrator.study.accuracy.choice import advice, error_of_reference, pareto_front
from vibroimpact.orchestrator.study.accuracy.measured import Comparison, Measured
from vibroimpact.orchestrator.study.errors import FIRST_IMPACTS, QUANTITIES
from vibroimpact.orchestrator.study.statistics import Statistics

TABLE = ResultTable(
    "accuracy",
    ("cost", "way", "s", "median processor time of a run"),
    ("cost_low", "way", "s", "shortest processor time of a run"),
    ("cost_high", "way", "s", "longest processor time of a run"),
    ("cost_per_impact", "way", "s", "median processor time of a run over the impacts recorded"),
    ("cost_per_period", "way", "s", "median processor time of a run over its forcing periods"),
    ("part", "way", "1", "part of the studied time that was simulated"),
    ("is_extrapolated", "way", "1", "cost of a part and of an eighth of it, along a line; error of the part"),
    ("rounds", "way", "1", "runs that were timed"),
    ("calls", "way", "1", "calls of functions of FMUs in a run"),
    (
        "memory",
        "way",
        "byte",
        "largest resident memory that a process of its own took for it, -1: not measured",
    ),
    ("impacts", "way", "1", "impacts recorded"),
    ("energy_residual", "way", "J", "energy that the exchange of forces added"),
    ("error", "way", "1", "error of {quantity}, relative"),
    ("on_front", "way", "1", "no other way is both cheaper and more exact"),
    ("is_model", "way", "1", "another model, not another way of solving it"),
    (
        "variance_accounted_for",
        "way",
        "percent",
        "variance of what was measured that is accounted for, least of the channels",
    ),
    *(
        (f"error_{quantity}", "way", "1", f"error of the {quantity.replace('_', ' ')}, relative")
        for quantity in QUANTITIES
    ),
    ("mean_interval_error", "way", "1", "error of the mean interval between impacts, relative"),
    ("mean_interval_sampling", "way", "1", "sampling error of the mean interval, relative"),
    (
        "distribution_distance",
        "way",
        "1",
        "distance between the distributions of impact velocity, or of what is sampled, the largest",
    ),
    ("distribution_sampling", "way", "1", "its sampling error"),
    ("error_growth", "way impact", "1", "error of the velocity of each impact, relative"),
    ("name", "way", "1", "way of simulating", "text"),
    ("knob", "way", "1", "what is set", "text"),
    ("failure", "way", "1", "what is wrong with it", "text"),
    ("setting", "way", "1", "its value, in the unit of the key"),
)
"""Variables of a study. Variables of replays and chaos, and errors of unknown quantities, may be left out."""


def dataset_of(study: Comparison) -> xr.Dataset:
    """Return a study as a dataset of kind `accuracy`."""
    found, scene, reference = study.measured, study.scene, study.reference
    attributes = {
        "title": f"What accuracy costs: {scene.title or scene.source}",
        "reference": reference.name,
        "reference_error": error_of_reference(reference, study.quantity),
        "sensitivity": reference.sensitivity,
        "motion": "chaotic" if reference.chaotic else "not chaotic",
        "orbit": study.orbit,
        "quantity": study.quantity,
        "tolerance": study.tolerance,
        "chosen": study.chosen.way.label if study.chosen else "",
        "verdict": advice(study),
        "remarks": "; ".join(study.remarks),
        "modes_reference": study.modes_reference,
        "sampling": study.chance,
        "budget": study.effort.budget,
        "processor_time": study.effort.processor,
        "wall_time": study.effort.wall,
        "waited": study.effort.waited,
        "scene": scene.text,
    }
    values = _costs(study) | _errors(study) | (_values_of_chaos(found) if reference.chaotic else {})
    words = {
        "name": [one.way.name for one in found],
        "knob": [one.way.knob for one in found],
        "failure": [one.errors.failure for one in found],
        "setting": [one.way.setting for one in found],
    }
    return TABLE.dataset(values | words, attributes, quantity=study.quantity)


def _costs(study: Comparison) -> dict[str, Any]:
    found = study.measured
    return {
        "cost": [one.cost for one in found],
        "cost_low": [one.cost_of(min) for one in found],
        "cost_high": [one.cost_of(max) for one in found],
        "cost_per_impact": [one.cost_of_impact for one in found],
        "cost_per_period": [one.cost_of_one(study.periods) for one in found],
        "part": [one.part for one in found],
        "is_extrapolated": [one.is_extrapolated for one in found],
        "rounds": [len(one.seconds) for one in found],
        "calls": [one.calls for one in found],
        "memory": [one.memory for one in found],
        "impacts": [one.impacts for one in found],
        "energy_residual": [one.energy_residual for one in found],
    }


def _errors(study: Comparison) -> dict[str, Any]:
    found = study.measured
    front = pareto_front(found, study.quantity)
    values: dict[str, Any] = {
        "error": [one.error(study.quantity) for one in found],
        "on_front": [one in front for one in found],
        "is_model": [one.way.model for one in found],
    }
    if study.scene.replay is not None:
        values["variance_accounted_for"] = [one.variance for one in found]
    for quantity in QUANTITIES:
        errors = [one.error(quantity) for one in found]
        if not all(map(math.isnan, errors)):
            values[f"error_{quantity}"] = errors
    return values


def _values_of_chaos(found: Sequence[Measured]) -> dict[str, Any]:
    growth = np.full((len(found), FIRST_IMPACTS), np.nan)
    for place, one in enumerate(found):
        part = one.errors.growth[:FIRST_IMPACTS]
        growth[place, : len(part)] = part
    missing = Statistics(math.nan, math.nan, math.nan, math.nan)
    of = [one.statistics or missing for one in found]
    return {
        "mean_interval_error": [one.mean_interval_error for one in of],
        "mean_interval_sampling": [one.mean_interval_sampling for one in of],
        "distribution_distance": [one.distribution_distance for one in of],
        "distribution_sampling": [one.distribution_sampling for one in of],
        "error_growth": growth,
    }

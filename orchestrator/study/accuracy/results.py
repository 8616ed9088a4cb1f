"""A study of accuracy as a dataset."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset.results import Rows, described
from vibroimpact.orchestrator.run.provenance import git_commit, versions
from vibroimpact.orchestrator.study.accuracy.choice import advice, error_of_reference, pareto_front
from vibroimpact.orchestrator.study.accuracy.measured import Measured, Study
from vibroimpact.orchestrator.study.errors import FIRST_IMPACTS, QUANTITIES
from vibroimpact.orchestrator.study.statistics import Statistics


def dataset_of(study: Study) -> xr.Dataset:
    """Return a study as a dataset, for `write_results` of kind `accuracy` and for figures."""
    found = study.measured
    front = pareto_front(found, study.quantity)
    rows: Rows = {
        "cost": ("way", [one.cost for one in found], "s", "median processor time of a run"),
        "cost_low": ("way", [one.cost_of(min) for one in found], "s", "shortest processor time of a run"),
        "cost_high": ("way", [one.cost_of(max) for one in found], "s", "longest processor time of a run"),
        "cost_per_impact": (
            "way",
            [one.cost_of_impact for one in found],
            "s",
            "median processor time of a run over the impacts recorded",
        ),
        "cost_per_period": (
            "way",
            [one.cost_of_one(study.periods) for one in found],
            "s",
            "median processor time of a run over its forcing periods",
        ),
        "part": ("way", [one.part for one in found], "1", "part of the studied time that was simulated"),
        "is_extrapolated": (
            "way",
            [one.is_extrapolated for one in found],
            "1",
            "cost of a part and of an eighth of it, along a line; error of the part",
        ),
        "rounds": ("way", [len(one.seconds) for one in found], "1", "runs that were timed"),
        "calls": ("way", [one.calls for one in found], "1", "calls of functions of FMUs in a run"),
        "memory": (
            "way",
            [one.memory for one in found],
            "byte",
            "largest resident memory that a process of its own took for it, -1: not measured",
        ),
        "impacts": ("way", [one.impacts for one in found], "1", "impacts recorded"),
        "energy_residual": (
            "way",
            [one.energy_residual for one in found],
            "J",
            "energy that the exchange of forces added",
        ),
        "error": (
            "way",
            [one.error(study.quantity) for one in found],
            "1",
            f"error of {study.quantity}, relative",
        ),
        "on_front": (
            "way",
            [one in front for one in found],
            "1",
            "no other way is both cheaper and more exact",
        ),
        "is_model": (
            "way",
            [one.way.model for one in found],
            "1",
            "another model, not another way of solving it",
        ),
    }
    if study.scene.replay is not None:
        variance = [one.variance for one in found]
        said = "variance of what was measured that is accounted for, least of the channels"
        rows = {**rows, "variance_accounted_for": ("way", variance, "percent", said)}
    for quantity in QUANTITIES:
        values = [one.error(quantity) for one in found]
        if not all(map(math.isnan, values)):
            name = quantity.replace("_", " ")
            rows = {**rows, f"error_{quantity}": ("way", values, "1", f"error of the {name}, relative")}
    if study.reference.chaotic:
        rows = {**rows, **_rows_of_chaos(found)}
    dataset = xr.Dataset(described(rows))
    names = {
        "name": [one.way.name for one in found],
        "knob": [one.way.knob for one in found],
        "failure": [one.errors.failure for one in found],
    }
    words = {"name": "way of simulating", "knob": "what is set", "failure": "what is wrong with it"}
    for key, texts in names.items():
        dataset[key] = ("way", np.array(texts, dtype=object), {"units": "1", "long_name": words[key]})
    setting = [one.way.setting for one in found]
    dataset["setting"] = ("way", setting, {"units": "1", "long_name": "its value, in the unit of the key"})
    reference = study.reference
    return dataset.assign_attrs(
        title=f"What accuracy costs: {study.scene.title or study.scene.source}",
        reference=reference.name,
        reference_error=error_of_reference(reference, study.quantity),
        sensitivity=reference.sensitivity,
        motion="chaotic" if reference.chaotic else "not chaotic",
        orbit=study.orbit,
        quantity=study.quantity,
        tolerance=study.tolerance,
        chosen=study.chosen.way.label if study.chosen else "",
        verdict=advice(study),
        remarks="; ".join(study.remarks),
        modes_reference=study.modes_reference,
        budget=study.effort.asked,
        processor_time=study.effort.processor,
        wall_time=study.effort.wall,
        waited=study.effort.waited,
        scene=study.scene.text,
        versions=json.dumps(versions()),
        git_commit=git_commit(),
    )


def _rows_of_chaos(found: Sequence[Measured]) -> Rows:
    growth = np.full((len(found), FIRST_IMPACTS), np.nan)
    for place, one in enumerate(found):
        part = one.errors.growth[:FIRST_IMPACTS]
        growth[place, : len(part)] = part
    missing = Statistics(math.nan, math.nan, math.nan, math.nan)
    of = [one.statistics or missing for one in found]
    rows: Rows = {
        "mean_interval_error": (
            "way",
            [one.mean_interval_error for one in of],
            "1",
            "error of the mean interval between impacts, relative",
        ),
        "mean_interval_sampling": (
            "way",
            [one.mean_interval_sampling for one in of],
            "1",
            "sampling error of the mean interval, relative",
        ),
        "distribution_distance": (
            "way",
            [one.distribution_distance for one in of],
            "1",
            "distance between the distributions of impact velocity, or of what is sampled, the largest",
        ),
        "distribution_sampling": (
            "way",
            [one.distribution_sampling for one in of],
            "1",
            "its sampling error",
        ),
    }
    return {
        **rows,
        "error_growth": (("way", "impact"), growth, "1", "error of the velocity of each impact, relative"),
    }

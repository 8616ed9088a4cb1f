"""Datasets of benchmarks that measure the energy error of a contact over a ladder of steps."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset.provenance import git_commit, versions
from vibroimpact.analysis.landmarks import observed_order


def energy_ladder(
    columns: Mapping[str, tuple[Any, str, str]],
    methods: tuple[Sequence[str], str],
    steps: tuple[np.ndarray, str],
    title: str,
    script: str,
) -> xr.Dataset:
    """Return the dataset of a ladder, with the observed order of its `energy_drift`.

    Parameters
    ----------
    columns : mapping of str to (ndarray, str, str)
        Values of each variable, shape (method, step), with unit and meaning.
    methods : (sequence of str, str)
        Names along `exchange`, and their meaning.
    steps : (ndarray, str)
        Steps a contact along `macro_step`, shape (step,), and the meaning of their inverse.
    title, script : str
        Title, and name of the benchmark.
    """
    (names, of_names), (numbers, of_steps) = methods, steps
    axes = ("exchange", "macro_step")
    dataset = xr.Dataset(
        {name: (axes, data, {"units": u, "long_name": text}) for name, (data, u, text) in columns.items()},
        coords={
            "exchange": ("exchange", list(names), {"long_name": of_names}),
            "macro_step": ("macro_step", 1.0 / numbers, {"units": "1", "long_name": of_steps}),
        },
        attrs={
            "title": title,
            "Conventions": "CF-1.11",
            "source": f"vibroimpact {versions()['vibroimpact']}, tests/benchmarks/{script}",
            "versions": json.dumps(versions()),
            "git_commit": git_commit(),
        },
    )
    orders = [observed_order(1.0 / numbers, drift) for drift in dataset["energy_drift"].values]
    dataset["energy_drift_order"] = ("exchange", orders, {"units": "1", "long_name": "observed order"})
    return dataset

"""The clock of runs under several forces, in the attributes of their dataset."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.fmus.errors import DatasetError

CLOCK_PERIODS = "clock_periods"
"""Attribute: periods of the first sine in a forcing period; 0 where not all forces repeat with it."""

DRIFTING = ("velocity", "motion_times")
"""Keys of a stop that moves without a period."""


def refuse_quasi_periodic(attrs: Mapping[Any, Any], study: str) -> None:
    """Raise DatasetError for runs under forces without a common period, whose motion does not repeat.

    Examples
    --------
    >>> refuse_quasi_periodic({"clock_periods": 2}, "classify")
    >>> refuse_quasi_periodic({"clock_periods": 0}, "classify")  # doctest: +IGNORE_EXCEPTION_DETAIL
    Traceback (most recent call last):
    vibroimpact.fmus.errors.DatasetError: classify: expected forces with a common period, got forces without one.
    """
    if attrs.get(CLOCK_PERIODS, 1) == 0:
        raise DatasetError(
            f"{study}: expected forces with a common period, got forces without one. Their motion does not repeat."
        )


def turns_of_sines(dataset: xr.Dataset, study: str) -> NDArray[np.float64] | None:
    """Return the turns of further sines in a forcing period, run by run; None where all forces repeat with it.

    The result has the shape (run, sine), in the order of the file; it has no sines where their frequencies are unknown.

    Raises
    ------
    DatasetError
        A force or the motion of a stop never repeats, such as a chirp.
    """
    if dataset.attrs.get(CLOCK_PERIODS, 1) != 0:
        return None
    scene = tomllib.loads(str(dataset.attrs.get("scene", "")))
    forces, stops = scene.get("forcing", []), scene.get("stop", [])
    kinds = [each.get("signal", "sine") for each in forces]
    if not set(kinds) <= {"sine", "constant"} or any(each.get(key) for each in stops for key in DRIFTING):
        refuse_quasi_periodic(dataset.attrs, study)
    runs = dataset.vibroimpact.runs
    rates = [_rates(runs, number) for number, kind in enumerate(kinds, start=1) if kind == "sine"]
    count, known = runs.sizes["run"], [each for each in rates if each is not None]
    if len(known) < len(rates) or any("motion_amplitude" in each for each in stops):
        return np.empty((count, 0))
    table = np.stack([np.broadcast_to(each, count) for each in known], axis=1)
    return np.asarray(table[:, 1:] / table[:, :1])


def _rates(runs: xr.Dataset, number: int) -> NDArray[np.float64] | None:
    """Return the frequency of a force in each run; a swept number has a short name. None: no name has it."""
    short = ("angular_frequency", "frequency")
    names = [*(f"forcing_{number}_{name}" for name in short), *short]
    return next((np.asarray(runs[name].values, dtype=np.float64) for name in names if name in runs), None)


def refuse_several_forces(scene: Mapping[str, Any], study: str) -> None:
    """Raise DatasetError unless a scene, as its document, has one sine or no force.

    Examples
    --------
    >>> refuse_several_forces({"forcing": {"amplitude": 1.0, "angular_frequency": 2.0}}, "estimate")
    >>> refuse_several_forces({"forcing": [{}, {}]}, "estimate")
    Traceback (most recent call last):
    vibroimpact.fmus.errors.DatasetError: estimate: expected a scene with one sine, got 2 forces.
    """
    forcing = scene.get("forcing")
    if isinstance(forcing, list):
        raise DatasetError(f"{study}: expected a scene with one sine, got {len(forcing)} forces.")
    signal = forcing.get("signal", "sine") if isinstance(forcing, dict) else "sine"
    if signal != "sine":
        raise DatasetError(f'{study}: expected a scene with one sine, got a force of signal "{signal}".')

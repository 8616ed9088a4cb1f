"""The clock of runs under several forces, in the attributes of their dataset."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vibroimpact.fmus.errors import DatasetError

CLOCK_PERIODS = "clock_periods"
"""Attribute: periods of the first sine in a forcing period; 0 where not all forces repeat with it."""


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

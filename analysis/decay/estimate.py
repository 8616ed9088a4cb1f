"""A number with its doubt, and such numbers as a dataset."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import xarray as xr
from scipy.stats import t as student

from vibroimpact.analysis.files.estimate_table import estimate_table

CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class Estimate:
    """A value, its standard error and what the error rests on.

    Attributes
    ----------
    value, standard_error : float
        In `unit`.
    unit : str
        CF unit.
    degrees_of_freedom : float
        Of the residual that the standard error was taken from.
    """

    value: float
    standard_error: float
    unit: str = "1"
    degrees_of_freedom: float = float("inf")

    @property
    def interval(self) -> tuple[float, float]:
        """Limits of the 95 % confidence interval, by Student's t.

        >>> low, high = Estimate(2.0, 0.1).interval
        >>> round(low, 3), round(high, 3)
        (1.804, 2.196)
        """
        half = float(student.ppf(0.5 + CONFIDENCE / 2, self.degrees_of_freedom)) * self.standard_error
        return self.value - half, self.value + half


def table_of(estimates: Mapping[str, Mapping[str, Estimate]]) -> xr.Dataset:
    """Return estimates by method, then quantity, on these dimensions; see `estimate_table`."""
    units: dict[str, str] = {}
    for found in estimates.values():
        for name, item in found.items():
            units.setdefault(name, item.unit)
    cells = {
        method: {name: (item.value, item.standard_error, *item.interval) for name, item in found.items()}
        for method, found in estimates.items()
    }
    return estimate_table(cells, units, CONFIDENCE)

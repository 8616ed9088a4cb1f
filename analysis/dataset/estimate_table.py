"""Estimates as a dataset: one row for each estimator, one column for each quantity."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset.results import ResultTable

TABLE = ResultTable(
    "estimates",
    ("estimate", "estimator quantity", "1", "estimate, in the unit of its quantity"),
    ("standard_error", "estimator quantity", "1", "standard error of the estimate"),
    ("interval_low", "estimator quantity", "1", "lower end of the {confidence} interval"),
    ("interval_high", "estimator quantity", "1", "upper end of the {confidence} interval"),
    ("estimator", "estimator", "1", "method of estimation"),
    ("quantity", "quantity", "1", "estimated quantity"),
    ("unit", "quantity", "1", "unit of the quantity"),
)
Cell = tuple[float, float, float, float]
"""Value, standard error, and both ends of the interval."""
_OF_A_CELL = ("estimate", "standard_error", "interval_low", "interval_high")
_NOTHING: Cell = (float("nan"),) * 4


def estimate_table(
    cells: Mapping[str, Mapping[str, Cell]], units: Mapping[str, str], confidence: float
) -> xr.Dataset:
    """Return estimates on the dimensions estimator and quantity.

    Units differ by quantity, so the variables carry `1`, and the coordinate `unit` gives the unit of each quantity.

    Parameters
    ----------
    cells : mapping
        By estimator, then quantity; a quantity that an estimator does not give is NaN.
    units : mapping of str to str
        CF unit of each quantity, in the order of the columns.
    confidence : float
        Confidence of the intervals.

    Examples
    --------
    >>> table = estimate_table({"fit": {"mass": (2.0, 0.1, 1.8, 2.2)}}, {"mass": "kg"}, 0.95)
    >>> float(table.estimate.sel(estimator="fit", quantity="mass")), table.interval_low.attrs["long_name"]
    (2.0, 'lower end of the 95% interval')
    """
    rows = [[found.get(quantity, _NOTHING) for quantity in units] for found in cells.values()]
    values = np.array(rows, dtype=np.float64).reshape(len(cells), len(units), len(_NOTHING))
    found = dict(zip(_OF_A_CELL, np.moveaxis(values, -1, 0), strict=True))
    axes = {"estimator": list(cells), "quantity": list(units), "unit": list(units.values())}
    return TABLE.dataset(found | axes, confidence=f"{confidence:.0%}").set_coords("unit")

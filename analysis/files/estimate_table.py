"""Estimates as a dataset: one row for each estimator, one column for each quantity."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

Cell = tuple[float, float, float, float]
"""Value, standard error, and both ends of the interval."""
_NOTHING: Cell = (float("nan"),) * 4


def estimate_table(
    cells: Mapping[str, Mapping[str, Cell]], units: Mapping[str, str], confidence: float
) -> xr.Dataset:
    """Return estimates on the dimensions estimator and quantity.

    Units differ by quantity, so the variables carry `1` and the coordinate `unit` says each quantity's own.

    Parameters
    ----------
    cells : mapping
        By estimator, then quantity; what an estimator does not give is NaN.
    units : mapping of str to str
        CF unit of each quantity, in the order of the columns.
    confidence : float
        Of the intervals.

    Examples
    --------
    >>> table = estimate_table({"fit": {"mass": (2.0, 0.1, 1.8, 2.2)}}, {"mass": "kg"}, 0.95)
    >>> float(table.estimate.sel(estimator="fit", quantity="mass")), table.interval_low.attrs["long_name"]
    (2.0, 'lower end of the 95% interval')
    """
    rows = [[found.get(quantity, _NOTHING) for quantity in units] for found in cells.values()]
    values = np.array(rows, dtype=np.float64).reshape(len(cells), len(units), len(_NOTHING))
    words = {
        "estimate": "estimate, in the unit of its quantity",
        "standard_error": "standard error of the estimate",
        "interval_low": f"lower end of the {confidence:.0%} interval",
        "interval_high": f"upper end of the {confidence:.0%} interval",
    }
    data = {
        name: (("estimator", "quantity"), values[:, :, place], described(said))
        for place, (name, said) in enumerate(words.items())
    }
    coords = {
        "estimator": ("estimator", list(cells), described("method of estimation")),
        "quantity": ("quantity", list(units), described("estimated quantity")),
        "unit": ("quantity", list(units.values()), described("unit of the quantity")),
    }
    return xr.Dataset(data, coords)


def described(words: str, unit: str = "1") -> dict[str, str]:
    """Return the attributes of a variable: its unit, and what it is in words."""
    return {"units": unit, "long_name": words}

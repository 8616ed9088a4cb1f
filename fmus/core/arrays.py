"""Arrays in the layout that C reads."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vibroimpact.fmus.errors import UsageError


def address(array: NDArray[Any]) -> int:
    """Return the address of the values of a contiguous array."""
    if not array.flags.c_contiguous:
        raise ValueError("address: expected a contiguous array")
    return int(array.ctypes.data)


def row_of(what: str, values: ArrayLike, *, finite: bool = True) -> NDArray[np.float64]:
    """Return a contiguous row of numbers; a single number is a row of one.

    Raises
    ------
    UsageError
        The values have another shape, or one is not finite. The message names `what`.
    """
    row = np.ascontiguousarray(np.atleast_1d(np.asarray(values, dtype=np.float64)))
    if row.ndim != 1:
        raise UsageError(f"{what}: expected a row of numbers, got an array of shape {row.shape}.")
    if finite and not np.all(np.isfinite(row)):
        place = int(np.argmin(np.isfinite(row)))
        raise UsageError(f"{what}: expected finite numbers, got {row[place]} at place {place}.")
    return row

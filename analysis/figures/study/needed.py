"""The variables that a figure needs; missing ones are refused in the same words everywhere."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import xarray as xr

from vibroimpact.fmus.errors import DatasetError


def missing_from(dataset: xr.Dataset, needed: Iterable[str]) -> list[str]:
    """Return the needed variables that a dataset lacks."""
    return [name for name in needed if name not in dataset.variables]


def refuse_missing(missing: Sequence[str], expected: str, advice: str = "") -> None:
    """Raise DatasetError, with advice, if a dataset lacks variables of its figure.

    >>> refuse_missing(["cost", "error"], "what `vibroimpact accuracy` writes")
    Traceback (most recent call last):
        ...
    vibroimpact.fmus.errors.DatasetError: figure: expected what `vibroimpact accuracy` writes, got no cost, no error.
    """
    if missing:
        problem = f"figure: expected {expected}, got no {', no '.join(missing)}."
        raise DatasetError(f"{problem} {advice}".rstrip())

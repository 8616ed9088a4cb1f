"""What a figure needs of a dataset, refused in the same words where it is not there."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import xarray as xr

from vibroimpact.fmus.errors import DatasetError


def missing_from(dataset: xr.Dataset, needed: Iterable[str]) -> list[str]:
    """Return which of the variables that a figure needs a dataset does not have."""
    return [name for name in needed if name not in dataset.variables]


def refuse_missing(missing: Sequence[str], expected: str, advice: str = "") -> None:
    """Raise DatasetError, with advice, if names are missing in a dataset of which a figure is drawn.

    >>> refuse_missing(["cost", "error"], "what `vibroimpact accuracy` writes")
    Traceback (most recent call last):
        ...
    vibroimpact.fmus.errors.DatasetError: figure: expected what `vibroimpact accuracy` writes, got no cost, no error.
    """
    if missing:
        said = f"figure: expected {expected}, got no {', no '.join(missing)}."
        raise DatasetError(f"{said} {advice}".rstrip())

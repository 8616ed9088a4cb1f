"""Registers `ds.vibroimpact` with xarray; what it is loads when it is first asked for."""

from __future__ import annotations

from typing import Any

import xarray as xr


def accessor(dataset: xr.Dataset) -> Any:
    """Return what `ds.vibroimpact` is; its module is imported when it is first asked for."""
    from vibroimpact.analysis.dataset.accessor import VibroimpactAccessor

    return VibroimpactAccessor(dataset)


xr.register_dataset_accessor("vibroimpact")(accessor)

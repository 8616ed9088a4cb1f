"""Registers `ds.vibroimpact` with xarray; its class is imported at its first use."""

from __future__ import annotations

from typing import Any

import xarray as xr


def accessor(dataset: xr.Dataset) -> Any:
    """Return the object `ds.vibroimpact`; its module is imported at the first use."""
    from vibroimpact.analysis.dataset.accessor import VibroimpactAccessor

    return VibroimpactAccessor(dataset)


xr.register_dataset_accessor("vibroimpact")(accessor)

"""Datasets that callers get: in memory, of files that go with their folder."""

from __future__ import annotations

import threading
from pathlib import Path

import xarray as xr

from vibroimpact.analysis.dataset import open_dataset
from vibroimpact.analysis.dataset.assembling import loaded

ONE_AT_A_TIME = threading.Lock()
"""Held while datasets are written and read back: NetCDF's library is not for several threads at once."""


def in_memory(file: Path) -> xr.Dataset:
    """Return what a file holds, which need not be there any more."""
    with open_dataset(file) as opened:
        return loaded(opened)

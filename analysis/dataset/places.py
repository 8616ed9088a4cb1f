"""The place of a dataset: a NetCDF file, a Zarr store, or the address of a store."""

from __future__ import annotations

import os
import re
from pathlib import Path

from vibroimpact.analysis.files.stores import Place, holds_store, is_address

NETCDF_NAME = "dataset.nc"
STORE_NAME = "dataset.zarr"
"""Names of the dataset in the folder of a campaign."""
# `Path` has taken one of the two slashes; a letter alone is a drive of Windows
_OF_PATH = re.compile(r"([a-z][a-z0-9+]+):/(?!/)")


def dataset_place(given: Place) -> Place:
    """Return the place that a name stands for: the dataset in the folder of a campaign, or what it names itself.

    Parameters
    ----------
    given : path or address
        A file, a store, the folder of a campaign, or the address of one of both.

    Returns
    -------
    Path or str
        A str for an address. The place may be empty: opening says so.

    Examples
    --------
    >>> dataset_place("run.nc").name, dataset_place(Path("memory://map.zarr"))
    ('run.nc', 'memory://map.zarr')
    """
    text = os.fspath(given)
    address = text if is_address(text) else _OF_PATH.sub(_with_slashes, text, count=1)
    if is_address(address):
        return _store_in(address.rstrip("/"))
    # os.path: False for names that no file can have, where Path.is_dir raises
    if not os.path.isdir(text) or holds_store(text):
        return Path(text)
    names = (name for name in (NETCDF_NAME, STORE_NAME) if os.path.exists(os.path.join(text, name)))
    return Path(text, next(names, NETCDF_NAME))


def _with_slashes(found: re.Match[str]) -> str:
    return f"{found[1]}:///" if found[1] in ("file", "local") else f"{found[1]}://"


def _store_in(address: str) -> str:
    """Return the address of the store of a campaign whose folder is at an address, or the address itself."""
    inside = f"{address}/{STORE_NAME}"
    return inside if not holds_store(address) and holds_store(inside) else address

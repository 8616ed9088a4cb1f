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


def given_place(given: Place) -> Place:
    """Return the place that a name stands for itself: a Path, or a str for an address.

    Examples
    --------
    >>> given_place(Path("s3://bucket/map.zarr")), given_place("run.nc").name
    ('s3://bucket/map.zarr', 'run.nc')
    """
    text = os.fspath(given)
    address = text if is_address(text) else _OF_PATH.sub(_with_slashes, text, count=1)
    return address.rstrip("/") if is_address(address) else Path(text)


def dataset_place(given: Place) -> Place:
    """Return the place of the dataset that a name stands for: in the folder of a campaign, or the name itself.

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
    >>> dataset_place("run.nc").name
    'run.nc'
    """
    place = given_place(given)
    if isinstance(place, str):
        return _store_in(place)
    # os.path: False for names that no file can have, where Path.is_dir raises
    if not os.path.isdir(place) or holds_store(place):
        return place
    names = (name for name in (NETCDF_NAME, STORE_NAME) if os.path.exists(os.path.join(place, name)))
    return Path(place, next(names, NETCDF_NAME))


def _with_slashes(found: re.Match[str]) -> str:
    return f"{found[1]}:///" if found[1] in ("file", "local") else f"{found[1]}://"


def _store_in(address: str) -> str:
    """Return the address of the store of a campaign whose folder is at an address, or the address itself."""
    inside = f"{address}/{STORE_NAME}"
    return inside if not holds_store(address) and holds_store(inside) else address

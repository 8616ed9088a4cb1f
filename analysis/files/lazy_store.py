"""A NetCDF file that xarray reads lazily, from any thread.

xarray reads values under a lock, since the NetCDF library is not made for threads; it opens files, reads attributes and
closes what was dropped without it. Here all of this is done under the lock.
"""

from __future__ import annotations

import weakref
from typing import Any

import netCDF4
from xarray.backends import NetCDF4DataStore

from vibroimpact.analysis.files.opening import NETCDF_LOCK

_dropped: list[netCDF4.Dataset] = []
"""Files that nobody uses any more, and that could not be closed at once."""


class LazyStore(NetCDF4DataStore):
    """An open file; it is closed with the dataset that is made of it, or when that is dropped.

    Parameters
    ----------
    path : str
        Absolute.
    """

    def __init__(self, path: str) -> None:
        with NETCDF_LOCK:
            while _dropped:
                _dropped.pop().close()
            self._root = netCDF4.Dataset(path, "r")
            try:
                super().__init__(self._root)  # type: ignore[no-untyped-call]
                self._loaded, self._encoding = super().load(), super().get_encoding()  # type: ignore[no-untyped-call]
            except BaseException:
                self._root.close()
                raise
        self._at_end = weakref.finalize(self, _close, self._root)

    def load(self) -> Any:
        """Return variables and attributes, without the values of the former."""
        return self._loaded

    def get_encoding(self) -> Any:
        """Return what xarray keeps of how the file is stored."""
        return self._encoding

    def close(self, **_: Any) -> None:
        """Close the file; once more is nothing."""
        if self._at_end.detach():
            with NETCDF_LOCK:
                self._root.close()


def _close(root: netCDF4.Dataset) -> None:
    # the garbage collector may call this while this very thread holds the lock
    if NETCDF_LOCK.locked():
        _dropped.append(root)
        return
    with NETCDF_LOCK:
        root.close()

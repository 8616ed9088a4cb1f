"""A NetCDF file that xarray reads lazily, from any thread.

xarray reads values under its lock, but opens files, reads attributes and closes dropped files without it. This module
does all of this under the lock, and opens a file only once (`open_files`).
"""

from __future__ import annotations

import weakref
from typing import Any

from xarray.backends import NetCDF4DataStore

from vibroimpact.analysis.files.open_files import drop, give_back, netcdf_lock, take


class LazyStore(NetCDF4DataStore):
    """An open file; it is released with the dataset made from it, or when that is dropped.

    Parameters
    ----------
    path : str
        Absolute.
    """

    def __init__(self, path: str) -> None:
        with netcdf_lock():
            self._file = take(path)
            try:
                # these two methods of xarray have no types
                super().__init__(self._file.root)  # type: ignore[no-untyped-call]  # of xarray
                self._loaded, self._encoding = super().load(), super().get_encoding()  # type: ignore[no-untyped-call]  # of xarray
            except BaseException:
                give_back(self._file)
                raise
        self._at_end = weakref.finalize(self, drop, self._file)

    def load(self) -> Any:
        """Return variables and attributes, without the values of the former."""
        return self._loaded

    def get_encoding(self) -> Any:
        """Return xarray's record of the storage of the file."""
        return self._encoding

    def close(self, **_: Any) -> None:
        """Release the file; a second call does nothing."""
        if self._at_end.detach():
            with netcdf_lock():
                give_back(self._file)

"""A NetCDF file that xarray reads lazily, from any thread.

xarray reads values under its lock; it opens files, reads attributes and closes what was dropped without it. Here all of
this is done under the lock, and a file is open once (`open_files`).
"""

from __future__ import annotations

import weakref
from typing import Any

from xarray.backends import NetCDF4DataStore

from vibroimpact.analysis.files.open_files import drop, give_back, netcdf_lock, take


class LazyStore(NetCDF4DataStore):
    """An open file; it is given back with the dataset that is made of it, or when that is dropped.

    Parameters
    ----------
    path : str
        Absolute.
    """

    def __init__(self, path: str) -> None:
        with netcdf_lock():
            self._file = take(path)
            try:
                # these two of xarray carry no types
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
        """Return what xarray keeps of how the file is stored."""
        return self._encoding

    def close(self, **_: Any) -> None:
        """Give the file back; once more is nothing."""
        if self._at_end.detach():
            with netcdf_lock():
                give_back(self._file)

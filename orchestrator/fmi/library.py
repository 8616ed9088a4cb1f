"""The shared library of an FMU, loaded once for each process."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from vibroimpact.fmus.errors import ComponentFileError
from vibroimpact.fmus.packaging.archive import UnpackedFmu, binary_path

Function = Callable[..., Any]


class Library:
    """The functions of one FMU binary.

    The functions have no argument types: callers pass ready-made ctypes objects only. This takes two thirds of the
    time of converted arguments. ComponentFileError: the binary for this machine is missing, or does not load.
    """

    def __init__(self, fmu: UnpackedFmu) -> None:
        self.fmu = fmu
        self._handle = _load(binary_path(fmu), fmu.shown)

    def function(self, name: str, result: Any = ctypes.c_int) -> Function:
        """Return a function by name; ComponentFileError if the binary does not export it."""
        try:
            found = self._handle[name]  # a function object of our own: attributes of the handle are shared
        except AttributeError as error:
            raise ComponentFileError(
                f"{self.fmu.shown}: expected a binary that exports {name}, got one without it."
            ) from error
        found.restype = result
        return found


@cache
def _load(path: Path, source: str) -> ctypes.CDLL:
    try:
        return ctypes.CDLL(str(path))
    except OSError as error:
        said = str(error).replace(f"{path.parents[2]}{os.sep}", "")  # paths in the FMU, not in the cache
        raise ComponentFileError(
            f"{source}: expected a binary that this system can load, got: {said}"
        ) from error

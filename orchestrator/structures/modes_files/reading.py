"""Modes from files, each read in a process of its own."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

from vibroimpact.orchestrator.structures.modes import Modes
from vibroimpact.orchestrator.structures.modes_files.child import unpacked
from vibroimpact.orchestrator.structures.readers.apart import read_file_apart

_CHILD = "vibroimpact.orchestrator.structures.modes_files.child:read"
_LIBRARIES = {".nc": ("netCDF4",)}


def read_modes(path: os.PathLike[str] | str) -> Modes:
    """Return the modes of a file of TOML, CSV, NetCDF or universal datasets (UFF 55).

    Parameters
    ----------
    path : path
        Its kind follows from its first bytes, else from the end of its name; `.gz` may follow.

    Returns
    -------
    Modes
        In ascending order of frequency. Complex shapes are made real, and a remark says the part that is left out.

    Raises
    ------
    UsageError
        The file is missing, damaged or of another kind. Its numbers do not fit each other. A modal mass is missing, or
        a complex shape is further than 10 % from real. The text is one line that begins with the path.
    """
    path = Path(path)
    libraries = _LIBRARIES.get(path.suffix.lower(), ())
    found, digest = read_file_apart(path, _CHILD, {}, unpacked, libraries)
    return replace(found, files={**found.files, path.name: digest})

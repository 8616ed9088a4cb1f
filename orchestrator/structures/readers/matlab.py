"""MATLAB files: versions 4 to 7 by scipy, version 7.3 by h5py where it is installed; full and sparse matrices by name.

The libraries are compiled and can crash on damaged bytes; they run in the process of `apart`.
"""

from __future__ import annotations

import io
import math
from typing import Any

import numpy as np

from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.readers.found import MOST_ENTRIES, Found, in_columns
from vibroimpact.orchestrator.structures.readers.refusal import one_refusal
from vibroimpact.orchestrator.structures.readers.wanted import Wanted

_HDF5 = b"\x89HDF\r\n\x1a\n"
_VERSION_7_3 = b"MATLAB 7.3"
_OTHERS = frozenset({"cell", "struct", "object", "char", "function", "opaque", "unknown"})
"""Classes that hold no matrix of numbers."""
_SPARSE = "MATLAB_sparse"
"""Attribute of a group with the values, rows and columns of a sparse matrix: its number of rows."""
_MOST_OBJECTS = 10_000


def read(content: bytes, wanted: Wanted) -> Found:
    """Return the wanted matrices of a file.

    Raises
    ------
    UsageError
        The file is damaged; a matrix is missing, complex or not square; h5py is not installed.
    """
    with one_refusal("a whole MATLAB file"):
        matrices = _of_hdf5 if content.startswith((_VERSION_7_3, _HDF5)) else _of_scipy
        return Found({role: in_columns(one) for role, one in matrices(content, wanted).items()})


def _of_scipy(content: bytes, wanted: Wanted) -> dict[str, Any]:
    """Return the wanted matrices by their roles."""
    from scipy.io import loadmat, whosmat

    listed = {name: shape for name, shape, kind in whosmat(io.BytesIO(content)) if kind not in _OTHERS}
    chosen = wanted.among(listed)
    loaded = loadmat(io.BytesIO(content), variable_names=list(chosen.values()))
    return {role: loaded[name] for role, name in chosen.items()}


def _of_hdf5(content: bytes, wanted: Wanted) -> dict[str, Any]:
    """Return the wanted matrices of a file of version 7.3, whose arrays are written column by column."""
    try:
        import h5py
    except ImportError as problem:
        raise UsageError(
            "expected the package h5py to read a MATLAB file of version 7.3, got none. "
            "Install it: pip install 'vibroimpact[hdf5]', or save the file with -v7."
        ) from problem
    with h5py.File(io.BytesIO(content), "r") as file:
        names = [name for name in file if isinstance(file.get(name, getlink=True), h5py.HardLink)]
        if len(names) > _MOST_OBJECTS:
            raise UsageError(f"expected at most {_MOST_OBJECTS} variables, got {len(names)}.")
        chosen = wanted.among(name for name in names if _holds_matrix(file[name]))
        return {role: _matrix(file[name]) for role, name in chosen.items()}


def _holds_matrix(item: Any) -> bool:
    """Return whether a variable is a matrix in the file itself."""
    import h5py

    return _SPARSE in item.attrs if isinstance(item, h5py.Group) else _is_inside(item) and item.ndim == 2


def _is_inside(item: Any) -> bool:
    """Return whether a dataset has its numbers in the file itself."""
    import h5py

    return (
        isinstance(item, h5py.Dataset)
        and not item.external
        and not item.is_virtual
        and item.shape is not None
    )


def _matrix(item: Any) -> Any:
    """Return a full or sparse matrix."""
    from scipy.sparse import csc_array

    if _SPARSE not in item.attrs:
        if math.prod(item.shape) > MOST_ENTRIES:
            raise UsageError(f"expected at most {MOST_ENTRIES} entries, got {math.prod(item.shape)}.")
        return np.asarray(item[()]).T
    rows, parts = int(item.attrs[_SPARSE]), []
    for name in ("data", "ir", "jc"):
        part = item.get(name)
        if part is None and name != "jc":  # MATLAB leaves out what is empty
            parts.append(np.zeros(0))
        elif not _is_inside(part) or part.size > MOST_ENTRIES:
            raise UsageError(f"expected at most {MOST_ENTRIES} entries in the file itself, got others.")
        else:
            parts.append(np.asarray(part[()]).ravel())
    data, places, starts = parts
    shape = rows, len(starts) - 1
    return csc_array((data, places.astype(np.int64), starts.astype(np.int64)), shape=shape)

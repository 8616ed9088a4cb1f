"""MATLAB files up to version 7, read with scipy: vectors of numbers, also in structures.

scipy's reader is compiled and can crash on damaged bytes, in the process that `reading` asks. Version 7.3 is HDF5, see
`hdf5`.
"""

from __future__ import annotations

import math
import os
import re
from typing import Any

import numpy as np

from vibroimpact.fmus.errors import DatasetError
from vibroimpact.hardware.formats.arrays import Scope, tables_of
from vibroimpact.hardware.formats.probe import one_refusal
from vibroimpact.hardware.formats.table import MOST_SAMPLES, RawFile

_CREATED = re.compile(r"Created on: (?P<date>.{5,40})")
NUMERIC = frozenset(
    {"double", "single", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64"}
    | {"logical"}
)
_READ = NUMERIC | {"struct"}
_DEEPEST = 8


def read_mat(path: os.PathLike[str] | str) -> RawFile:
    """Read a MATLAB file of version 4 to 7: its numeric arrays, and those in its structures by dotted names.

    A vector of instants (`t`, `time`) beside others makes them channels; `fs` or `dt` gives their rate.

    Raises
    ------
    DatasetError
        The file is damaged, or has no arrays of numbers.
    """
    from scipy.io import loadmat, whosmat

    with one_refusal("a whole MATLAB file"):
        listed = whosmat(path)
        _check_sizes(listed)
        chosen = [name for name, _, kind in listed if kind in _READ]
        contents = loadmat(path, variable_names=chosen, squeeze_me=False)
    remarks = [
        f"{name}: a {kind} array is left out; vectors of numbers are read"
        for name, _, kind in listed
        if kind not in _READ
    ]
    scopes = [Scope()]
    for name in chosen:
        _put(name, contents.get(name), scopes[0], scopes, remarks)
    tables, more = tables_of(scopes)
    attrs = {}
    created = _CREATED.search(contents.get("__header__", b"").decode("latin-1"))
    if created is not None:
        attrs["source_date"] = created["date"].strip()
    return RawFile("MATLAB", tables, remarks + more, attrs)


def _check_sizes(listed: list[tuple[str, tuple[int, ...], str]]) -> None:
    total = sum(math.prod(int(size) for size in shape) for _, shape, _ in listed)
    if total > MOST_SAMPLES:
        raise DatasetError(f"expected at most {MOST_SAMPLES} numbers, got {total}. Save fewer variables.")


def _put(name: str, value: Any, scope: Scope, scopes: list[Scope], remarks: list[str]) -> None:
    """Put a variable or field where it belongs: its numbers into its structure, a structure among the structures."""
    label = scope.dotted(name)
    if not isinstance(value, np.ndarray) or (value.dtype.kind not in "fiub" and value.dtype.names is None):
        remarks.append(f"{label}: holds no real numbers and is left out")
    elif value.dtype.names is None:
        scope.arrays[name] = value
    elif value.size != 1:
        remarks.append(
            f"{label}: a structure array of {value.size} elements is left out; single ones are read"
        )
    elif label.count(".") >= _DEEPEST:
        remarks.append(f"{label}: a structure within {_DEEPEST} others is left out")
    else:
        inner = scope.within(name)
        scopes.append(inner)
        for part in value.dtype.names:
            _put(part, value.ravel()[0][part], inner, scopes, remarks)

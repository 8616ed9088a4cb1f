"""HDF5 files, read with h5py: datasets of numbers in groups, and MATLAB files of version 7.3.

A file may name other files in links, in external storage and in virtual datasets: none of them is followed. h5py is
compiled and can crash on damaged bytes; it runs in the process of `reading`.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

import numpy as np

from vibroimpact.fmus.errors import DatasetError
from vibroimpact.hardware.formats.arrays import INTERVALS, RATES, Scope, tables_of
from vibroimpact.hardware.formats.mat import NUMERIC
from vibroimpact.hardware.formats.probe import missing_extra, one_refusal
from vibroimpact.hardware.formats.table import MOST_SAMPLES, RawFile

SIGNATURE = b"\x89HDF\r\n\x1a\n"
_UNITS = ("units", "unit")
_CLASS = "MATLAB_class"
_SPARSE = "MATLAB_sparse"
"""Attribute of a MATLAB group with the values, rows and columns of a sparse matrix."""
_DEEPEST = 16
_MOST_OBJECTS = 10_000
# MATLAB keeps the targets of its cells, and objects of its classes, in groups of these names
_OF_MATLAB = frozenset({"#refs#", "#subsystem#"})


def is_h5py_there() -> bool:
    """Whether HDF5 files other than NetCDF can be read."""
    try:
        import h5py  # noqa: F401
    except ImportError:
        return False
    return True


def is_netcdf4(path: os.PathLike[str] | str) -> bool:
    """Whether a NetCDF library wrote an HDF5 file, or the file has dimensions like NetCDF."""
    import h5py

    with one_refusal("a whole HDF5 file"), h5py.File(path, "r") as file:
        return bool(_text(file.attrs.get("_NCProperties"))) or any(
            _text(item.attrs.get("CLASS")) == "DIMENSION_SCALE" for _, item in _items(file, [], Scope())
        )


def read_hdf5(path: os.PathLike[str] | str, matlab: bool = False) -> RawFile:
    """Return the numeric datasets of an HDF5 file, by the dotted names of their groups.

    In a MATLAB file of version 7.3 the dimensions are transposed, and groups are structures. DatasetError: h5py is not
    installed, or the file is damaged or declares too much.
    """
    what = "a MATLAB file of version 7.3" if matlab else "an HDF5 file"
    try:
        import h5py
    except ImportError as problem:
        raise missing_extra(what, "h5py", "hdf5") from problem
    remarks: list[str] = []
    scopes = [Scope()]
    with one_refusal(f"{what} that is whole"), h5py.File(path, "r") as file:
        _read_group(file, scopes[0], scopes, remarks, matlab)
    tables, more = tables_of(scopes)
    return RawFile("MATLAB 7.3" if matlab else "HDF5", tables, remarks + more)


def _read_group(group: Any, scope: Scope, scopes: list[Scope], remarks: list[str], matlab: bool) -> None:
    """Read the datasets of a group, and of its inner groups."""
    import h5py

    _read_rate(group, scope)
    for name, item in _items(group, remarks, scope):
        label = scope.dotted(name)
        if matlab and not scope.path and name in _OF_MATLAB:
            continue
        if isinstance(item, h5py.Dataset):
            why = _why_not(item, matlab)
            if why:
                remarks.append(f"{label}: {why}")
            else:
                _read_dataset(name, item, scope, scopes, matlab)
        elif matlab and _SPARSE in item.attrs:
            remarks.append(f"{label}: a sparse matrix is left out; save full({name})")
        elif label.count(".") >= _DEEPEST or len(scopes) > _MOST_OBJECTS:
            remarks.append(f"{label}: a group within {_DEEPEST} others is left out")
        elif isinstance(item, h5py.Group) and not _is_around(item, group):
            scopes.append(scope.within(name))
            _read_group(item, scopes[-1], scopes, remarks, matlab)
        else:
            remarks.append(f"{label}: is left out; datasets of numbers are read")


def _items(group: Any, remarks: list[str], scope: Scope) -> Iterator[tuple[str, Any]]:
    """Yield the contents of a group; links to other places are not followed."""
    import h5py

    for name in group:
        if isinstance(group.get(name, getlink=True), h5py.HardLink):
            yield name, group[name]
        else:
            remarks.append(f"{scope.dotted(name)}: a link to elsewhere is left out")


def _is_around(item: Any, group: Any) -> bool:
    """Whether a group encloses another one: a file may lead in circles."""
    while True:
        if item == group:
            return True
        if group.name == "/":
            return False
        group = group.parent


def _why_not(item: Any, matlab: bool) -> str:
    """Return the reason for leaving out a dataset; empty for a readable one."""
    if item.external or item.is_virtual:
        return "its values are in another file, it is left out"
    kind = _text(item.attrs.get(_CLASS)) if matlab else ""
    if item.dtype.kind not in "fiub" or (kind and kind not in NUMERIC):
        return f"its values are {kind or item.dtype}, it is left out; numbers are read"
    if item.shape is None or "MATLAB_empty" in item.attrs:
        return "holds no numbers and is left out"
    if item.ndim > 2:
        return f"an array of {item.ndim} dimensions is left out; vectors are read"
    return ""


def _read_dataset(name: str, item: Any, scope: Scope, scopes: list[Scope], matlab: bool) -> None:
    """Read the values of a dataset; a rate of its own makes it a structure of its own."""
    scopes[0].numbers += item.size
    if scopes[0].numbers > MOST_SAMPLES:
        raise DatasetError(f"expected at most {MOST_SAMPLES} numbers, got more. Save fewer datasets.")
    own = Scope(scope.path, around=scope)
    _read_rate(item, own)
    target = scope
    if own.rate is not None and own.rate != scope.rate:
        scopes.append(own)
        target = own
    values = np.asarray(item[()], dtype=np.float64)
    target.arrays[name] = np.atleast_1d(values.T if matlab else values)
    unit = next((_text(item.attrs[key]) for key in item.attrs if key.lower() in _UNITS), "")
    if unit:
        target.units[name] = unit


def _read_rate(item: Any, scope: Scope) -> None:
    """Take the rate from the attributes of a group or dataset, if they give one."""
    for key in item.attrs:
        if key.lower() in RATES | INTERVALS:
            value = np.asarray(item.attrs[key])
            if value.size == 1 and value.dtype.kind in "fiu" and 0.0 < float(value.ravel()[0]) < np.inf:
                number = float(value.ravel()[0])
                scope.rate = number if key.lower() in RATES else 1.0 / number


def _text(value: Any) -> str:
    """Return an attribute as text; empty for another type."""
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    return value if isinstance(value, str) else ""

"""MATLAB files up to version 7 (`save -v7`), read with scipy: vectors of numbers.

scipy's reader is compiled and can crash on damaged bytes, so that another process reads the file first.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from vibroimpact.analysis.probing import Reading
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.hardware.importers.cells import sorted_out
from vibroimpact.hardware.importers.labels import is_time_name
from vibroimpact.hardware.importers.probe import UnreadableError, check_reads
from vibroimpact.hardware.importers.table import MOST_COLUMNS, MOST_SAMPLES, Column, RawFile, Table

_RATES = frozenset(
    {"fs", "samplerate", "sample_rate", "sampling_rate", "samplingrate", "samplingfrequency"}
    | {"sampling_frequency"}
)
_INTERVALS = frozenset({"dt", "ts", "deltat", "delta_t", "sampling_interval", "samplinginterval"})
_CREATED = re.compile(r"Created on: (?P<date>.{5,40})")
_CLASSES = frozenset(
    {"double", "single", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64"}
    | {"logical"}
)


_READING = Reading("MATLAB", tuple(sorted(_CLASSES)))


def read_mat(path: os.PathLike[str] | str) -> RawFile:
    """Read a MATLAB file of version 4 to 7: its numeric arrays.

    A vector of instants (`t`, `time`) beside others makes them channels; `fs` or `dt` gives their rate.

    Raises
    ------
    DatasetError
        The file is damaged, is version 7.3 (HDF5), or has no arrays of numbers.
    """
    from scipy.io import loadmat, whosmat

    try:
        check_reads(path, _READING)
        listed = whosmat(path)
        _check_sizes(listed)
        numeric = [name for name, _, kind in listed if kind in _CLASSES]
        contents = loadmat(path, variable_names=numeric, squeeze_me=False)
    except UnreadableError as problem:
        if problem.raised != "NotImplementedError":
            raise
        raise DatasetError(
            "expected a MATLAB file up to version 7, got version 7.3. Save it with `save(..., '-v7')`."
        ) from problem
    except DatasetError:
        raise
    # damaged bytes lead scipy to errors of every kind, MemoryError too
    except Exception as problem:
        raise DatasetError(
            f"expected a whole MATLAB file, got one that cannot be read ({type(problem).__name__}: {problem})."
        ) from problem
    remarks = [
        f"{name}: a {kind} array is left out; vectors of numbers are read"
        for name, _, kind in listed
        if kind not in _CLASSES
    ]
    return _sorted_out(contents, numeric, remarks)


def _check_sizes(listed: list[tuple[str, tuple[int, ...], str]]) -> None:
    total = sum(math.prod(int(size) for size in shape) for _, shape, _ in listed)
    if total > MOST_SAMPLES:
        raise DatasetError(f"expected at most {MOST_SAMPLES} numbers, got {total}. Save fewer variables.")


def _sorted_out(contents: Mapping[str, Any], names: list[str], remarks: list[str]) -> RawFile:
    columns: list[Column] = []
    time: Column | None = None
    rate: float | None = None
    for name in names:
        values = contents.get(name)
        if (
            values is None
            or not isinstance(values, np.ndarray)
            or values.dtype.kind not in "fiub"
            or not values.size
        ):
            remarks.append(f"{name}: holds no real numbers and is left out")
        elif values.size == 1 and name.lower() in _RATES | _INTERVALS:
            number = float(values.ravel()[0])
            rate = number if name.lower() in _RATES else (1.0 / number if number else None)
        elif is_time_name(name) and values.size == max(values.shape) and values.size > 1:
            time = _column(name, values.ravel(), "s")
        else:
            columns += _columns(name, values, remarks)
    if len(columns) > MOST_COLUMNS:
        raise DatasetError(f"expected at most {MOST_COLUMNS} columns, got {len(columns)}.")
    if time is not None and not columns:
        columns, time = [time], None
    attrs = {}
    created = _CREATED.search(contents.get("__header__", b"").decode("latin-1"))
    if created is not None:
        attrs["source_date"] = created["date"].strip()
    if rate is not None and not 0.0 < rate < np.inf:
        remarks.append(f"the sampling rate of the file, {rate}, is left out")
        rate = None
    return RawFile("MATLAB", [Table(columns, time, vectors=True)] if columns else [], remarks, attrs, rate)


def _columns(name: str, values: Any, remarks: list[str]) -> list[Column]:
    """Return the columns of an array; a row vector is a column too."""
    if values.ndim > 2:
        remarks.append(f"{name}: an array of {values.ndim} dimensions is left out; vectors are read")
        return []
    if min(values.shape) == 1:
        return [_column(name, values.ravel())]
    if values.shape[0] < values.shape[1]:
        remarks.append(f"{name}: {values.shape[0]} rows of {values.shape[1]} are taken as the channels")
        values = values.T
    return [_column(f"{name}_{place + 1}", values[:, place]) for place in range(values.shape[1])]


def _column(name: str, values: Any, unit: str = "") -> Column:
    numbers = sorted_out(np.array(values, dtype=np.float64))
    return Column(name, numbers.values, unit, numbers.overrange)

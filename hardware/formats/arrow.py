"""Parquet and Feather files, read with pyarrow: columns of numbers and of dates.

pyarrow is compiled and can crash on damaged bytes; it runs in the process of `reading`.
"""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from vibroimpact.fmus.errors import DatasetError
from vibroimpact.hardware.formats.cells import column_of
from vibroimpact.hardware.formats.clock_columns import with_time
from vibroimpact.hardware.formats.labels import split_label
from vibroimpact.hardware.formats.probe import missing_extra, one_refusal
from vibroimpact.hardware.formats.table import MOST_COLUMNS, MOST_SAMPLES, Column, RawFile, Table

PARQUET, FEATHER = b"PAR1", b"ARROW1"
_OLD_FEATHER = b"FEA1"
SIGNATURES = (PARQUET, FEATHER, _OLD_FEATHER)


def read_arrow(path: os.PathLike[str] | str) -> RawFile:
    """Return the numbers of a Parquet or Feather file as columns; a column of dates has the instants.

    DatasetError: pyarrow is not installed, or the file is damaged, too large, or of the first version of Feather.
    """
    with open(path, "rb") as stream:
        start = stream.read(len(FEATHER))
    kind = "Parquet" if start.startswith(PARQUET) else "Feather"
    if start.startswith(_OLD_FEATHER):
        raise DatasetError(
            "expected a Feather file of version 2, got version 1. Save it again, or as Parquet."
        )
    try:
        import pyarrow  # noqa: F401
    except ImportError as problem:
        raise missing_extra(f"a {kind} file", "pyarrow", "parquet") from problem
    with one_refusal(f"a whole {kind} file"):
        table, remarks = _table_of(path, kind)
    columns = [
        _column(str(name), values) for name, values in zip(table.column_names, table.columns, strict=True)
    ]
    return RawFile(kind, [with_time(Table(columns))] if columns else [], remarks)


def _table_of(path: os.PathLike[str] | str, kind: str) -> tuple[Any, list[str]]:
    """Return the columns of numbers and dates, if they are not too many, and remarks on the others."""
    import pyarrow.ipc
    import pyarrow.parquet

    if kind == "Parquet":
        # pages may carry a CRC-32, which the library checks only on request
        with pyarrow.parquet.ParquetFile(path, memory_map=False, page_checksum_verification=True) as file:
            names, remarks = _chosen(file.schema_arrow)
            _check_size(file.metadata.num_rows, len(names))
            return file.read(columns=names, use_threads=False), remarks
    with pyarrow.ipc.open_file(pyarrow.OSFile(os.fspath(path))) as file:
        schema = file.schema
    names, remarks = _chosen(schema)
    if not names:  # an empty selection would mean all fields
        return pyarrow.table({}), remarks
    options = pyarrow.ipc.IpcReadOptions(included_fields=[schema.get_field_index(name) for name in names])
    with pyarrow.ipc.open_file(pyarrow.OSFile(os.fspath(path)), options=options) as file:
        rows, batches = 0, []
        for at in range(file.num_record_batches):
            batches.append(file.get_batch(at))
            rows += batches[-1].num_rows
            _check_size(rows, len(names))
        return pyarrow.Table.from_batches(batches, file.schema), remarks


def _chosen(schema: Any) -> tuple[list[str], list[str]]:
    """Return the names of the columns of numbers and dates, and remarks on the others."""
    from pyarrow import types

    names, remarks = [], []
    for name in dict.fromkeys(schema.names):
        at = schema.get_all_field_indices(name)
        kind = schema.field(at[0]).type
        tests = (types.is_integer, types.is_floating, types.is_boolean, types.is_timestamp)
        if len(at) > 1:
            remarks.append(f"{name}: {len(at)} columns have this name, they are left out")
        elif any(test(kind) for test in tests):
            names.append(name)
        else:
            remarks.append(f"{name}: its values are {kind}, it is left out; numbers are read")
    return names, remarks


def _check_size(rows: int, columns: int) -> None:
    if rows * columns > MOST_SAMPLES or columns > MOST_COLUMNS:
        raise DatasetError(
            f"expected at most {MOST_SAMPLES} numbers in {MOST_COLUMNS} columns, got {rows} rows of {columns}."
        )


def _column(name: str, values: Any) -> Column:
    """Return a column of numbers, or of dates as seconds after the first."""
    import pyarrow as pa
    import pyarrow.compute

    label, unit = split_label(name)
    if pa.types.is_timestamp(values.type):
        per_second = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}[values.type.unit]
        stamps = values.cast(pa.int64())
        first = next(iter(stamps.drop_null()[:1].to_pylist()), 0)
        later = pyarrow.compute.subtract(stamps, first).to_numpy()
        return Column(label or name, later / per_second, "s", dated=True)
    if pa.types.is_boolean(values.type):
        values = values.cast(pa.uint8())
    return column_of(label or name, np.array(values.to_numpy(), dtype=np.float64), unit)

"""Parquet and Feather files, read with pyarrow: columns of numbers and of dates.

pyarrow is compiled and can crash on damaged bytes, so that another process reads the file first.
"""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from vibroimpact.analysis.probing import Reading
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.hardware.importers.cells import sorted_out
from vibroimpact.hardware.importers.extras import missing_extra
from vibroimpact.hardware.importers.labels import split_label
from vibroimpact.hardware.importers.probe import check_reads
from vibroimpact.hardware.importers.table import MOST_COLUMNS, MOST_SAMPLES, Column, RawFile, Table
from vibroimpact.hardware.importers.text import with_time

PARQUET, FEATHER = b"PAR1", b"ARROW1"
_OLD_FEATHER = b"FEA1"
SIGNATURES = (PARQUET, FEATHER, _OLD_FEATHER)


def read_arrow(path: os.PathLike[str] | str) -> RawFile:
    """Read a Parquet or Feather file: its columns of numbers, one of dates as instants.

    Raises
    ------
    DatasetError
        pyarrow is not installed, the file is damaged, of the first version of Feather, or too large.
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
    check_reads(path, Reading(kind))
    try:
        table = _table_of(path, kind)
    except DatasetError:
        raise
    # the library reports damage as errors of every kind, MemoryError too
    except Exception as problem:
        raise DatasetError(
            f"expected a whole {kind} file, got one that cannot be read ({type(problem).__name__}: {problem})."
        ) from problem
    columns, remarks = [], []
    for name, values in zip(table.column_names, table.columns, strict=True):
        column = _column(str(name), values)
        if isinstance(column, Column):
            columns.append(column)
        else:
            remarks.append(column)
    return RawFile(kind, [with_time(Table(columns))] if columns else [], remarks)


def _table_of(path: os.PathLike[str] | str, kind: str) -> Any:
    """Return the table of a file that is not too large for a recording."""
    import pyarrow.ipc
    import pyarrow.parquet

    if kind == "Parquet":
        with pyarrow.parquet.ParquetFile(path, memory_map=False) as file:
            _check_size(file.metadata.num_rows, file.metadata.num_columns)
            return file.read(use_threads=False)
    with pyarrow.ipc.open_file(pyarrow.OSFile(os.fspath(path))) as file:
        _check_size(
            sum(file.get_batch(at).num_rows for at in range(file.num_record_batches)), len(file.schema)
        )
        return file.read_all()


def _check_size(rows: int, columns: int) -> None:
    if rows * columns > MOST_SAMPLES or columns > MOST_COLUMNS:
        raise DatasetError(
            f"expected at most {MOST_SAMPLES} numbers in {MOST_COLUMNS} columns, got {rows} rows of {columns}."
        )


def _column(name: str, values: Any) -> Column | str:
    """Return a column of numbers or dates; of another kind, what is to be said of it."""
    import pyarrow as pa

    label, unit = split_label(name)
    if pa.types.is_timestamp(values.type):
        stamps = values.cast(pa.int64()).to_numpy()
        per_second = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}[values.type.unit]
        known = np.isfinite(stamps) if stamps.dtype.kind == "f" else np.ones(len(stamps), dtype=bool)
        first = stamps[known][0] if np.any(known) else 0
        return Column(label or name, (stamps - first) / per_second, "s", attrs={"time": 1})
    if pa.types.is_boolean(values.type):
        values = values.cast(pa.uint8())
    if not (pa.types.is_integer(values.type) or pa.types.is_floating(values.type)):
        return f"{name}: its values are {values.type}, it is left out; numbers are read"
    numbers = sorted_out(np.array(values.to_numpy(), dtype=np.float64))
    return Column(label or name, numbers.values, unit, numbers.overrange)

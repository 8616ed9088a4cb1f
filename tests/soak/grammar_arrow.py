"""Parquet and Feather files of drawn columns, types and packing: read equal; odd and damaged ones: read or refused.

Parquet may have a CRC-32 of each page: a file damaged within such pages is refused or read equal.
"""

from __future__ import annotations

import random
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from pyarrow import feather, parquet

from soak import _drawn_files as files

CASES, SAMPLE, SECONDS = files.CASES, files.SAMPLE, files.SECONDS

TYPES = ("f8", "f8", "f4", "i2", "i4", "u1", "i8")
SINCE = np.datetime64("2026-07-30T10:00:00", "ns")
FOOTER = 12
"""Bytes at the end of a Parquet file: the length of its description, and its mark."""


def drawn_table(draw: random.Random) -> tuple[pa.Table, files.Truth]:
    """Return a table, and its expected reading."""
    signals = files.drawn_signals(draw)
    headings = [
        f"{name} [{unit}]" if unit else name for name, unit in zip(signals.names, signals.units, strict=True)
    ]
    columns: dict[str, Any] = {}
    if draw.random() < 0.3:
        stamps = SINCE + np.round(1e9 * signals.instants).astype("timedelta64[ns]")
        columns["when"] = (
            pa.array(stamps).cast(pa.timestamp(draw.choice(("ns", "us"))))
            if signals.interval != 1.0 / 1024.0
            else stamps
        )
        start = 0.0
    else:
        columns["time (s)"], start = signals.instants, signals.start
    values = []
    for heading, one in zip(headings, signals.values, strict=True):
        known = _as(draw.choice(TYPES), one)
        missing = np.zeros(len(known), dtype=bool)
        if draw.random() < 0.2:
            missing[4:6] = True
        columns[heading] = pa.array(known, mask=missing)
        values.append(np.where(missing, np.nan, known.astype(np.float64)))
    if draw.random() < 0.2:
        columns["words"] = pa.array(["word"] * signals.count).dictionary_encode()
    truth = files.Truth(values, files.truth_of(signals).units, signals.interval, start, signals.names)
    return pa.table(columns), truth


def _as(kind: str, values: files.Floats) -> Any:
    if kind[0] == "f":
        return values.astype(kind)
    limits = np.iinfo(kind)
    return np.clip(np.round(values / np.abs(values).max() * 200.0), limits.min, limits.max).astype(kind)


def _write(draw: random.Random, table: pa.Table, path: Path, *, summed: bool = False) -> None:
    if path.suffix == ".feather":
        packing = draw.choice(("lz4", "zstd", "uncompressed"))
        feather.write_feather(table, path, compression=packing, chunksize=draw.choice((7, 1000)))
        return
    packing = draw.choice(("snappy", "gzip", "zstd", "none"))
    parquet.write_table(
        table,
        path,
        compression=packing,
        row_group_size=draw.choice((7, 1000)),
        use_dictionary=draw.random() < 0.5,
        write_page_checksum=summed or draw.random() < 0.3,
        data_page_version=draw.choice(("1.0", "2.0")),
    )


def _odd(draw: random.Random) -> pa.Table:
    """Return a table with names and types unfit for a recording."""
    rows = draw.choice((0, 1, 2, 30))
    arrays, names = [], []
    for _ in range(draw.randint(0, 6)):
        kind = draw.choice(
            (
                pa.float64(),
                pa.float16(),
                pa.string(),
                pa.decimal128(5, 2),
                pa.list_(pa.float64()),
                pa.bool_(),
                pa.null(),
                pa.uint64(),
                pa.date32(),
                pa.time64("ns"),
                pa.duration("s"),
                pa.struct([("a", pa.int8())]),
                pa.timestamp("s"),
            )
        )
        content: list[Any] = [None] * rows
        numbers = [draw.choice(files.FRACTIONS) for _ in range(rows)]
        with suppress(
            pa.ArrowException, TypeError, ValueError, OverflowError
        ):  # the library refuses some of them
            arrays.append(pa.array(numbers, type=kind))
            names.append(files.word(draw, "time", "a", "t"))
            continue
        arrays.append(pa.array(content, type=kind))
        names.append(files.word(draw, "time", "a", "t"))
    return pa.Table.from_arrays(arrays, names=names).replace_schema_metadata({"k": files.word(draw)})


def check(seed: int) -> str | None:
    """Read one file."""
    draw = random.Random(seed)
    path, kind = Path(draw.choice(("record.parquet", "record.feather"))), draw.random()
    if kind < 0.25:
        try:
            _write(draw, _odd(draw), path)
        except (pa.ArrowException, ValueError, OverflowError):
            return None  # the library itself refuses the table
        return files.odd(path, crashes=True)
    table, truth = drawn_table(draw)
    summed = path.suffix == ".parquet" and kind >= 0.8
    _write(draw, table, path, summed=summed)
    if kind < 0.6:
        return files.sound(path, truth)
    content = path.read_bytes()
    if summed:
        pages = len(content) - FOOTER - int.from_bytes(content[-8:-4], "little")
        path.write_bytes(files.flipped(draw, content[:pages]) + content[pages:])
        return files.odd(path, equal=truth, crashes=True)
    path.write_bytes(files.damaged(draw, content))
    return files.odd(path, crashes=True)

"""Reads a file of any format in a process of its own, so that its bytes can harm no other process.

The process has limits of time and memory, writes nothing and has no network (`fmus.confinement`).
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.fmus.reader_process import Answer, Order, read_apart
from vibroimpact.hardware.formats import arrow, hdf5, labview, uff, wav
from vibroimpact.hardware.formats.crossing import unpacked, unpacked_datasets
from vibroimpact.hardware.formats.table import RawFile

SECONDS, RATE = 10.0, 2.5e5
"""Limit of the processor time: a constant, s, plus the size of the file over a rate, bytes/s.

The slowest files, texts with cells that are no numbers, are read at some 2e6 bytes/s.
"""
MEMORY, PER_BYTE = 4 << 30, 128
"""Limit of the memory, bytes: a constant for the expansion of small files, plus this many per byte of the file.

A text of one digit a row takes 125 bytes per byte.
"""
_MOST_BYTES = 1 << 32
_READER = "vibroimpact.hardware.formats.reading_child:read"
_READER_OF_DATASETS = "vibroimpact.hardware.formats.reading_child:read_datasets"
Found = TypeVar("Found")
_LONGEST_REASON = 300
_KINDS: tuple[tuple[tuple[bytes, ...], str, tuple[str, ...]], ...] = (
    ((b"TDSm", b"TDSh"), "TDMS", ("nptdms",)),
    ((b"MATLAB 7.3",), "MATLAB", ("h5py",)),
    ((b"MATLAB",), "MATLAB", ("scipy.io",)),
    ((hdf5.SIGNATURE,), "HDF5", ("netCDF4", "h5py")),
    ((b"CDF",), "NetCDF", ("scipy.io",)),
    (wav.SIGNATURES, "WAV", ("scipy.io.wavfile",)),
    (arrow.SIGNATURES, "Parquet or Feather", ("pyarrow.parquet", "pyarrow.ipc")),
    ((labview.SIGNATURE.encode(),), "LabVIEW", ()),
)
"""First bytes of a file, its name in messages, and the modules that read it."""


def read_file(path: Path, **options: Any) -> RawFile:
    """Return the content of a file from `choosing.read_raw`, run in a process of its own.

    Parameters
    ----------
    path : Path
        A file that `check_file` has passed.
    **options
        Options of `read_raw`, as JSON values.

    Raises
    ------
    DatasetError, UsageError
        As in `read_raw`; also if the file crashes its library, or is not read within the limits.
    """
    return _read_apart(path, _READER, options, unpacked)


def read_datasets_apart(path: Path, kinds: frozenset[int]) -> tuple[list[int], list[dict[str, Any]], bool]:
    """Return the content of a universal file from `uff.read_datasets`, run in another process.

    Errors are as in `read_file`.
    """
    return _read_apart(path, _READER_OF_DATASETS, {"wanted": sorted(kinds)}, unpacked_datasets)


def _read_apart(
    path: Path, reader: str, options: Mapping[str, Any], taken: Callable[[Any, Sequence[bytearray]], Found]
) -> Found:
    """Return a reader's result for a file, from the facts and buffers of its answer."""
    size = path.stat().st_size
    kind, libraries = _kind_of(path)
    seconds = SECONDS + size / RATE
    order = Order(
        reader,
        os.path.abspath(path),
        options,
        seconds,
        MEMORY + PER_BYTE * size,
        _MOST_BYTES,
        libraries,
    )
    answer = read_apart(order)
    if answer.verdict == "raised":
        raise _error_of(answer, kind)
    if answer.verdict == "read":
        try:
            return taken(answer.facts, answer.buffers)
        except (ValueError, TypeError, KeyError, IndexError) as problem:
            raise DatasetError(
                f"expected a whole {kind} file, got one that its library misreads."
            ) from problem
    raise DatasetError(f"expected a whole {kind} file, got {answer.why(seconds)[:_LONGEST_REASON]}.")


def _kind_of(path: Path) -> tuple[str, tuple[str, ...]]:
    """Return a file's name in messages, by its first bytes, and the modules that read it."""
    with path.open("rb") as file:
        start = file.read(512)
    if uff.is_uff(start):
        return "universal", ("pyuff",)
    if path.suffix.lower() == ".mat" and not start.startswith(hdf5.SIGNATURE):
        return "MATLAB", ("scipy.io",)
    found = ((kind, libraries) for first, kind, libraries in _KINDS if start.startswith(first))
    return next(found, ("text", ()))


def _error_of(answer: Answer, kind: str) -> Exception:
    """Return the error of the reading process; an unexpected one is an effect of the file."""
    for known in (DatasetError, UsageError):
        if answer.error == known.__name__:
            return known(answer.text)
    if answer.error == "MemoryError":
        return MemoryError(answer.text)
    if answer.raised is not None:
        return answer.raised
    got = f"{answer.error}: {answer.text}".rstrip(": ")[:_LONGEST_REASON]
    return DatasetError(
        f"expected a whole {kind} file, got one that cannot be read ({got}). "
        "Report it where another program reads it."
    )

"""MATLAB files up to version 7, read with scipy: vectors of numbers, also in structures.

scipy's reader is compiled and can crash on damaged bytes; it runs in the process of `reading`. Version 7.3 is HDF5,
see `hdf5`.
"""

from __future__ import annotations

import math
import os
import re
import struct
import zlib
from collections.abc import Iterator
from typing import Any, BinaryIO

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
_MOST_FIELDS = 10_000
"""Most fields of one structure: scipy compares all pairs of names, in .2 s for this number and 40 s for 16 MiB."""
_HEADER, _TAG, _BEGINNING = 128, 8, 256
_MATRIX, _COMPRESSED = 14, 15
_CELL, _STRUCTURE, _OBJECT = 1, 2, 3
"""Classes of arrays that hold other arrays."""


def read_mat(path: os.PathLike[str] | str) -> RawFile:
    """Return the numeric arrays of a MATLAB file of version 4 to 7, and those in its structures by dotted names.

    A vector of instants (`t`, `time`) makes other vectors channels; `fs` or `dt` gives their rate. DatasetError: the
    file is damaged, or has no arrays of numbers.
    """
    from scipy.io import loadmat, whosmat

    with one_refusal("a whole MATLAB file"), open(path, "rb") as file:
        _check_fields(file)
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


def _check_fields(file: BinaryIO) -> None:
    """Raise DatasetError for a structure with too many fields; scipy handles other versions and damage."""
    order = {b"IM": "<", b"MI": ">"}.get(file.read(_HEADER)[-2:])
    if order is None:
        return
    try:
        for matrix in _holders(file, order):
            _check_fields_within(memoryview(matrix), order)
    except (struct.error, zlib.error, IndexError, ZeroDivisionError):
        return


def _holders(file: BinaryIO, order: str) -> Iterator[bytes]:
    """Yield the variables of a file that hold other arrays, without their tags; of others only the start is read."""
    while len(tag := file.read(_TAG)) == _TAG:
        kind, size = struct.unpack(f"{order}II", tag)
        following = file.tell() + size
        head = file.read(min(size, _BEGINNING))
        packed = kind == _COMPRESSED
        start = zlib.decompressobj().decompress(head, 3 * _TAG) if packed else tag + head
        if (packed or kind == _MATRIX) and _class_of(memoryview(start), order):
            content = head + file.read(size - len(head))
            yield zlib.decompress(content)[_TAG:] if packed else content
        file.seek(following)


def _class_of(matrix: memoryview, order: str) -> int:
    """Return the class of an array that holds others, from its tag on; 0 for any other."""
    found: int = struct.unpack_from(f"{order}I", matrix, 2 * _TAG)[0] & 0xFF
    return found if found in (_CELL, _STRUCTURE, _OBJECT) else 0


def _check_fields_within(matrix: memoryview, order: str) -> None:
    left = [matrix]
    while left:
        inside = left.pop()
        held = inside[_TAG] if order == "<" else inside[_TAG + 3]
        place = _after(inside, _after(inside, 2 * _TAG, order), order)  # dimensions, name
        if held == _OBJECT:
            place = _after(inside, place, order)
        if held != _CELL:
            after = _after(inside, place, order)
            at = after - (4 if after == place + _TAG else _TAG)  # a small element has its number in its tag
            (longest,) = struct.unpack_from(f"{order}I", inside, at)
            place = after
            many = _size_of(inside, place, order) // longest
            if many > _MOST_FIELDS:
                raise DatasetError(
                    f"expected at most {_MOST_FIELDS} fields of a structure, got {many}. Save fewer."
                )
            place = _after(inside, place, order)
        while place + 3 * _TAG <= len(inside):
            after = _after(inside, place, order)
            if _class_of(inside[place : place + 3 * _TAG], order):
                left.append(inside[place + _TAG : after])
            place = after


def _size_of(inside: memoryview, place: int, order: str) -> int:
    """Return the bytes of an element; a small element has them in its tag."""
    kind, size = struct.unpack_from(f"{order}II", inside, place)
    return int(kind >> 16 or size)


def _after(inside: memoryview, place: int, order: str) -> int:
    """Return the start of the next element."""
    kind, size = struct.unpack_from(f"{order}II", inside, place)
    return place + _TAG if kind >> 16 else place + _TAG + -(-size // 8) * 8


def _put(name: str, value: Any, scope: Scope, scopes: list[Scope], remarks: list[str]) -> None:
    """Put the numbers of a variable or field into its structure, and a structure among the structures."""
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

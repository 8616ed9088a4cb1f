"""The child side of `apart`: reads the matrices of a file in its own process."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.readers import (
    calculix,
    dmig,
    freedoms,
    matlab,
    matrix_market,
    npz,
    op4,
)
from vibroimpact.orchestrator.structures.readers.apart import MOST_BYTES
from vibroimpact.orchestrator.structures.readers.found import Found, packed
from vibroimpact.orchestrator.structures.readers.wanted import Wanted

_GZIP = b"\x1f\x8b"
_PACKED = ".gz"
Reader = Callable[[bytes, Wanted], Found]
FIRST_BYTES: tuple[tuple[bytes, Reader], ...] = (
    (b"%%MatrixMarket", matrix_market.read),
    (b"PK\x03\x04", npz.read),
    (b"MATLAB", matlab.read),
    (b"\x89HDF\r\n\x1a\n", matlab.read),
    *((first, op4.read) for first in op4.FIRST_BYTES),
)
SUFFIXES: Mapping[str, Reader] = {
    ".mtx": matrix_market.read,
    ".npz": npz.read,
    ".mat": matlab.read,
    ".sti": calculix.read,
    ".mas": calculix.read,
    ".op4": op4.read,
    ".pch": dmig.read,
    ".bdf": dmig.read,
    ".nas": dmig.read,
}
"""Readers by the first bytes of a file, then by the end of its name; each takes the content and the wanted matrices."""


def read(path: str, options: Mapping[str, Any]) -> tuple[dict[str, Any], list[Any]]:
    """Return the wanted matrices of a file, for another process.

    `options` has `names` and `optional` of `Wanted`.
    """
    content, name = unpacked_content(Path(path))
    wanted = Wanted(dict(options["names"]), frozenset(options["optional"]))
    return packed(reader_of(name, content)(content, wanted))


def read_freedoms(path: str, options: Mapping[str, Any]) -> tuple[dict[str, Any], list[Any]]:
    """Return the names and places of the degrees of freedom in a table or a CalculiX file, for another process."""
    content, name = unpacked_content(Path(path))
    reader = calculix.read_freedoms if name.endswith(".dof") else freedoms.read_table
    return packed(reader(content))


def read_nodes(path: str, options: Mapping[str, Any]) -> tuple[dict[str, Any], list[Any]]:
    """Return the numbers and coordinates of the nodes of a CalculiX model, for another process."""
    numbers, coordinates = calculix.read_nodes(unpacked_content(Path(path))[0])
    return {}, [numbers, coordinates]


def unpacked_content(path: Path) -> tuple[bytes, str]:
    """Return the bytes of a file, unpacked from gzip, and its name in lower case without `.gz`.

    Raises
    ------
    UsageError
        The packed file is damaged, or too large when unpacked.
    """
    content, name = path.read_bytes(), path.name.lower()
    if not content.startswith(_GZIP):
        return content, name
    try:
        return _gunzipped(content), name.removesuffix(_PACKED)
    except zlib.error as problem:
        raise UsageError(f"expected a whole gzip file, got one that is damaged ({problem}).") from problem


def _gunzipped(content: bytes) -> bytes:
    """Return the unpacked bytes of all members of a gzip file."""
    parts: list[bytes] = []
    room = MOST_BYTES
    while content.startswith(_GZIP):
        member = zlib.decompressobj(wbits=31)
        parts.append(member.decompress(content, room))
        room -= len(parts[-1])
        if not member.eof:
            got = "one that ends early" if room > 0 else f"more than {MOST_BYTES} bytes"
            raise UsageError(f"expected a whole gzip file, got {got}.")
        content = member.unused_data
    return b"".join(parts)


def reader_of(name: str, content: bytes) -> Reader:
    """Return the reader of a file by its first bytes, then by the end of its name."""
    for first, reader in FIRST_BYTES:
        if content.startswith(first):
            return reader
    reader_by_name = SUFFIXES.get(Path(name).suffix)
    if reader_by_name is None:
        raise UsageError(f"expected a file of matrices ({', '.join(SUFFIXES)}), got another kind.")
    return reader_by_name

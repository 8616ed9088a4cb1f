"""The SHA-256 at the end of every dataset file, checked before any library opens the file.

A dataset is its NetCDF-4 content, then one line of text with the SHA-256 of that content. One rename writes both, so
both are always together; a copy keeps them together. HDF5 reads its own content and ignores the line after it.
By hand: `head -c -86 dataset.nc | sha256sum` and `tail -c 86 dataset.nc` agree.

Files of version 0.1 have no such line.
"""

from __future__ import annotations

import hashlib
import os
import struct
from typing import BinaryIO

from vibroimpact.fmus.errors import DatasetError

_BEGIN, _END = b"\nvibroimpact SHA-256 ", b"\n"
_DIGITS = 2 * hashlib.sha256().digest_size
LINE_LENGTH = len(_BEGIN) + _DIGITS + len(_END)
"""Bytes after the content of a file whose SHA-256 is recorded."""

_BLOCK = 1 << 20
_SIGNATURE = b"\x89HDF\r\n\x1a\n"
# Place of the version in the superblock of an HDF5 file, and, by version, the place of the end address. HDF5 2 writes
# version 2, HDF5 1.14 version 0.
_SUPERBLOCK_VERSION = 8
_END_OF_FILE = {0: 40, 1: 44, 2: 28, 3: 28}
_HEAD = max(_END_OF_FILE.values()) + 8


def closing_line(content: bytes | memoryview) -> bytes:
    """Return the line that follows the content of a file.

    >>> closing_line(b"")[:30]
    b'\\nvibroimpact SHA-256 e3b0c4429'
    """
    return _BEGIN + hashlib.sha256(content).hexdigest().encode() + _END


def sealed(image: bytes | memoryview) -> tuple[memoryview, bytes]:
    """Return the two parts of a file: the bytes of a NetCDF-4 file made in memory, and the closing line.

    The library rounds the memory up; the excess is cut off, so that the content ends where its header says.
    """
    content = memoryview(image)[: content_length(image)]
    return content, closing_line(content)


def seal(path: str | os.PathLike[str]) -> None:
    """Append the closing line to a NetCDF-4 file on the disk; bytes after the end that its header says are cut off.

    Raises
    ------
    OSError
        When the file cannot be read or written.
    """
    with open(path, "r+b") as file:
        length = content_length(file.read(_HEAD)) or os.fstat(file.fileno()).st_size
        file.truncate(length)
        file.seek(0)
        digits = _hash_of(file, length)
        file.write(_BEGIN + digits + _END)


def content_length(head: bytes | memoryview) -> int | None:
    """Return the end of the content of an HDF5 file according to its first bytes; None for another kind of file."""
    if len(head) < _HEAD or bytes(head[:8]) != _SIGNATURE or head[_SUPERBLOCK_VERSION] not in _END_OF_FILE:
        return None
    (end,) = struct.unpack_from("<Q", head, _END_OF_FILE[head[_SUPERBLOCK_VERSION]])
    return int(end)


def has_recorded_hash(path: str | os.PathLike[str]) -> bool:
    """Return whether a file ends with a hash, right or wrong; `matches_recorded_hash` checks the hash.

    Raises
    ------
    OSError
        When the file cannot be read.
    """
    with open(path, "rb") as file:
        return _recorded(file) is not None


def matches_recorded_hash(path: str | os.PathLike[str]) -> bool:
    """Return whether a file has a recorded SHA-256 that matches its content.

    Only bytes are read; no library sees the file.

    Parameters
    ----------
    path : path

    Returns
    -------
    bool
        False where no hash is recorded: a file of version 0.1 or of another program.

    Raises
    ------
    DatasetError
        When the content does not match the recorded hash.
    OSError
        When the file cannot be read.
    """
    with open(path, "rb") as file:
        recorded = _recorded(file)
        if recorded is None:
            return False
        length, line = recorded
        file.seek(0)
        if line != _BEGIN + _hash_of(file, length) + _END:
            raise DatasetError(
                f"{os.fspath(path)}: expected the content whose SHA-256 the file ends with, got another: the file is "
                "damaged. Take a copy of it, or write it again."
            )
    return True


def _recorded(file: BinaryIO) -> tuple[int, bytes] | None:
    """Return the length of the content and the line after it; None where no hash is recorded."""
    size = os.fstat(file.fileno()).st_size
    expected = content_length(file.read(_HEAD))
    if expected is not None and expected < size:
        file.seek(expected)
        line = file.read(LINE_LENGTH + 1)
        if line[: len(_BEGIN)] == _BEGIN[: len(line)]:
            # also a line that is cut short, or followed by more bytes
            return expected, line
    length = size - LINE_LENGTH
    if length < 0:
        return None
    file.seek(length)
    line = file.read()
    # A hash shows in two ways, by the length of the file and by the line: damage at one place leaves the other.
    return (length, line) if expected == length or line.startswith(_BEGIN) else None


def _hash_of(file: BinaryIO, length: int) -> bytes:
    """Return the SHA-256 of the next `length` bytes, in hexadecimal."""
    digest, left = hashlib.sha256(), length
    while left and (block := file.read(min(left, _BLOCK))):
        digest.update(block)
        left -= len(block)
    return digest.hexdigest().encode()

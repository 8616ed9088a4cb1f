"""Journals: what a program measures, appended to a file as it comes, so that no death of the program loses it.

A journal is a line that says what it is, a line of JSON, and records. A record is a head (kind, bytes of its content,
number of its first sample, checksum) and its content: samples as doubles, channel by channel, or JSON. Numbers are
little-endian. It can be cut anywhere: each whole record before the cut is read again.
"""

from __future__ import annotations

import json
import mmap
import os
import shutil
import struct
import time
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from vibroimpact.analysis.files.folder_lock import try_lock
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.hardware.rig.acquisition import Block

_KIND = b"vibroimpact journal "
TITLE = _KIND + b"1\n"
ENDING = ".journal"
MARGIN = 64 * 2**20
"""Bytes that a disk must have left."""
SYNC_SECONDS = 1.0
SLOW_DISK = 1.0
"""Time of a write, s, from which on the disk is said to be slow."""
AS_RECORDING = 1.2
"""Size of a recording, relative to that of its journal, at most."""
_HEAD = struct.Struct("<4sIQI")
_SAMPLES, _NOTE = b"SAMP", b"NOTE"
_LONGEST_HEADER = 2**20
_LAST = 2**52
"""Largest number of a sample: its instant is still told from that of the next one."""
_MOST_TRIALS = 10_000
"""Places that are tried for the next record after one that is damaged."""


class Journal:
    """A file that grows; a context manager, which closes it and leaves it there if it has samples.

    Parameters
    ----------
    path : Path
    header : mapping
        Of JSON values.

    Attributes
    ----------
    written : int
        Bytes.
    slowest : float
        Longest time of a write with what forces it to the disk, s.

    Raises
    ------
    UsageError
        There is a journal of this name, which may be all that is left of another measurement.
    OSError
        It cannot be written, also of `append`, `note` and `sync`.
    """

    def __init__(self, path: Path, header: Mapping[str, Any]) -> None:
        self.path, self.written, self.slowest = path, 0, 0.0
        self._has_samples = False
        refuse_journal(path)
        self._file = path.open("xb", buffering=0)
        try_lock(self._file.fileno())
        self._synced = time.monotonic()
        self._write(TITLE + json.dumps(dict(header), allow_nan=False).encode() + b"\n")
        self.sync()

    def __enter__(self) -> Journal:
        """Return the journal."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the file; one without samples is removed."""
        self._file.close()
        if not self._has_samples:
            self.path.unlink(missing_ok=True)

    def append(self, block: Block) -> None:
        """Append samples."""
        volts = np.ascontiguousarray(block.volts, dtype="<f8")
        self._has_samples = True
        self._record(_SAMPLES, block.first, volts.tobytes())

    def note(self, **values: Any) -> None:
        """Append JSON values: a gap, the end, what else is to be known."""
        self._record(_NOTE, 0, json.dumps(values, allow_nan=False).encode())

    def _record(self, kind: bytes, first: int, content: bytes) -> None:
        began = time.monotonic()
        head = _HEAD.pack(kind, len(content), first, 0)[:-4]
        self._write(head + zlib.crc32(content, zlib.crc32(head)).to_bytes(4, "little") + content)
        if time.monotonic() - self._synced >= SYNC_SECONDS:
            self.sync()
        self.slowest = max(self.slowest, time.monotonic() - began)

    def _write(self, content: bytes) -> None:
        left = memoryview(content)
        while left:
            left = left[self._file.write(left) :]
        self.written += len(content)

    def sync(self) -> None:
        """Force what was appended to the disk; about once a second it is done without being asked for."""
        os.fsync(self._file.fileno())
        self._synced = time.monotonic()

    def is_short_of_room(self) -> bool:
        """Whether the disk has hardly room for the recording that is to be made of the journal."""
        free = shutil.disk_usage(self.path.parent).free
        return free < AS_RECORDING * self.written + MARGIN / 4


def refuse_journal(path: Path) -> None:
    """Refuse a name that a journal has, which may be all that is left of another measurement.

    Raises
    ------
    UsageError
    """
    if path.exists():
        raise UsageError(
            f"{path}: expected no journal of an earlier measurement, got one. "
            f"`vibroimpact rig recover {path}` makes a recording of it; remove it when you have that."
        )


def refuse_full_disk(folder: Path, bytes_needed: float) -> None:
    """Refuse a folder on whose disk a journal of so many bytes and the recording of it have no room.

    Raises
    ------
    UsageError
    """
    free = shutil.disk_usage(folder).free
    wanted = (1.0 + AS_RECORDING) * bytes_needed + MARGIN
    if free < wanted:
        raise UsageError(
            f"{folder}: expected {wanted / 2**20:.0f} MiB of free space for the journal and the recording, "
            f"got {free / 2**20:.0f}. Choose another disk, a lower rate or a shorter duration."
        )


@dataclass(frozen=True, slots=True)
class JournalContent:
    """What a journal holds.

    Attributes
    ----------
    header : dict
    blocks : list of Block
        In order; their volts are views of the file.
    notes : list of dict
    lost_bytes : int
        Of records that are damaged or cut off.
    """

    header: dict[str, Any]
    blocks: list[Block] = field(default_factory=list)
    notes: list[dict[str, Any]] = field(default_factory=list)
    lost_bytes: int = 0


def read_journal(path: Path, channels_in: str = "inputs", *, ended: bool = True) -> JournalContent:
    """Read what there is of a journal; records that are damaged or cut off are left out.

    Parameters
    ----------
    path : Path
    channels_in : str
        Key of the header whose value has an item for each channel.
    ended : bool
        Refuse a journal that a program is still writing.

    Raises
    ------
    DatasetError
        It is no journal, or its first lines are damaged.
    UsageError
        It cannot be opened, or is still being written.
    """
    try:
        if ended:
            _refuse_locked(path)
        with path.open("rb") as file:
            size = os.fstat(file.fileno()).st_size
            content: Any = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) if size else b""
    except OSError as error:
        raise UsageError(f"{path}: expected a journal, got none: {error.strerror or error}.") from None
    header, place = _header(content, path)
    channels = header.get(channels_in)
    if not isinstance(channels, list) or not channels:
        raise DatasetError(f"{path}: {channels_in}: expected a list in the header of the journal, got none.")
    found = JournalContent(header)
    whole = 0
    for kind, first, begin, end in _records(content, place):
        if kind == _NOTE:
            note = json.loads(content[begin:end])
            if isinstance(note, dict):
                found.notes.append(note)
        elif _keep(found.blocks, content, first, begin, end, len(channels)) is None:
            continue
        whole += end - begin + _HEAD.size
    return JournalContent(header, found.blocks, found.notes, len(content) - place - whole)


def _refuse_locked(path: Path) -> None:
    with path.open("rb") as file:  # of its own: what maps a file into memory keeps its locks
        try:
            try_lock(file.fileno())
        except OSError:
            raise UsageError(
                f"{path}: expected the journal of a measurement that has ended, got one that is still being written. "
                "End that with Ctrl-C: it makes the recording itself."
            ) from None


def _header(content: Any, path: Path) -> tuple[dict[str, Any], int]:
    start, end = len(TITLE), -1
    if content[: len(_KIND)] == _KIND and content[:start] != TITLE:
        version = content[len(_KIND) : len(_KIND) + 20].split(b"\n")[0].decode("ascii", "backslashreplace")
        raise DatasetError(
            f"{path}: expected a journal of version 1, got version {version}. "
            "Recover it with the vibroimpact that wrote it, or a newer one."
        )
    if content[:start] == TITLE:
        end = content.find(b"\n", start, start + _LONGEST_HEADER)
    try:
        header = json.loads(content[start:end]) if end > 0 else None
    except ValueError:
        header = None
    if not isinstance(header, dict):
        raise DatasetError(
            f"{path}: expected a journal of `vibroimpact rig`, got another file or a damaged one."
        )
    return header, end + 1


def _records(content: Any, place: int) -> Iterator[tuple[bytes, int, int, int]]:
    """Yield kind, first sample, begin and end of the content of each whole record."""
    trials = 0
    while trials < _MOST_TRIALS and place + _HEAD.size <= len(content):
        kind, length, first, checksum = _HEAD.unpack_from(content, place)
        begin = place + _HEAD.size
        end = begin + length
        if (
            kind in (_SAMPLES, _NOTE)
            and end <= len(content)
            and zlib.crc32(content[begin:end], zlib.crc32(content[place : begin - 4])) == checksum
        ):
            yield kind, first, begin, end
            place = end
            continue
        trials += 1
        nexts = [content.find(each, place + 1) for each in (_SAMPLES, _NOTE)]
        place = min((each for each in nexts if each >= 0), default=len(content))


def _keep(blocks: list[Block], content: Any, first: int, begin: int, end: int, channels: int) -> Block | None:
    """Keep the samples of a record; None where they do not go with the header or with what came before."""
    count, rest = divmod(end - begin, 8 * channels)
    if rest or not count or first > _LAST or (blocks and first < blocks[-1].end):
        return None
    values = np.frombuffer(content, "<f8", channels * count, begin).reshape(channels, count)
    blocks.append(Block(first, values))
    return blocks[-1]

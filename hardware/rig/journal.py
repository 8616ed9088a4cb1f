"""Journals: measured samples, appended to a file as they come, so that no death of the program loses them.

A journal is a title line and records. A record is a head and its content. The head has kind, length of the content in
bytes, number of the first sample and checksum. The content is samples as doubles, channel by channel, or JSON. Numbers
are little-endian. The header of the journal comes first, in two equal records. A journal can be cut anywhere: each
whole record before the cut is read. Version 1 had its header as a line of JSON without a checksum; it is still read.

The author of a journal may be hostile. Bytes searched in damaged records, notes and pieces of samples are therefore
limited; whole records of samples are not.
"""

from __future__ import annotations

import json
import mmap
import os
import shutil
import stat
import struct
import time
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from vibroimpact.analysis.files.folder_lock import try_lock
from vibroimpact.analysis.recording.files import MOST_VALUES
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.hardware.rig.acquisition import Block

_KIND = b"vibroimpact journal "
TITLE = _KIND + b"2\n"
_TITLE_OF_LINE = _KIND + b"1\n"
ENDING = ".journal"
MARGIN = 64 * 2**20
"""Free bytes that a disk must keep."""
SYNC_SECONDS = 1.0
SLOW_DISK = 1.0
"""Time of a write, s, above which the disk counts as slow."""
AS_RECORDING = 1.2
"""Largest size of a recording, relative to the size of its journal."""
_HEAD = struct.Struct("<4sIQI")
_HEADER, _SAMPLES, _NOTE = b"HEAD", b"SAMP", b"NOTE"
_LONGEST_HEADER = 2**20
LAST_SAMPLE = 2**52
"""Largest number of a sample: the instants of larger numbers are not distinct."""
_MOST_LOOKED = 2**31
"""Most bytes searched in damaged records, checksums and searches together; the rest of the file counts as lost.

A journal with every record of the longest recording (0.8 GB) damaged needs less; 2 GiB take 3 s of processor.
"""
_MOST_LOOKED_FOR_HEADER = 2**25
"""Most bytes searched in damaged records before the header is found."""
_COST_OF_TRIAL = 4096
"""Bytes charged for the trial of one head, whatever its length: 2 µs."""
_STRETCH = 2**24
"""Bytes searched or summed at once."""
_KEPT_PAGES = 2**27
"""Bytes read, above which their pages are returned to the system."""
_LONGEST_NOTE = 2**16
_MOST_NOTES, _MOST_NOTE_BYTES = 500_000, 2**24
"""Most notes of a journal, and most bytes of notes: hours of a rig that loses every block have fewer."""
_MOST_PIECES = 2**21
"""Most separate blocks of a journal, with samples missing between them."""
_FEW_PIECES = 2**17
"""Number of blocks, above which adjacent blocks are joined."""
_WATCHED = {"watched"}
"""Keys of a note that replaces the previous note of these keys."""


class Journal:
    """A growing file; a context manager, which closes it and keeps it if it has samples.

    Parameters
    ----------
    path : Path
    header : mapping
        Values in JSON.

    Attributes
    ----------
    written : int
        Bytes.
    slowest : float
        Longest time of a write with its sync, s.

    Raises
    ------
    UsageError
        A journal of this name exists; it may be all that is left of another measurement.
    OSError
        It cannot be written; also from `append`, `note` and `sync`.
    """

    def __init__(self, path: Path, header: Mapping[str, Any]) -> None:
        self.path, self.written, self.slowest = path, 0, 0.0
        self._has_samples = False
        refuse_journal(path)
        self._file = path.open("xb", buffering=0)
        try_lock(self._file.fileno())
        self._synced = time.monotonic()
        self._write(TITLE + 2 * _record(_HEADER, 0, json.dumps(dict(header), allow_nan=False).encode()))
        self.sync()

    def __enter__(self) -> Journal:
        """Return the journal."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the file; a file without samples is removed."""
        self._file.close()
        if not self._has_samples:
            self.path.unlink(missing_ok=True)

    def append(self, block: Block) -> None:
        """Append samples."""
        volts = np.ascontiguousarray(block.volts, dtype="<f8")
        self._has_samples = True
        self._append(_record(_SAMPLES, block.first, volts.tobytes()))

    def note(self, **values: Any) -> None:
        """Append JSON values: a gap, the end, or other facts."""
        self._append(_record(_NOTE, 0, json.dumps(values, allow_nan=False).encode()))

    def _append(self, record: bytes) -> None:
        began = time.monotonic()
        self._write(record)
        if time.monotonic() - self._synced >= SYNC_SECONDS:
            self.sync()
        self.slowest = max(self.slowest, time.monotonic() - began)

    def _write(self, content: bytes) -> None:
        left = memoryview(content)
        while left:
            left = left[self._file.write(left) :]
        self.written += len(content)

    def sync(self) -> None:
        """Force the appended data to the disk; this also happens about once a second."""
        os.fsync(self._file.fileno())
        self._synced = time.monotonic()

    def is_short_of_room(self) -> bool:
        """Whether the disk is nearly too full for the recording of the journal."""
        free = shutil.disk_usage(self.path.parent).free
        return free < AS_RECORDING * self.written + MARGIN / 4


def _record(kind: bytes, first: int, content: bytes) -> bytes:
    head = _HEAD.pack(kind, len(content), first, 0)[:-4]
    return head + zlib.crc32(content, zlib.crc32(head)).to_bytes(4, "little") + content


def refuse_journal(path: Path) -> None:
    """Raise UsageError if a journal of this name exists: it may be all that is left of another measurement.

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
    """Raise UsageError unless the disk of a folder has room for a journal of this size and its recording.

    Raises
    ------
    UsageError
    """
    free = shutil.disk_usage(folder).free
    required = (1.0 + AS_RECORDING) * bytes_needed + MARGIN
    if free < required:
        raise UsageError(
            f"{folder}: expected {required / 2**20:.0f} MiB of free space for the journal and the recording, "
            f"got {free / 2**20:.0f}. Choose another disk, a lower rate or a shorter duration."
        )


@dataclass(frozen=True, slots=True)
class JournalContent:
    """Content of a journal.

    Attributes
    ----------
    header : dict
    blocks : list of Block
        In order; their volts are views of the file.
    notes : list of dict
    lost_bytes : int
        Bytes of records that are damaged or cut off.
    """

    header: dict[str, Any]
    blocks: list[Block] = field(default_factory=list)
    notes: list[dict[str, Any]] = field(default_factory=list)
    lost_bytes: int = 0


def read_journal(path: Path, channels_in: str = "inputs", *, ended: bool = True) -> JournalContent:
    """Read the whole records of a journal; damaged or cut records are left out.

    Parameters
    ----------
    path : Path
    channels_in : str
        Key of the header whose value has one item per channel.
    ended : bool
        Refuse a journal that a program is still writing.

    Raises
    ------
    DatasetError
        It is no journal, its header is damaged, or it has more notes or pieces than any measurement.
    UsageError
        It cannot be opened, or is still being written.
    """
    content: Any = _mapped(path, ended)
    header, header_bytes, place = _header(content, path)
    channels = header.get(channels_in)
    if not isinstance(channels, list) or not channels:
        raise DatasetError(f"{path}: {channels_in}: expected a list in the header of the journal, got none.")
    blocks, notes, whole = _Pieces(path), _Notes(path), header_bytes
    for kind, first, begin, end in _records(content, place, (_SAMPLES, _NOTE), _MOST_LOOKED):
        if kind == _NOTE:
            kept = notes.take(content[begin:end])
        else:
            kept = blocks.take(content, first, begin, end, len(channels))
        whole += end - begin + _HEAD.size if kept else 0
    return JournalContent(header, blocks.all, notes.all, len(content) - whole)


def _mapped(path: Path, ended: bool) -> mmap.mmap | bytes:
    """Return the bytes of a journal, mapped into memory."""
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise UsageError(f"{path}: expected a journal, got something that is no file.")
        if ended:
            _refuse_locked(path)
        with path.open("rb") as file:
            size = os.fstat(file.fileno()).st_size
            return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) if size else b""
    except OSError as error:
        raise UsageError(f"{path}: expected a journal, got none: {error.strerror or error}.") from None


def _refuse_locked(path: Path) -> None:
    with path.open("rb") as file:  # a separate handle: a file mapped into memory keeps its locks
        try:
            try_lock(file.fileno())
        except OSError:
            raise UsageError(
                f"{path}: expected the journal of a measurement that has ended, got one that is still being written. "
                "End that with Ctrl-C: it makes the recording itself."
            ) from None


def _header(content: Any, path: Path) -> tuple[dict[str, Any], int, int]:
    """Return the header, the whole bytes of title and header, and the start of the records after them."""
    title = content[: len(TITLE)]
    if title == TITLE:
        begin, end, place = _checked_header(content)
    elif title == _TITLE_OF_LINE:
        begin, end = len(title), content.find(b"\n", len(title), len(title) + _LONGEST_HEADER)
        place = end + 1
    elif title[: len(_KIND)] == _KIND:
        version = content[len(_KIND) : len(_KIND) + 20].split(b"\n")[0].decode("ascii", "backslashreplace")
        raise DatasetError(
            f"{path}: expected a journal of version 1 or 2, got version {version}. "
            "Recover it with the vibroimpact that wrote it, or a newer one."
        )
    else:
        begin, end, place = 0, 0, 0
    try:
        header = json.loads(content[begin:end]) if end > begin else None
    except (ValueError, RecursionError):
        header = None
    if not isinstance(header, dict):
        raise DatasetError(
            f"{path}: expected a journal of `vibroimpact rig`, got another file or a damaged one."
        )
    return header, len(title) + place - begin + (_HEAD.size if title == TITLE else 0), place


def _checked_header(content: Any) -> tuple[int, int, int]:
    """Return begin and end of the first whole copy of the header, and the end of the last copy."""
    start = content[: len(TITLE) + 2 * (_HEAD.size + _LONGEST_HEADER)]
    for _, _, begin, end in _records(start, len(TITLE), (_HEADER,), _MOST_LOOKED_FOR_HEADER):
        copy = start[begin - _HEAD.size : end]
        return begin, end, end + len(copy) if start[end : end + len(copy)] == copy else end
    return 0, 0, 0


def _records(
    content: Any, place: int, kinds: tuple[bytes, ...], left: int
) -> Iterator[tuple[bytes, int, int, int]]:
    """Yield kind, first sample, begin and end of the content of each whole record of some kinds.

    Damaged records are searched up to `left` bytes.
    """
    heads, given_back = _Heads(content, kinds), 0
    while left > 0 and place + _HEAD.size <= len(content):
        kind, length, first, checksum = _HEAD.unpack_from(content, place)
        begin = place + _HEAD.size
        end = begin + length
        known = kind in kinds and end <= len(content)
        if known and _checksum(content, place, begin, end) == checksum:
            yield kind, first, begin, end
            place = end
            if end - given_back > _KEPT_PAGES:
                _give_back(content, given_back, end)
                given_back = end
            continue
        following = heads.after(place, place + left)
        left -= _COST_OF_TRIAL + (length if known else 0) + following - place
        place = following


def _checksum(content: Any, place: int, begin: int, end: int) -> int:
    """Return the checksum of a record, with memory for one stretch of it."""
    seen = memoryview(content)
    found = zlib.crc32(seen[place : begin - 4])
    for start in range(begin, end, _STRETCH):
        stop = min(start + _STRETCH, end)
        found = zlib.crc32(seen[start:stop], found)
        if stop - begin > _KEPT_PAGES:
            _give_back(content, start, stop)
    return found


def _give_back(content: Any, start: int, stop: int) -> None:
    """Return the read pages of a file to the system; they are loaded again if needed."""
    if isinstance(content, mmap.mmap) and hasattr(mmap, "MADV_DONTNEED"):
        page = start - start % mmap.PAGESIZE
        content.madvise(mmap.MADV_DONTNEED, page, min(stop, len(content)) - page)


class _Heads:
    """Finds possible starts of records; each stretch of the file is searched once for each kind."""

    def __init__(self, content: Any, kinds: tuple[bytes, ...]) -> None:
        self._content = content
        self._following = dict.fromkeys(kinds, -1)

    def after(self, place: int, most: int) -> int:
        """Return the next possible start after `place`, or `most`, or the end of the file."""
        most = min(most, len(self._content))
        for kind, known in self._following.items():
            if known <= place:
                self._following[kind] = self._found(kind, place + 1, most)
        return min(most, *self._following.values())

    def _found(self, kind: bytes, place: int, most: int) -> int:
        """Return the next place of a kind; without one before `most`, the end of the search."""
        for start in range(place, most, _STRETCH):
            found: int = self._content.find(kind, start, start + _STRETCH + len(kind) - 1)
            if found >= 0:
                return found
            _give_back(self._content, start, start + _STRETCH)
        return most


class _Notes:
    """The notes of a journal: JSON objects of plain values, or of objects of plain values."""

    def __init__(self, path: Path) -> None:
        self.all: list[dict[str, Any]] = []
        self._path, self._bytes = path, 0

    def take(self, content: bytes) -> bool:
        """Keep a note; return whether it is valid."""
        if len(content) > _LONGEST_NOTE:
            return False
        try:
            note = json.loads(content)
        except (ValueError, RecursionError):
            return False
        if not _is_note(note):
            return False
        if self.all and note.keys() == self.all[-1].keys() == _WATCHED:
            self.all[-1] = note
            return True
        self._bytes += len(content)
        if len(self.all) >= _MOST_NOTES or self._bytes > _MOST_NOTE_BYTES:
            raise DatasetError(
                f"{self._path}: expected at most {_MOST_NOTES} notes of {_MOST_NOTE_BYTES} bytes together, got more. "
                "No measurement writes such a journal."
            )
        self.all.append(note)
        return True


def _is_note(note: Any) -> bool:
    """Whether JSON is an object whose values are plain, or objects of plain values."""
    if not isinstance(note, dict):
        return False
    inner = (each for each in note.values() if isinstance(each, dict))
    plain = (each for each in note.values() if not isinstance(each, dict))
    values = (*plain, *(value for each in inner for value in each.values()))
    return all(value is None or isinstance(value, str | float | int) for value in values)


class _Pieces:
    """The samples of a journal; with many blocks, adjacent ones are joined."""

    def __init__(self, path: Path) -> None:
        self.all: list[Block] = []
        self._path, self._most, self._values = path, _FEW_PIECES, 0

    def take(self, content: Any, first: int, begin: int, end: int, channels: int) -> bool:
        """Keep the samples of a record; return whether they fit the header and the earlier samples."""
        count, rest = divmod(end - begin, 8 * channels)
        if rest or not count or first > LAST_SAMPLE or (self.all and first < self.all[-1].end):
            return False
        self._values += channels * count
        if self._values > MOST_VALUES:
            raise DatasetError(f"{self._path}: expected at most {MOST_VALUES} values, got more.")
        values = np.frombuffer(content, "<f8", channels * count, begin).reshape(channels, count)
        self.all.append(Block(first, values))
        if len(self.all) >= self._most:
            self._join()
        return True

    def _join(self) -> None:
        first = [block.first for block in self.all]
        gaps = np.flatnonzero(np.array(first[1:]) != [block.end for block in self.all[:-1]]) + 1
        borders = [0, *gaps.tolist(), len(self.all)]
        self.all = [
            self.all[start]
            if stop == start + 1
            else Block(first[start], np.concatenate([block.volts for block in self.all[start:stop]], axis=1))
            for start, stop in pairwise(borders)
        ]
        self._most = max(_FEW_PIECES, 2 * len(self.all))
        if self._most > _MOST_PIECES:
            raise DatasetError(
                f"{self._path}: expected at most {_MOST_PIECES // 2} pieces of samples, got more. "
                "No measurement writes such a journal."
            )

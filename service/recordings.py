"""The recordings of a service: uploaded files, imported once, each a file `recordings/ID.nc` and a row of the store."""

from __future__ import annotations

import json
import time
import uuid
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from vibroimpact.analysis.files.folder_lock import make_folder
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.file_names import is_device
from vibroimpact.fmus.processes.call import call
from vibroimpact.fmus.processes.python_child import ending
from vibroimpact.service.store import OUTPUTS, Store

PART = "part-"
"""Prefix of the name of a file during its import."""
MOST_RECORDINGS = 1000
"""Largest number of recordings that a service keeps."""
IMPORT_SECONDS = 120.0
"""Time limit for the import of one file, s; a damaged file may hang."""
NAME = r"^[A-Za-z0-9_][A-Za-z0-9_ .+\-]{0,99}$"
"""Valid name of a file: the same on every system, and never a path."""


@dataclass(frozen=True, slots=True)
class StoredRecording:
    """A recording of the service."""

    number: int
    """Number in the order of upload, from 1."""
    id: str
    """32 hexadecimal digits."""
    name: str
    """Name for scenes: the name of the uploaded file, with the extension `.nc`."""
    source: str
    """SHA-256 of the uploaded file and its import settings."""
    bytes: int
    channels: list[dict[str, Any]]
    """`name`, `units` and `samples` of each channel; a train of events has `events` in place of `samples`."""
    created: float
    """Time of the upload, seconds since 1970."""


class RecordingStore:
    """The recordings in the folder of a store."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self.folder = store.folder / "recordings"
        make_folder(self.folder)
        for path in self.folder.glob(f"{PART}*"):  # left by uploads that a kill interrupted
            path.unlink()

    def path(self, name: str) -> Path:
        """Return the path of a recording's file, by its id."""
        return self.folder / f"{name}.nc"

    def file(self, recording: StoredRecording) -> Path:
        """Return the file of a recording; raise UsageError if it was removed."""
        path = self.path(recording.id)
        if not path.is_file():
            raise UsageError(
                f"{recording.name}: expected its file, got none: somebody has removed it. "
                "Delete the recording and upload it again."
            )
        return path

    def find(self, name: str) -> StoredRecording:
        """Return a recording by its id or its name; raise KeyError for an unknown one."""
        rows = self._store.rows(f"SELECT {_COLUMNS} FROM recordings WHERE id = ? OR name = ?", name, name)
        if not rows:
            raise KeyError(name)
        return _recording(rows[0])

    def page(self, *, before: int | None = None, most: int = 100) -> list[StoredRecording]:
        """Return recordings with lower numbers than `before`, the newest first."""
        rows = self._store.rows(
            f"SELECT {_COLUMNS} FROM recordings WHERE number < ? ORDER BY number DESC LIMIT ?",
            *(2**62 if before is None else before, most),
        )
        return [_recording(row) for row in rows]

    def add(self, file: Path, source: str, settings: str) -> StoredRecording:
        """Import an uploaded file; the same file with the same name and settings gives the same recording again.

        The file has its given name, in a folder of its own; `source` is the SHA-256 of file and settings (JSON). Raise
        UsageError if the file is no recording, or if another recording has its name.
        """
        name, known = stored_name(file.name), self._known(stored_name(file.name), source)
        if known is not None:
            return known
        identifier = uuid.uuid4().hex
        target = self.folder / f"{PART}{identifier}.nc"
        channels = imported(file, target, settings)
        try:
            with self._store.transaction() as database:
                there = self._known(name, source)
                if there is None:
                    database.execute(
                        "INSERT INTO recordings (id, name, source, bytes, channels, created) VALUES (?, ?, ?, ?, ?, ?)",
                        (identifier, name, source, target.stat().st_size, json.dumps(channels), time.time()),
                    )
                    target.rename(self.path(identifier))
        except BaseException:
            target.unlink(missing_ok=True)
            self.path(identifier).unlink(missing_ok=True)
            raise
        if there is not None:  # another upload of the same file was faster
            target.unlink()
            return there
        return self.find(identifier)

    def refuse_more(self) -> None:
        """Raise an error if the service has its full number of recordings."""
        if self._store.rows("SELECT COUNT(*) FROM recordings")[0][0] >= MOST_RECORDINGS:
            raise UsageError(f"expected fewer than {MOST_RECORDINGS} recordings, got no room. Delete some.")

    def delete(self, recording: StoredRecording) -> None:
        """Delete a recording; jobs that have begun with it keep its data."""
        with self._store.transaction() as database:
            database.execute("DELETE FROM recordings WHERE id = ?", (recording.id,))
        self.path(recording.id).unlink(missing_ok=True)

    def _known(self, name: str, source: str) -> StoredRecording | None:
        try:
            found = self.find(name)
        except KeyError:
            return None
        if found.source != source:
            raise UsageError(
                f"name: expected a new name, got {name}, which another recording has ({found.id}). "
                "Choose another, or delete that one."
            )
        return found


def refuse_device(name: str) -> None:
    """Raise UsageError for a name that Windows reserves for a device."""
    if is_device(name):
        raise UsageError(
            f"name: expected a name that files have on every system, got {name!r}, a device on Windows. Choose another."
        )


def stored_name(name: str) -> str:
    """Return the name of the recording for the name of an uploaded file.

    >>> stored_name("a0.tdms")
    'a0.nc'
    """
    stored = f"{Path(name).stem}.nc"
    refuse_device(name)
    if stored in OUTPUTS.values():
        raise UsageError(f"name: expected another name, got {name!r}: {stored} is what jobs write.")
    return stored


def imported(file: Path, target: Path, settings: str) -> list[dict[str, Any]]:
    """Import a file in a process that may die or hang; return the description of its channels.

    Raise UsageError if the file is no recording, or if its import did not end.
    """
    function = "vibroimpact.service.import_process:answer"
    done = call(function, str(file), str(target), settings, seconds=IMPORT_SECONDS, errors="dropped")
    reply = done.answer or {}
    if "full" in reply:
        raise OSError(*reply["full"])
    if "channels" not in reply:
        late = f", after {IMPORT_SECONDS:.0f} s" if done.is_late else ""
        end = f"{file.name}: expected a recording, got a file whose import {ending(done.code)}{late}."
        why = reply.get("failed") or end
        raise UsageError(str(why))
    channels: list[dict[str, Any]] = reply["channels"]
    return channels


_COLUMNS = ", ".join(one.name for one in fields(StoredRecording))


def _recording(row: Sequence[Any]) -> StoredRecording:
    values = dict(zip((one.name for one in fields(StoredRecording)), row, strict=True))
    return StoredRecording(**values | {"channels": json.loads(values["channels"])})

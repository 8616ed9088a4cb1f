"""The service's record of its jobs: SQLite next to their folders, which outlives every process.

A job is a scene with its state. Its folder `jobs/ID` has `scene.toml`, `log.txt` and the files that it reads. Results
are those of the command line: `campaign/` for a sweep, else `run.nc`, `replay.nc` or `estimates.nc`. Events have
permanent numbers, so that a reader who comes back asks for those after its last one.
"""

from __future__ import annotations

import contextlib
import json
import logging
import os
import re
import shutil
import sqlite3
import threading
import time
import uuid
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields
from enum import StrEnum
from pathlib import Path
from typing import Any

from vibroimpact.analysis.files.atomic import write_atomically
from vibroimpact.fmus.errors import UsageError

SCHEMA = """
CREATE TABLE IF NOT EXISTS jobs (
    number INTEGER PRIMARY KEY AUTOINCREMENT, id TEXT NOT NULL UNIQUE, title TEXT NOT NULL, state TEXT NOT NULL,
    workers INTEGER, kind TEXT NOT NULL, created REAL NOT NULL, started REAL, ended REAL,
    total INTEGER NOT NULL, done INTEGER NOT NULL, attempts INTEGER NOT NULL, message TEXT NOT NULL,
    options TEXT NOT NULL DEFAULT '{}', outcomes TEXT NOT NULL DEFAULT '{}');
CREATE INDEX IF NOT EXISTS jobs_by_state ON jobs (state, number);
CREATE TABLE IF NOT EXISTS events (
    id INTEGER PRIMARY KEY AUTOINCREMENT, job TEXT NOT NULL, at REAL NOT NULL, kind TEXT NOT NULL, data TEXT NOT NULL);
CREATE INDEX IF NOT EXISTS events_of_job ON events (job, id);
CREATE TABLE IF NOT EXISTS requests (key TEXT PRIMARY KEY, digest TEXT NOT NULL, job TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS recordings (
    number INTEGER PRIMARY KEY AUTOINCREMENT, id TEXT NOT NULL UNIQUE, name TEXT NOT NULL UNIQUE,
    source TEXT NOT NULL, bytes INTEGER NOT NULL, channels TEXT NOT NULL, created REAL NOT NULL);
"""
LAYOUT = 2
"""Version of the database's layout; a service of another version refuses the database."""
LOG = logging.getLogger("vibroimpact.service")
DATABASE = "service.sqlite"
PROGRESS_READ = 20
"""Number of the latest events of progress that determine the rate of a job."""
FORGOTTEN = ".forgotten"
"""Suffix of the folder of a job during its removal."""
LOG_FILE = "log.txt"
"""Log of a job's process, in the folder of the job; it exists once the job has begun."""
HELD_SECONDS = 1.0
"""Time to wait for a database that another program has locked, s; all other requests wait meanwhile."""
MOST_EVENTS_READ = 500
"""Largest number of events in one answer."""


class State(StrEnum):
    """State of a job."""

    queued = "queued"
    running = "running"
    cancelling = "cancelling"
    cancelled = "cancelled"
    failed = "failed"
    done = "done"


class Kind(StrEnum):
    """Kind of a job's result."""

    campaign = "campaign"
    run = "run"
    replay = "replay"
    estimate = "estimate"


OUTPUTS = {
    Kind.campaign: "campaign/dataset.nc",
    Kind.run: "run.nc",
    Kind.replay: "replay.nc",
    Kind.estimate: "estimates.nc",
}
"""Path of the dataset of a job of each kind, in its folder."""
ENDED = (State.cancelled, State.failed, State.done)
"""States that a job does not leave by itself."""


@dataclass(frozen=True, slots=True)
class Job:
    """A submitted scene with its state."""

    number: int
    """Number in the order of submission, from 1."""
    id: str
    """32 hexadecimal digits."""
    title: str
    """Title of its scene."""
    state: State
    workers: int | None
    """Worker processes; None: one for each processor."""
    kind: Kind
    created: float
    started: float | None
    ended: float | None
    """`created`, `started` and `ended`: seconds since 1970."""
    total: int
    done: int
    """Number of finished points of the `total`; 0 of 0 before it has begun."""
    attempts: int
    """Number of starts of the job."""
    message: str
    """Reason for the present state, in words; empty if there is nothing to explain."""
    options: dict[str, Any]
    """Options of its process besides its kind; see `job_process.Work`."""
    outcomes: dict[str, int]
    """Number of points with each outcome."""


@dataclass(frozen=True, slots=True)
class Event:
    """An event of a job: its number, time (seconds since 1970), kind, and the job at that time."""

    id: int
    job: str
    at: float
    kind: str
    data: dict[str, Any]


@dataclass(frozen=True, slots=True)
class NewJob:
    """A new job, before it is accepted."""

    kind: Kind
    title: str
    text: str = ""
    """Text of the scene; empty without a scene."""
    workers: int | None = None
    files: dict[str, Path] = field(default_factory=dict)
    """Files that the job reads, by names in its folder; hard links keep them when the originals are deleted."""
    options: dict[str, Any] = field(default_factory=dict)


class KeyReusedError(Exception):
    """An idempotency key came with another request than the first time."""


class QueueFullError(Exception):
    """The queue has its largest number of jobs."""


class Store:
    """The jobs in the folder of a service; the database is `service.sqlite` in it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._lock = threading.RLock()
        self._connection = sqlite3.connect(
            folder / DATABASE, timeout=HELD_SECONDS, check_same_thread=False, isolation_level=None
        )
        try:
            self._connection.execute("PRAGMA journal_mode = WAL")
            self._connection.execute("PRAGMA synchronous = FULL")  # an accepted job survives a power cut
            self._refuse_other_layout()
            self._connection.executescript(f"{SCHEMA}PRAGMA user_version = {LAYOUT};")
        except sqlite3.DatabaseError as error:
            self._connection.close()
            raise UsageError(
                f"{folder / DATABASE}: expected the database of a service, got: {error}. "
                "The campaigns in `jobs` open with the commands all the same."
            ) from None

    def _refuse_other_layout(self) -> None:
        is_there = self._connection.execute("SELECT COUNT(*) FROM sqlite_master").fetchone()[0]
        (layout,) = self._connection.execute("PRAGMA user_version").fetchone()
        if is_there and layout != LAYOUT:
            self._connection.close()
            raise UsageError(
                f"{self.folder / DATABASE}: expected the layout {LAYOUT}, got {layout}, of another version. "
                "Its campaigns in `jobs` open with the commands; serve another folder."
            )

    def close(self) -> None:
        """Close the database."""
        with self._lock:
            self._connection.close()

    def rows(self, question: str, *values: Any) -> list[Any]:
        """Return the rows that answer an SQL query."""
        with self._lock:
            return self._connection.execute(question, values).fetchall()

    @contextlib.contextmanager
    def transaction(self) -> Iterator[sqlite3.Connection]:
        """Open a transaction, which is rolled back if its body raises."""
        with self._lock:
            self._connection.execute("BEGIN IMMEDIATE")
            try:
                yield self._connection
                self._connection.execute("COMMIT")
            except BaseException:
                if self._connection.in_transaction:  # a full disk has already rolled it back
                    self._connection.execute("ROLLBACK")
                raise

    def folder_of(self, job: str) -> Path:
        """Return the folder of a job."""
        return self.folder / "jobs" / job

    def scene_of(self, job: str) -> Path:
        """Return the scene file of a job."""
        return self.folder_of(job) / "scene.toml"

    def dataset_of(self, job: Job) -> Path:
        """Return the path of the dataset of a job, which exists once the job is done."""
        return self.folder_of(job.id) / OUTPUTS[job.kind]

    # ---- jobs ----

    def submit(
        self, new_job: NewJob, *, key: str = "", digest: str = "", most_queued: int | None = None
    ) -> tuple[Job, bool]:
        """Accept a request; return its job, and whether the job is new.

        A repeated idempotency key with the same digest of the request gives the same job. Raise KeyReusedError if the
        digest differs. Raise QueueFullError if the queue is full; simultaneous requests cannot exceed its limit.
        """
        with self.transaction() as database:
            if key:
                known = database.execute("SELECT digest, job FROM requests WHERE key = ?", (key,)).fetchone()
                if known is not None:
                    if known[0] != digest:
                        raise KeyReusedError
                    return self.job(known[1]), False
            if most_queued is not None and self.counts()[State.queued] >= most_queued:
                raise QueueFullError
            name = uuid.uuid4().hex
            self._fill(name, new_job)
            database.execute(
                "INSERT INTO jobs (id, title, state, workers, kind, created, total, done, attempts, message, options) "
                "VALUES (?, ?, ?, ?, ?, ?, 0, 0, 0, '', ?)",
                (
                    *(name, new_job.title, State.queued, new_job.workers, new_job.kind, time.time()),
                    json.dumps(new_job.options),
                ),
            )
            if key:
                database.execute("INSERT INTO requests VALUES (?, ?, ?)", (key, digest, name))
            self._tell(database, name, "state")
            return self.job(name), True

    def _fill(self, name: str, new_job: NewJob) -> None:
        """Make the folder of a job, with its scene and the files that it reads."""
        folder = self.folder_of(name)
        folder.mkdir(parents=True)
        try:
            if new_job.text:
                write_atomically(self.scene_of(name), new_job.text.encode())
            for link, file in new_job.files.items():
                _link(file, folder / link)
        except OSError:
            shutil.rmtree(folder)
            raise

    def remove_strays(self) -> None:
        """Remove the folders of jobs whose acceptance or deletion was interrupted when the service was killed.

        A job that has begun and is not in the database belongs to another one, for example a backup: its folder stays.
        """
        known = {name for (name,) in self.rows("SELECT id FROM jobs")}
        for folder in (self.folder / "jobs").glob("*"):
            if folder.name.endswith(FORGOTTEN) or (_JOB.fullmatch(folder.name) and not has_begun(folder)):
                if folder.name not in known:
                    shutil.rmtree(folder)
            elif folder.name not in known:
                LOG.warning("a folder of no known job is left alone", extra={"why": folder.name})

    def remove_folder(self, name: str) -> None:
        """Remove the folder of a deleted job, as far as it exists."""
        folder = self.folder_of(name)
        doomed = folder.with_name(f"{name}{FORGOTTEN}")  # a kill while it is removed leaves no job's folder
        with contextlib.suppress(FileNotFoundError):
            folder.rename(doomed)
            shutil.rmtree(doomed)

    def job(self, name: str) -> Job:
        """Return a job; raise KeyError for an unknown name."""
        rows = self.rows(f"SELECT {_COLUMNS} FROM jobs WHERE id = ?", name)
        if not rows:
            raise KeyError(name)
        return _job(rows[0])

    def jobs(self, *, before: int | None = None, most: int = 100) -> list[Job]:
        """Return jobs, the newest first, only those of lower number than `before`."""
        rows = self.rows(
            f"SELECT {_COLUMNS} FROM jobs WHERE number < ? ORDER BY number DESC LIMIT ?",
            *(2**62 if before is None else before, most),
        )
        return [_job(row) for row in rows]

    def jobs_in(self, state: State) -> list[Job]:
        """Return the jobs in a state, the oldest first."""
        return [
            _job(row)
            for row in self.rows(f"SELECT {_COLUMNS} FROM jobs WHERE state = ? ORDER BY number", state)
        ]

    def rate(self, name: str) -> float:
        """Return the rate of a job over its last progress, points/s; 0 before any progress."""
        rows = self.rows(
            "SELECT at, data FROM events WHERE job = ? AND kind = 'progress' ORDER BY id DESC LIMIT ?",
            *(name, PROGRESS_READ),
        )
        if len(rows) < 2:
            return 0.0
        (last, now), (first, before) = rows[0], rows[-1]
        done = json.loads(now)["done"] - json.loads(before)["done"]
        return float(done / (last - first)) if last > first else 0.0

    def outcomes(self) -> dict[str, int]:
        """Return the number of points of all jobs with each outcome."""
        found: Counter[str] = Counter()
        for (text,) in self.rows("SELECT outcomes FROM jobs WHERE outcomes != '{}'"):
            found.update(json.loads(text))
        return dict(found)

    def next_queued(self) -> Job | None:
        """Return the job that has waited longest."""
        return next(iter(self.jobs_in(State.queued)), None)

    def counts(self) -> dict[State, int]:
        """Return the number of jobs in each state."""
        rows = self.rows("SELECT state, COUNT(*) FROM jobs GROUP BY state")
        return dict.fromkeys(State, 0) | {State(state): count for state, count in rows}

    def change(self, name: str, *, only_from: Sequence[State] = tuple(State), **values: Any) -> bool:
        """Change columns of a job, and record an event; return whether its state was one of `only_from`."""
        with self.transaction() as database:
            assignments = ", ".join(f"{column} = ?" for column in values)
            places = ", ".join("?" for _ in only_from)
            changed = database.execute(
                f"UPDATE jobs SET {assignments} WHERE id = ? AND state IN ({places})",
                (*values.values(), name, *only_from),
            ).rowcount
            if changed:
                self._tell(database, name, "state" if "state" in values else "progress")
        if changed and "state" in values:
            LOG.info("job", extra={"job": name, "state": values["state"], "why": values.get("message", "")})
        return bool(changed)

    def requeue_running(self, why: str) -> None:
        """Put jobs whose process has gone back into the queue, and end those that were being cancelled."""
        for job in self.jobs_in(State.running):
            self.change(job.id, state=State.queued, message=why)
        for job in self.jobs_in(State.cancelling):
            self.change(job.id, state=State.cancelled, ended=time.time())

    def delete(self, name: str) -> bool:
        """Delete an ended job and its events; return whether it had ended. The caller removes its folder."""
        with self.transaction() as database:
            places = ", ".join("?" for _ in ENDED)
            deleted = database.execute(
                f"DELETE FROM jobs WHERE id = ? AND state IN ({places})", (name, *ENDED)
            ).rowcount
            for table in ("events", "requests") if deleted else ():
                database.execute(f"DELETE FROM {table} WHERE job = ?", (name,))
        return bool(deleted)

    # ---- events ----

    def _tell(self, database: sqlite3.Connection, name: str, kind: str) -> None:
        job = self.job(name)
        data = {key: getattr(job, key) for key in ("state", "done", "total", "message")}
        database.execute(
            "INSERT INTO events (job, at, kind, data) VALUES (?, ?, ?, ?)",
            (name, time.time(), kind, json.dumps(data)),
        )

    def events(self, name: str, *, after: int = 0) -> list[Event]:
        """Return the events of a job after a given one, in order."""
        rows = self.rows(
            "SELECT id, job, at, kind, data FROM events WHERE job = ? AND id > ? ORDER BY id LIMIT ?",
            *(name, after, MOST_EVENTS_READ),
        )
        return [Event(number, job, at, kind, json.loads(data)) for number, job, at, kind, data in rows]


def has_begun(folder: Path) -> bool:
    """Return whether the job of a folder was ever started."""
    return (folder / LOG_FILE).exists()


def _link(file: Path, name: Path) -> None:
    try:
        os.link(file, name)
    except FileNotFoundError:
        raise
    except OSError:  # a file system without hard links
        shutil.copyfile(file, name)


_JOB = re.compile(r"[0-9a-f]{32}")
_COLUMNS = ", ".join(one.name for one in fields(Job))


def _job(row: Sequence[Any]) -> Job:
    values = dict(zip((one.name for one in fields(Job)), row, strict=True))
    read = {name: json.loads(values[name]) for name in ("options", "outcomes")}
    return Job(**values | read | {"state": State(values["state"]), "kind": Kind(values["kind"])})

"""What the service knows of its jobs: SQLite beside their folders, the truth that outlives every process.

A job is a scene with its state; its folder `jobs/ID` has `scene.toml`, `log.txt`, and what the command line would
write: `campaign/` of a sweep, `run.nc` else. Events are numbered once and for all, so that a reader who comes back asks
for those after the last one that it has.
"""

from __future__ import annotations

import json
import sqlite3
import threading
import time
import uuid
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from enum import StrEnum
from pathlib import Path
from typing import Any

SCHEMA = """
CREATE TABLE IF NOT EXISTS jobs (
    number INTEGER PRIMARY KEY AUTOINCREMENT, id TEXT NOT NULL UNIQUE, title TEXT NOT NULL, state TEXT NOT NULL,
    workers INTEGER, sweeps INTEGER NOT NULL, created REAL NOT NULL, started REAL, ended REAL,
    total INTEGER NOT NULL, done INTEGER NOT NULL, attempts INTEGER NOT NULL, message TEXT NOT NULL);
CREATE INDEX IF NOT EXISTS jobs_by_state ON jobs (state, number);
CREATE TABLE IF NOT EXISTS events (
    id INTEGER PRIMARY KEY AUTOINCREMENT, job TEXT NOT NULL, at REAL NOT NULL, kind TEXT NOT NULL, data TEXT NOT NULL);
CREATE INDEX IF NOT EXISTS events_of_job ON events (job, id);
CREATE TABLE IF NOT EXISTS requests (key TEXT PRIMARY KEY, digest TEXT NOT NULL, job TEXT NOT NULL);
"""
DATABASE = "service.sqlite"
MOST_EVENTS_READ = 500
"""Events that one question is answered with."""


class State(StrEnum):
    """Where a job is."""

    queued = "queued"
    running = "running"
    cancelling = "cancelling"
    cancelled = "cancelled"
    failed = "failed"
    done = "done"


ENDED = (State.cancelled, State.failed, State.done)
"""States from which nothing goes on by itself."""


@dataclass(frozen=True, slots=True)
class Job:
    """A scene that was submitted.

    Attributes
    ----------
    number : int
        In the order of submission, from 1.
    id : str
        32 hexadecimal digits.
    title : str
        Of its scene.
    state : State
    workers : int or None
        Worker processes; None: one for each processor.
    sweeps : bool
        Whether it is a campaign, and not one run.
    created, started, ended : float or None
        Seconds since 1970.
    total, done : int
        Points; 0 of 0 before it has begun.
    attempts : int
        How often it was started.
    message : str
        Why it is where it is, in words; empty where nothing is to be said.
    """

    number: int
    id: str
    title: str
    state: State
    workers: int | None
    sweeps: bool
    created: float
    started: float | None
    ended: float | None
    total: int
    done: int
    attempts: int
    message: str


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened to a job: its number, when (seconds since 1970), what, and the job as it was then."""

    id: int
    job: str
    at: float
    kind: str
    data: dict[str, Any]


class KeyReusedError(Exception):
    """An idempotency key came with another request than the first time."""


class Store:
    """The jobs of one folder.

    Parameters
    ----------
    folder : Path
        Of the service; the database is `service.sqlite` in it.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._lock = threading.RLock()
        self._connection = sqlite3.connect(folder / DATABASE, check_same_thread=False, isolation_level=None)
        self._connection.execute("PRAGMA journal_mode = WAL")
        self._connection.execute("PRAGMA synchronous = FULL")  # what was accepted survives a power cut
        self._connection.executescript(SCHEMA)

    def close(self) -> None:
        """Close the database."""
        with self._lock:
            self._connection.close()

    @contextmanager
    def _transaction(self) -> Iterator[sqlite3.Connection]:
        with self._lock:
            self._connection.execute("BEGIN IMMEDIATE")
            try:
                yield self._connection
            except BaseException:
                self._connection.execute("ROLLBACK")
                raise
            self._connection.execute("COMMIT")

    def folder_of(self, job: str) -> Path:
        """Return the folder of a job."""
        return self.folder / "jobs" / job

    def scene_of(self, job: str) -> Path:
        """Return the scene file of a job."""
        return self.folder_of(job) / "scene.toml"

    def dataset_of(self, job: Job) -> Path:
        """Return where the dataset of a job is, once it is done."""
        folder = self.folder_of(job.id)
        return folder / "campaign" / "dataset.nc" if job.sweeps else folder / "run.nc"

    # ---- jobs ----

    def submit(
        self, text: str, *, title: str, sweeps: bool, workers: int | None, key: str = "", digest: str = ""
    ) -> tuple[Job, bool]:
        """Accept a scene; return its job, and whether it is new.

        Parameters
        ----------
        text : str
            The scene.
        title : str
        sweeps : bool
        workers : int or None
        key, digest : str
            Idempotency key and hash of the request; the same pair again is the same job.

        Raises
        ------
        KeyReusedError
            The key came with another digest before.
        """
        with self._transaction() as database:
            if key:
                known = database.execute("SELECT digest, job FROM requests WHERE key = ?", (key,)).fetchone()
                if known is not None:
                    if known[0] != digest:
                        raise KeyReusedError
                    return self.job(known[1]), False
            name = uuid.uuid4().hex
            folder = self.folder_of(name)
            folder.mkdir(parents=True)
            self.scene_of(name).write_text(text, encoding="utf-8")
            database.execute(
                "INSERT INTO jobs (id, title, state, workers, sweeps, created, total, done, attempts, message) "
                "VALUES (?, ?, ?, ?, ?, ?, 0, 0, 0, '')",
                (name, title, State.queued, workers, sweeps, time.time()),
            )
            if key:
                database.execute("INSERT INTO requests VALUES (?, ?, ?)", (key, digest, name))
            self._tell(database, name, "state")
            return self.job(name), True

    def job(self, name: str) -> Job:
        """Return a job.

        Raises
        ------
        KeyError
            There is none of this name.
        """
        with self._lock:
            row = self._connection.execute(f"SELECT {_COLUMNS} FROM jobs WHERE id = ?", (name,)).fetchone()
        if row is None:
            raise KeyError(name)
        return _job(row)

    def jobs(self, *, before: int | None = None, most: int = 100) -> list[Job]:
        """Return jobs, the newest first.

        Parameters
        ----------
        before : int, optional
            Only those of lower number.
        most : int
        """
        with self._lock:
            rows = self._connection.execute(
                f"SELECT {_COLUMNS} FROM jobs WHERE number < ? ORDER BY number DESC LIMIT ?",
                (2**62 if before is None else before, most),
            ).fetchall()
        return [_job(row) for row in rows]

    def next_queued(self) -> Job | None:
        """Return the job that has waited longest."""
        with self._lock:
            row = self._connection.execute(
                f"SELECT {_COLUMNS} FROM jobs WHERE state = ? ORDER BY number LIMIT 1", (State.queued,)
            ).fetchone()
        return None if row is None else _job(row)

    def counts(self) -> dict[State, int]:
        """Return how many jobs are in each state."""
        with self._lock:
            rows = self._connection.execute("SELECT state, COUNT(*) FROM jobs GROUP BY state").fetchall()
        return dict.fromkeys(State, 0) | {State(state): count for state, count in rows}

    def change(self, name: str, *, only_from: Sequence[State] = tuple(State), **values: Any) -> bool:
        """Change columns of a job, and tell it as an event; return whether it was in one of the states named."""
        with self._transaction() as database:
            assignments = ", ".join(f"{column} = ?" for column in values)
            places = ", ".join("?" for _ in only_from)
            changed = database.execute(
                f"UPDATE jobs SET {assignments} WHERE id = ? AND state IN ({places})",
                (*values.values(), name, *only_from),
            ).rowcount
            if changed:
                self._tell(database, name, "state" if "state" in values else "progress")
            return bool(changed)

    def requeue_running(self) -> None:
        """Put the jobs that a dead service was running back into the queue, and end those it was to cancel."""
        with self._lock:
            for job in self.jobs(most=2**31):
                if job.state == State.running:
                    self.change(job.id, state=State.queued, message="the service was restarted")
                elif job.state == State.cancelling:
                    self.change(job.id, state=State.cancelled, ended=time.time())

    def delete(self, name: str) -> None:
        """Forget a job and its events; its folder is the caller's."""
        with self._transaction() as database:
            for table, column in (("events", "job"), ("requests", "job"), ("jobs", "id")):
                database.execute(f"DELETE FROM {table} WHERE {column} = ?", (name,))

    # ---- events ----

    def _tell(self, database: sqlite3.Connection, name: str, kind: str) -> None:
        job = self.job(name)
        data = {key: getattr(job, key) for key in ("state", "done", "total", "message")}
        database.execute(
            "INSERT INTO events (job, at, kind, data) VALUES (?, ?, ?, ?)",
            (name, time.time(), kind, json.dumps(data)),
        )

    def events(self, name: str, *, after: int = 0) -> list[Event]:
        """Return the events of a job after one of them, in their order."""
        with self._lock:
            rows = self._connection.execute(
                "SELECT id, job, at, kind, data FROM events WHERE job = ? AND id > ? ORDER BY id LIMIT ?",
                (name, after, MOST_EVENTS_READ),
            ).fetchall()
        return [Event(number, job, at, kind, json.loads(data)) for number, job, at, kind, data in rows]


_COLUMNS = ", ".join(field.name for field in fields(Job))


def _job(row: Sequence[Any]) -> Job:
    values = dict(zip((field.name for field in fields(Job)), row, strict=True))
    return Job(**values | {"state": State(values["state"]), "sweeps": bool(values["sweeps"])})

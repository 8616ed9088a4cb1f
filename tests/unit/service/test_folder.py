"""The folder of a service with foreign changes: one error each, and foreign files stay."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from vibroimpact.fmus.errors import UsageError
from vibroimpact.service import ownership
from vibroimpact.service.ownership import refuse_foreign_folder
from vibroimpact.service.recordings import RecordingStore
from vibroimpact.service.security import token_of
from vibroimpact.service.store import DATABASE, LAYOUT, Kind, NewJob, State, Store


@pytest.mark.parametrize(
    ("make", "why"),
    [
        (lambda path: path.write_bytes(b""), "an empty file"),
        (lambda path: path.write_bytes(b"\xff\xfe\0"), "no text of ASCII"),
        (lambda path: path.write_bytes("schlüssel".encode()), "no text of ASCII"),
        (lambda path: path.write_bytes(b"two words\n"), "blanks in it"),
        (lambda path: path.write_bytes(b"two\nlines\n"), "blanks in it"),
        (lambda path: path.mkdir(), "Is a directory"),
        (lambda path: path.symlink_to("nowhere/token"), "No such file"),
    ],
)
def test_what_is_no_token_is_refused(tmp_path: Path, make: Callable[[Path], object], why: str) -> None:
    make(tmp_path / "token")
    (tmp_path / "token").chmod(0o700) if (tmp_path / "token").exists() else None
    with pytest.raises(UsageError, match=f"expected a.* token, got {why}"):
        token_of(tmp_path)


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="folders of users are kept apart by the system itself")
@pytest.mark.parametrize("foreign", ["", "token", DATABASE, f"{DATABASE}-wal", "jobs", "fmus", "url"])
def test_a_folder_or_anything_believed_in_it_of_another_user_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, foreign: str
) -> None:
    folder = tmp_path / "service"
    folder.mkdir()
    path = folder / foreign
    if foreign:
        path.touch()
    (folder / DATABASE).touch()
    owners = {path: os.geteuid() + 1}

    def status(of: Path) -> object:
        return SimpleNamespace(st_uid=owners.get(of, os.lstat(of).st_uid))

    refuse_foreign_folder(folder, DATABASE)
    monkeypatch.setattr(ownership.os, "stat", status)
    with pytest.raises(
        UsageError, match=f"{foreign or 'service'}: expected a path of your own, got one of user"
    ):
        refuse_foreign_folder(folder, DATABASE)


@pytest.mark.parametrize("content", [b"no database" * 1000, b"SQLite format 3\0" + bytes(84) + b"x" * 900])
def test_what_is_no_database_is_refused_and_stays(tmp_path: Path, content: bytes) -> None:
    (tmp_path / DATABASE).write_bytes(content)
    with pytest.raises(UsageError, match="expected the database of a service, got"):
        Store(tmp_path)
    assert (tmp_path / DATABASE).read_bytes() == content


def test_a_database_of_the_same_layout_without_its_tables_gets_them(tmp_path: Path) -> None:
    with sqlite3.connect(tmp_path / DATABASE) as made:
        made.execute(f"PRAGMA user_version = {LAYOUT}")
    made.close()
    store = Store(tmp_path)
    assert store.jobs() == []
    store.close()


def test_an_older_database_takes_nothing_from_what_was_computed_since(tmp_path: Path) -> None:
    store = Store(tmp_path)
    jobs = [store.submit(NewJob(Kind.run, "computed", "a scene"))[0] for _ in range(3)]
    folders = [store.folder_of(job.id) for job in jobs]
    (folders[0] / "log.txt").touch()
    (tmp_path / "jobs" / "notes.txt").write_text("of a person", encoding="utf-8")
    recordings = RecordingStore(store)
    recordings.path("a" * 32).touch()
    store.change(jobs[2].id, state=State.done)
    (folders[2] / "log.txt").touch()
    with store.transaction() as database:
        database.execute("DELETE FROM jobs WHERE id != ?", (jobs[2].id,))
    store.remove_strays()
    RecordingStore(store)
    assert [folder.is_dir() for folder in folders] == [True, False, True], "only what never began goes"
    assert (tmp_path / "jobs" / "notes.txt").is_file()
    assert recordings.path("a" * 32).is_file()
    store.close()


def test_a_kill_while_a_job_is_deleted_leaves_nothing_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = Store(tmp_path)
    job, _ = store.submit(NewJob(Kind.run, "deleted", "a scene"))
    (store.folder_of(job.id) / "log.txt").touch()
    assert not store.delete(job.id), "it waits"
    store.change(job.id, state=State.done)
    assert store.delete(job.id)
    with monkeypatch.context() as patched:
        patched.setattr("shutil.rmtree", lambda path: None)
        store.remove_folder(job.id)
    assert list((tmp_path / "jobs").iterdir())
    store.remove_strays()
    assert not list((tmp_path / "jobs").iterdir())
    store.close()

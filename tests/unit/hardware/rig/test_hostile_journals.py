"""A malicious journal ends soon, in one line, and the samples before the damage are recovered."""

from __future__ import annotations

import json
import os
import struct
import subprocess
import sys
import time
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from support.command_line import ENTRY, in_this_process

from vibroimpact.analysis.recording import open_recording
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.hardware.rig import journal as journals
from vibroimpact.hardware.rig.acquisition import Block
from vibroimpact.hardware.rig.journal import TITLE, Journal, read_journal

MOST_SECONDS, MOST_MEMORY = 10.0, 500e6
"""Maximum processor time, s, and memory, bytes, of a command."""
HEADER = {
    "program": "record",
    "rig": "virtual",
    "device": "Dev1",
    "product": "board",
    "rate": 1000.0,
    "skew": 0.0,
    "inputs": [{"name": "tip", "terminal": "ai0", "highest": 5.0, "low": -5.0, "high": 5.0, "step": 1e-3}],
}
SAMPLES = np.arange(10.0).reshape(1, 10) / 10.0


def begun(path: Path) -> Path:
    """Write a journal of ten valid samples."""
    with Journal(path, HEADER) as journal:
        journal.note(started_at="now")
        journal.append(Block(0, SAMPLES))
    return path


def head(kind: bytes, length: int, first: int = 0, checksum: int = 0) -> bytes:
    return struct.pack("<4sIQI", kind, length, first, checksum)


def record(kind: bytes, content: bytes, first: int = 0) -> bytes:
    """Return a record with a correct checksum."""
    start = head(kind, len(content), first)[:-4]
    return start + zlib.crc32(content, zlib.crc32(start)).to_bytes(4, "little") + content


def heads_that_promise_the_rest(size: int) -> bytes:
    whole, each = bytearray(size), len(head(b"SAMP", 0))
    for place in range(0, size - each, 2000):
        whole[place : place + each] = head(b"SAMP", size - place - each, 10)
    return bytes(whole)


HARM: dict[str, Callable[[int], bytes]] = {
    "heads that promise the rest": heads_that_promise_the_rest,
    "heads that promise anything": lambda size: head(b"SAMP", 2**32 - 1) * (size // 20),
    "nothing but the word": lambda size: b"SAMP" * (size // 4),
    "random bytes": lambda size: np.random.default_rng(1).bytes(size),
    "one endless line": lambda size: b"[" * size,
    "zeros": bytes,
    "headers that promise the rest": lambda size: head(b"HEAD", size) * (size // 20),
    "a note that is nested": lambda size: record(b"NOTE", b"[" * min(size, 2**20)),
    "a note of many lists": lambda size: record(b"NOTE", b'{"a": [' + b"[]," * 20_000 + b"1]}"),
    "a note that is no JSON": lambda size: record(b"NOTE", b"{"),
}


DEAR = ("heads that promise anything", "nothing but the word")


@pytest.mark.parametrize(
    "harm", [pytest.param(harm, marks=[pytest.mark.long] if harm in DEAR else []) for harm in HARM]
)
def test_damage_that_is_made_to_cost_time_ends_soon_and_the_samples_before_it_are_there(
    tmp_path: Path, harm: str
) -> None:
    path = begun(tmp_path / "a.journal")
    with path.open("ab") as file:
        file.write(HARM[harm](20_000_000))
        file.write(record(b"SAMP", SAMPLES.tobytes(), 50) if harm.startswith("a note") else b"")
    began = time.process_time()
    found = read_journal(path)
    assert time.process_time() - began < MOST_SECONDS
    np.testing.assert_array_equal(found.blocks[0].volts, SAMPLES)
    assert [block.first for block in found.blocks] == [0, 50][: len(found.blocks)]
    assert len(found.blocks) == (2 if harm.startswith("a note") else 1)
    assert found.notes == [{"started_at": "now"}]
    assert found.lost_bytes > 0


def test_the_bytes_that_are_looked_at_are_bounded_not_the_places(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = begun(tmp_path / "a.journal")
    with path.open("ab") as file:
        file.write(b"SAMP" * 20_000)  # more places than the former limit of attempts
        file.write(record(b"SAMP", SAMPLES.tobytes(), 50))
    assert [block.first for block in read_journal(path).blocks] == [0, 50]
    summed: list[int] = []
    checksum = zlib.crc32

    def counted(content: bytes, *begun_with: int) -> int:
        summed.append(len(content))
        return checksum(content, *begun_with)

    with path.open("ab") as file:
        file.write(heads_that_promise_the_rest(4_000_000))
    monkeypatch.setattr(journals, "_MOST_LOOKED", 20_000 * 4096 + 10_000_000)
    monkeypatch.setattr(journals.zlib, "crc32", counted)
    assert len(read_journal(path).blocks) == 2
    assert sum(summed) < 20_000 * 4096 + 20_000_000


@pytest.mark.parametrize(
    ("begin", "made"),
    [
        (b"vibroimpact journal 1\n", lambda header: header + b"\n"),
        (TITLE, lambda header: record(b"HEAD", header)),
    ],
    ids=["a line", "a record"],
)
@pytest.mark.parametrize(
    "header", [b"[" * 1_000_000, b'{"inputs":' * 100_000, b"a" * 30_000_000, b'{"inputs": NaN}'], ids=len
)
def test_a_header_that_is_made_to_harm_is_one_error(
    tmp_path: Path, begin: bytes, made: Callable[[bytes], bytes], header: bytes
) -> None:
    (tmp_path / "a.journal").write_bytes(begin + made(header))
    done = in_this_process("rig", "recover", tmp_path / "a.journal")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "a.journal" in done.stderr


def test_more_notes_than_any_measurement_has_are_refused(tmp_path: Path) -> None:
    path = begun(tmp_path / "a.journal")
    with path.open("ab") as file:
        file.write(record(b"NOTE", b'{"a":0}') * 600_000)
    began = time.process_time()
    with pytest.raises(DatasetError, match=r"a\.journal: expected at most 500000 notes"):
        read_journal(path)
    assert time.process_time() - began < MOST_SECONDS


def test_how_far_was_watched_is_noted_once(tmp_path: Path) -> None:
    path = tmp_path / "a.journal"
    with Journal(path, HEADER) as journal:
        journal.append(Block(0, SAMPLES))
        for watched in range(1, 2000):
            journal.note(watched=watched)
        journal.note(ended="")
    assert read_journal(path).notes == [{"watched": 1999}, {"ended": ""}]


def test_many_blocks_are_joined_where_no_sample_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, volts = tmp_path / "a.journal", np.random.default_rng(2).normal(size=(1, 300))
    with Journal(path, HEADER) as journal:
        for first in range(300):
            journal.append(Block(first + (first >= 100), volts[:, first : first + 1]))
    monkeypatch.setattr(journals, "_FEW_PIECES", 8)
    blocks = read_journal(path).blocks
    assert len(blocks) < 12
    np.testing.assert_array_equal(np.concatenate([block.volts for block in blocks], axis=1), volts)
    assert all(block.end <= 100 or block.first >= 101 for block in blocks)
    monkeypatch.setattr(journals, "_MOST_PIECES", 4)
    with pytest.raises(DatasetError, match="expected at most 2 pieces of samples"):
        read_journal(path)


def test_a_sample_that_is_far_away_takes_no_memory_for_those_between(tmp_path: Path) -> None:
    path = begun(tmp_path / "a.journal")
    with path.open("ab") as file:
        file.write(record(b"SAMP", SAMPLES.tobytes(), 40_000_000))
    done = in_this_process("rig", "recover", path)
    assert done.returncode == 0, done.stderr
    tip = open_recording(tmp_path / "a.nc").channel("tip")
    np.testing.assert_array_equal(tip.values, np.tile(SAMPLES[0], 2))


@pytest.mark.parametrize(
    "note",
    [
        {"gap": {"first": 10**300, "samples": 1, "doubt": 0.0, "reason": "none"}},
        {"gap": {"first": -5, "samples": 3, "doubt": 0.0, "reason": "none"}},
        {"gap": {"first": 5, "samples": -3, "doubt": 0.0, "reason": "none"}},
        {"gap": {"first": 5, "samples": 2**62, "doubt": 0.0, "reason": "none"}},
        {"watched": 2**70},
        {"gap": {"first": 5}},
    ],
    ids=str,
)
def test_a_note_of_impossible_samples_is_one_error(tmp_path: Path, note: dict[str, object]) -> None:
    path = begun(tmp_path / "a.journal")
    with path.open("ab") as file:
        file.write(record(b"NOTE", json.dumps(note).encode()))
    done = in_this_process("rig", "recover", path)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes in the file system")
def test_what_is_no_file_is_no_journal(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.journal")
    for path in (tmp_path / "pipe.journal", Path("/dev/zero")):
        with pytest.raises(UsageError, match="expected a journal, got something that is no file"):
            read_journal(path)


GIGABYTES: dict[str, Callable[[int], bytes]] = {
    "zeros": lambda _: b"",
    "heads that promise the rest": lambda size: head(b"SAMP", min(size, 2**32 - 1), 10) * 50_000,
    "one record of all": lambda size: head(b"SAMP", min(size, 2**32 - 1) // 8 * 8, 10),
}


@pytest.mark.long
@pytest.mark.skipif(sys.platform != "linux", reason="peak memory of a child is read as Linux gives it")
@pytest.mark.parametrize("harm", GIGABYTES)
@pytest.mark.parametrize("has_samples", [True, False], ids=["after samples", "alone"])
def test_gigabytes_end_within_ten_seconds_and_half_a_gigabyte(
    tmp_path: Path, harm: str, has_samples: bool
) -> None:
    path, size = tmp_path / "a.journal", 4 * 2**30
    if has_samples:
        begun(path)
    else:
        path.write_bytes(TITLE + record(b"HEAD", json.dumps(HEADER).encode()))
    with path.open("ab") as file:
        file.write(GIGABYTES[harm](size - 2_000_000))
        file.truncate(size)
    with (tmp_path / "said").open("wb") as said:
        child = subprocess.Popen(
            [sys.executable, "-c", ENTRY, "rig", "recover", path], stdout=said, stderr=said
        )
        _, status, used = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    text = (tmp_path / "said").read_text()
    assert child.returncode == (0 if has_samples else 2), text
    assert text.count("\n") < 20
    assert used.ru_utime + used.ru_stime < MOST_SECONDS
    assert used.ru_maxrss * 1024 < MOST_MEMORY


def test_a_journal_without_samples_is_refused_by_its_name(tmp_path: Path) -> None:
    path = tmp_path / "a.journal"
    path.write_bytes(TITLE + record(b"HEAD", json.dumps(HEADER).encode()) + b"cut")
    done = in_this_process("rig", "recover", path)
    assert done.returncode == 2
    assert done.stderr == (
        f"{path}: expected a journal of 2 samples or more, got 0; 3 of its bytes are damaged or cut off.\n"
    )
    assert not (tmp_path / "a.nc").exists()

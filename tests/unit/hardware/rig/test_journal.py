"""A journal that is cut anywhere, or damaged, yields every intact record."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.hardware.rig import journal as journals
from vibroimpact.hardware.rig.acquisition import Block
from vibroimpact.hardware.rig.journal import Journal, JournalContent, read_journal, refuse_full_disk

HEADER = {"inputs": ["tip", "loop"], "rate": 1000.0}


def written(path: Path, blocks: list[Block], notes: dict[int, Any] | None = None) -> list[int]:
    """Write a journal; return the end of each record of samples."""
    path.unlink(missing_ok=True)
    ends = []
    with Journal(path, HEADER) as journal:
        for place, block in enumerate(blocks):
            if notes and place in notes:
                journal.note(**notes[place])
            journal.append(block)
            ends.append(journal.written)
    return ends


def end_of_header(content: bytes | bytearray) -> int:
    """Return the end of the second copy of the header."""
    text = json.dumps(HEADER).encode()
    return content.rindex(text) + len(text)


def blocks_of(counts: list[int], skip: int = 0) -> list[Block]:
    made, first = [], 0
    for number, count in enumerate(counts):
        made.append(Block(first, np.random.default_rng(number).normal(size=(2, count))))
        first += count + skip
    return made


def same(found: JournalContent, blocks: list[Block]) -> bool:
    return [block.first for block in found.blocks] == [block.first for block in blocks] and all(
        np.array_equal(one.volts, other.volts) for one, other in zip(found.blocks, blocks, strict=True)
    )


def test_what_was_appended_is_read_again(tmp_path: Path) -> None:
    blocks = blocks_of([50, 1, 333], skip=7)
    written(tmp_path / "a.journal", blocks, {1: {"gap": {"first": 50}}})
    found = read_journal(tmp_path / "a.journal")
    assert same(found, blocks)
    assert (found.header, found.notes, found.lost_bytes) == (HEADER, [{"gap": {"first": 50}}], 0)


@given(
    counts=st.lists(st.integers(1, 60), min_size=1, max_size=8),
    part=st.floats(0.0, 1.0),
    garbage=st.binary(max_size=40),
)
@settings(max_examples=60, deadline=None)
def test_a_journal_that_is_cut_at_any_byte_gives_each_whole_record(
    tmp_path_factory: pytest.TempPathFactory, counts: list[int], part: float, garbage: bytes
) -> None:
    path = tmp_path_factory.getbasetemp() / "cut.journal"
    blocks = blocks_of(counts)
    ends = written(path, blocks)
    whole = path.read_bytes()
    start = end_of_header(whole)
    cut = start + round(part * (len(whole) - start))
    path.write_bytes(whole[:cut] + garbage)  # remains that a file system leaves after the cut
    assert same(read_journal(path), [block for block, end in zip(blocks, ends, strict=True) if end <= cut])


@given(place=st.floats(0.0, 1.0), bit=st.integers(0, 7))
@settings(max_examples=60, deadline=None)
def test_a_flipped_bit_costs_one_record(
    tmp_path_factory: pytest.TempPathFactory, place: float, bit: int
) -> None:
    path = tmp_path_factory.getbasetemp() / "flipped.journal"
    blocks = blocks_of([20, 30, 40, 50])
    ends = written(path, blocks)
    content = bytearray(path.read_bytes())
    start = end_of_header(content)
    hit = start + round(place * (len(content) - start - 1))
    content[hit] ^= 1 << bit
    path.write_bytes(content)
    found = read_journal(path)
    assert same(
        found,
        [
            block
            for block, end, begin in zip(blocks, ends, [start, *ends], strict=False)
            if not begin <= hit < end
        ],
    )
    assert found.lost_bytes > 0


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"vibroimpact journal 1\n",
        b"vibroimpact journal 1\n{",
        b"vibroimpact journal 1\n[]\n",
        b"vibroimpact journal 1\n{}\n",
        b'vibroimpact journal 1\n{"inputs": 3}\n',
        b"vibroimpact journal 2\n",
        b"vibroimpact journal 2\nHEAD",
        b"vibroimpact journal 2\n" + b"HEAD" * 1000,
        b'vibroimpact journal 2\n{"inputs": ["tip", "loop"]}\n',
        b"vibroimpact journal 2\n" + journals._record(b"HEAD", 0, b"[]"),
        b"vibroimpact journal 2\n" + journals._record(b"HEAD", 0, b"[" * 100_000),
        b"vibroimpact journal 2\n" + journals._record(b"HEAD", 0, b'{"inputs": 3}'),
        b"vibroimpact journal 2\n" + journals._record(b"SAMP", 0, bytes(16)),
        b"CDF\x01 and so on\n{}\n",
    ],
)
def test_another_file_is_no_journal(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "none.journal"
    path.write_bytes(content)
    with pytest.raises(DatasetError, match=r"none.journal: .*expected a"):
        read_journal(path)


def test_a_journal_of_a_version_to_come_is_said_to_be_one(tmp_path: Path) -> None:
    path = tmp_path / "new.journal"
    path.write_bytes(b"vibroimpact journal 3\n{}\n")
    with pytest.raises(DatasetError, match=r"expected a journal of version 1 or 2, got version 3\."):
        read_journal(path)


def test_a_journal_of_version_1_is_read(tmp_path: Path) -> None:
    path, blocks = tmp_path / "old.journal", blocks_of([50, 7], skip=3)
    written(path, blocks, {1: {"gap": {"first": 50}}})
    content = path.read_bytes()
    line = b"vibroimpact journal 1\n" + json.dumps(HEADER).encode() + b"\n"
    path.write_bytes(line + content[end_of_header(content) :])
    found = read_journal(path)
    assert same(found, blocks)
    assert (found.header, found.notes, found.lost_bytes) == (HEADER, [{"gap": {"first": 50}}], 0)


def test_damage_of_one_copy_of_the_header_costs_nothing_but_is_told(tmp_path: Path) -> None:
    path, blocks = tmp_path / "a.journal", blocks_of([50, 7])
    written(path, blocks)
    whole = path.read_bytes()
    size = (end_of_header(whole) - len(journals.TITLE)) // 2
    for hit in range(len(journals.TITLE), len(journals.TITLE) + 2 * size):
        content = bytearray(whole)
        content[hit] ^= 1
        path.write_bytes(content)
        found = read_journal(path)
        assert (found.header, found.lost_bytes) == (HEADER, size)
        assert same(found, blocks)


def test_an_input_that_damage_drops_from_the_header_gives_no_other_samples(tmp_path: Path) -> None:
    path, blocks = tmp_path / "a.journal", blocks_of([50, 7])
    written(path, blocks)
    dropped = path.read_bytes().replace(b'["tip", "loop"]', b'["tip"        ]')
    path.write_bytes(dropped)
    with pytest.raises(DatasetError, match=r"a\.journal: expected a journal of .* got .* a damaged one"):
        read_journal(path)


def test_a_journal_is_not_overwritten_and_not_read_while_it_grows(tmp_path: Path) -> None:
    path = tmp_path / "a.journal"
    with Journal(path, HEADER) as journal:
        journal.append(blocks_of([5])[0])
        with pytest.raises(UsageError, match="still being written"):
            read_journal(path)
        assert len(read_journal(path, ended=False).blocks) == 1
    with pytest.raises(UsageError, match="expected no journal of an earlier measurement, got one"):
        Journal(path, HEADER)
    assert len(read_journal(path).blocks) == 1


def test_a_journal_without_samples_goes_away(tmp_path: Path) -> None:
    path = tmp_path / "a.journal"
    with Journal(path, HEADER) as journal:
        journal.note(started_at="now")
    assert not path.exists()


def test_samples_are_forced_to_the_disk_about_once_a_second(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now, forced = [100.0], []
    monkeypatch.setattr(journals.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(journals.os, "fsync", lambda handle: forced.append(now[0]))
    with Journal(tmp_path / "a.journal", HEADER) as journal:
        for block in blocks_of([10] * 50):
            now[0] += 0.1
            journal.append(block)
    assert len(forced) >= 5
    assert max(np.diff(forced)) < 1.2


def test_a_disk_without_room_is_refused_before(tmp_path: Path) -> None:
    refuse_full_disk(tmp_path, 1.0)
    with pytest.raises(UsageError, match="MiB of free space for the journal and the recording"):
        refuse_full_disk(tmp_path, 1e18)

"""The process that reads untrusted files: its answers are bounded, and never a pickle."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from vibroimpact.fmus import reader_process
from vibroimpact.fmus.reader_process import Answer, Order, ReaderServer

CHILD = """
import json, os, sys
from vibroimpact.fmus import reader_child
sys.modules["reader"] = sys.modules["__main__"]
def read(path, options):
    {what}
reader_child.main()
"""
ORDER = Order("reader:read", "/file", {"size": 3}, 10.0, 4 << 30, most_bytes=1 << 20)


@pytest.fixture
def reader(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], ReaderServer]]:
    servers = []

    def set_up(what: str) -> ReaderServer:
        child = tmp_path / "child.py"
        child.write_text(CHILD.format(what=what))
        monkeypatch.setattr(reader_process, "_CHILD", child)
        servers.append(ReaderServer())
        return servers[-1]

    yield set_up
    for server in servers:
        server.close()


def test_facts_and_bytes_come_back_as_they_are(reader: Callable[[str], ReaderServer]) -> None:
    server = reader("return {'path': path, 'x': 0.1, 'text': '\\ud800'}, [b'abc', bytes(900_000), b'']")
    for _ in range(2):
        answer = server.ask(ORDER)
        assert answer.facts == {"path": "/file", "x": 0.1, "text": "\ud800"}
        assert [bytes(buffer) for buffer in answer.buffers] == [b"abc", bytes(900_000), b""]


def test_more_bytes_than_were_asked_for_are_no_answer(reader: Callable[[str], ReaderServer]) -> None:
    assert reader("return None, [bytes(2_000_000)]").ask(ORDER).verdict == "died"


@pytest.mark.parametrize(
    "answer",
    [
        b'{"verdict": "read", "sizes": [-1]}\n',
        b'{"verdict": "read", "sizes": [9999999999]}\n',
        b'{"verdict": "read", "sizes": [4]}\nabc',
        b'{"verdict": "read", "sizes": 4}\n',
        b'{"sizes": []}\n',
        b"[" * 90_000 + b"\n",
        b"[]\n",
        b"\x80\x04N.\n",
        b"",
    ],
)
def test_an_answer_that_is_none_of_ours_is_a_file_that_crashes_its_reader(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, answer: bytes
) -> None:
    """A file may have taken over the process, which then sends anything."""
    child = tmp_path / "child.py"
    child.write_text(
        f"import sys; sys.stdin.readline(); sys.stdout.buffer.write({answer!r}); sys.stdout.buffer.flush()"
    )
    monkeypatch.setattr(reader_process, "_CHILD", child)
    server = ReaderServer()
    found = server.ask(ORDER)
    server.close()
    assert found.verdict == "died"
    assert found.why(1.0) == "one that crashes the library which reads it (it ended without an answer)"


def test_errors_of_the_system_keep_their_number(reader: Callable[[str], ReaderServer]) -> None:
    answer = reader("open('/nowhere')").ask(ORDER)
    assert (answer.verdict, answer.error) == ("raised", "FileNotFoundError")
    assert isinstance(answer.raised, FileNotFoundError)


def test_a_loop_that_does_not_end_and_a_memory_without_end_are_answers(
    reader: Callable[[str], ReaderServer],
) -> None:
    server = reader("return (list(iter(int, 1)) if options['size'] else [0 for _ in iter(int, 1)]), ()")
    order = replace(ORDER, seconds=0.3)
    assert server.ask(replace(order, options={"size": 0})).verdict in ("late", "raised")
    assert server.ask(replace(ORDER, memory=1 << 29)).error == "MemoryError"


@pytest.mark.parametrize(
    ("of_fork", "asks"),
    [
        (None, True),
        (Answer("died", error="11"), True),
        (Answer("died"), True),
        (Answer("died", error="9"), False),
        (Answer("late", error="27"), False),
        (Answer("raised", error="ValueError"), False),
        (Answer("read"), False),
    ],
)
def test_a_fresh_process_tells_whether_a_crash_is_of_the_file(
    of_fork: Answer | None, asks: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    of_server = Answer("read", facts="by the server")
    monkeypatch.setattr(reader_process, "FORKS", True)
    monkeypatch.setattr(reader_process, "read_in_fork", lambda order: of_fork)
    monkeypatch.setattr(reader_process._server, "ask", lambda order: of_server)
    assert reader_process.read_apart(ORDER) is (of_server if asks else of_fork)

"""A command of one thread lets a fork of itself read files: nothing is imported again, and nothing is left behind."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import psutil
import pytest
from harness import warm

from vibroimpact.fmus import confinement, reader_fork
from vibroimpact.fmus.reader_fork import WAITING, allow_forks, may_fork, read_in_fork
from vibroimpact.fmus.reader_orders import Answer, Order
from vibroimpact.fmus.wording import command_line

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="no process is forked there")
ORDER = Order("reader:read", "/file", {}, 10.0, 1 << 30, most_bytes=1 << 20)


@pytest.fixture
def read(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Answer | None]:
    """Return how a fork of this process reads a file by a function of a test."""

    def set_up(what: Callable[[str, dict[str, Any]], Any], **changes: Any) -> Answer | None:
        module = ModuleType("reader")
        module.read = what  # type: ignore[attr-defined]
        monkeypatch.setitem(sys.modules, "reader", module)
        return read_in_fork(replace(ORDER, **changes))

    return set_up


def test_facts_and_bytes_come_back_and_nothing_else_does(read: Callable[..., Answer]) -> None:
    answer = read(lambda path, options: ({"path": path, "pid": os.getpid()}, [b"abc", bytes(900_000)]))
    assert answer.verdict == "read"
    assert answer.facts["path"] == "/file"
    assert answer.facts["pid"] != os.getpid()
    assert [bytes(buffer) for buffer in answer.buffers] == [b"abc", bytes(900_000)]
    assert psutil.Process().children() == []


def test_it_has_no_descriptor_of_the_program_that_it_was_made_from(
    tmp_path: Path, read: Callable[..., Answer]
) -> None:
    with (tmp_path / "open").open("w") as file:

        def look(path: str, options: dict[str, Any]) -> tuple[dict[str, str], tuple[()]]:
            there = [int(name) for name in os.listdir("/proc/self/fd")]
            return {
                str(n): os.readlink(f"/proc/self/fd/{n}") for n in there if n <= 3 or n == file.fileno()
            }, ()

        found = read(look).facts
        assert [found[number] for number in "012"] == ["/dev/null"] * 3
        assert found.pop("3").startswith("pipe:")
        assert len(found) == 3


def ends(number: int) -> Callable[[str, dict[str, Any]], None]:
    return lambda path, options: os.kill(os.getpid(), number)


@pytest.mark.parametrize(
    ("what", "verdict", "error"),
    [
        (ends(signal.SIGSEGV), "died", "11"),
        (ends(signal.SIGPROF), "late", "27"),
        (lambda path, options: os._exit(0), "died", ""),
        (lambda path, options: (None, [bytes(2_000_000)]), "died", None),  # more than was asked for
        (lambda path, options: os.write(3, b"[" * 9_000 + b"\n") and signal.pause(), "died", None),
        (lambda path, options: bytearray(1 << 31), "raised", "MemoryError"),
        (lambda path, options: sys.exit(3), "raised", "SystemExit"),
        (lambda path, options: Path("/file").read_text(), "raised", "FileNotFoundError"),
    ],
)
def test_whatever_a_file_does_to_it_is_an_answer(
    read: Callable[..., Answer], what: Callable[..., Any], verdict: str, error: str | None
) -> None:
    answer = read(what)
    assert answer.verdict == verdict
    assert error is None or answer.error == error


def test_a_loop_that_does_not_end_is_late(
    read: Callable[..., Answer], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(confinement, "PATIENCE", 1000.0)  # the machine may be busy
    assert read(lambda path, options: any(iter(int, 1)), seconds=0.2).verdict == "late"


def test_a_fork_that_waited_says_nothing_of_the_file(
    read: Callable[..., Answer | None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A lock that a lost thread holds is never released: the server reads the file then."""
    assert read(lambda path, options: time.sleep(60), seconds=0.03) is None
    monkeypatch.setattr(reader_fork, "GRACE", 0.0)
    monkeypatch.setattr(reader_fork, "PATIENCE", 1.0)
    answer = read(lambda path, options: signal.pause(), seconds=0.1)
    assert answer is not None
    assert answer.verdict == "died"


def test_a_program_of_another_is_not_forked() -> None:
    assert not may_fork()
    with command_line():
        assert may_fork()


def test_threads_that_may_hold_a_lock_forbid_a_fork(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reader_fork, "_own_program", False)
    allow_forks()
    assert may_fork()
    for name, forks in ((WAITING, True), ("another", False)):
        ended = threading.Event()
        thread = threading.Thread(target=ended.wait, name=name)
        thread.start()
        assert may_fork() == forks
        ended.set()
        thread.join()
    found: list[bool] = []
    thread = threading.Thread(target=lambda: found.append(may_fork()))
    thread.start()
    thread.join()
    assert found == [False]


PROGRAM = """
import sys, time, types
from vibroimpact.fmus.reader_fork import read_in_fork
from vibroimpact.fmus.reader_orders import Order
module = sys.modules["reader"] = types.ModuleType("reader")
module.read = lambda path, options: time.sleep(600)
try:
    read_in_fork(Order("reader:read", "/file", {}, 100.0, 1 << 30))
except KeyboardInterrupt:
    raise SystemExit(42) from None
"""


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGKILL, -9), (signal.SIGTERM, -15), (signal.SIGINT, 42)]
)
def test_a_program_that_is_ended_leaves_no_process(number: int, code: int) -> None:
    program = warm.start(
        "import signal; signal.signal(2, signal.default_int_handler)\n" + PROGRAM, stdout=None, stderr=None
    )
    below = _wait_for(lambda: psutil.Process(program.pid).children())
    program.send_signal(number)
    assert program.wait() == code
    _wait_for(lambda: not any(p.is_running() and p.status() != "zombie" for p in below))


def _wait_for(happened: Callable[[], Any]) -> Any:
    deadline = time.monotonic() + 60.0
    while not (found := happened()):
        assert time.monotonic() < deadline
        time.sleep(0.02)
    return found

"""A fork of this process reads files: it needs no imports, and leaves nothing behind."""

from __future__ import annotations

import errno
import gc
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
from vibroimpact.fmus.reader_fork import read_in_fork
from vibroimpact.fmus.reader_orders import Answer, Order

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="no process is forked there")
ORDER = Order("reader:read", "/file", {}, 10.0, 1 << 30, most_bytes=1 << 20)


@pytest.fixture
def read(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Answer | None]:
    """Return a function that lets a fork of this process read a file by a reader of the test."""

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
    assert answer.facts["pid"] not in [child.pid for child in psutil.Process().children()]


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
        (lambda path, options: (None, [bytes(2_000_000)]), "died", None),  # more than the order allows
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


def test_what_this_process_has_not_freed_yet_is_not_freed_in_a_fork(read: Callable[..., Answer]) -> None:
    """Freeing such an object in a fork, which lacks its files and threads, crashed the fork before it read."""
    here = os.getpid()

    class Held:
        def __del__(self) -> None:
            if os.getpid() != here:
                os.kill(os.getpid(), signal.SIGSEGV)

    held = Held()
    held.itself = held  # type: ignore[attr-defined]
    del held
    at_once = [gc.collect]
    os.register_at_fork(after_in_child=lambda: [collect() for collect in at_once if gc.isenabled()])
    try:
        assert read(lambda path, options: (gc.collect(), ())).verdict == "read"
    finally:
        at_once.clear()
        gc.collect()


def test_a_loop_that_does_not_end_is_late(
    read: Callable[..., Answer], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(confinement, "PATIENCE", 1000.0)  # the machine may be busy
    assert read(lambda path, options: any(iter(int, 1)), seconds=0.2).verdict == "late"


def test_a_fork_that_waited_says_nothing_of_the_file(
    read: Callable[..., Answer | None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The time limits may pass without any work, on a machine that is too busy to let it compute."""
    assert read(lambda path, options: time.sleep(60), seconds=0.03) is None
    monkeypatch.setattr(reader_fork, "GRACE", 0.0)
    monkeypatch.setattr(reader_fork, "PATIENCE", 1.0)
    answer = read(lambda path, options: signal.pause(), seconds=0.1)
    assert answer is not None
    assert answer.verdict == "died"


def test_a_fork_that_waits_for_a_lock_of_a_lost_thread_is_given_up(
    read: Callable[..., Answer | None], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reader_fork, "PATIENCE_WITH_SLEEP", 0.5)
    lock = threading.Lock()
    with lock:
        began = time.monotonic()
        assert read(lambda path, options: lock.acquire(), seconds=100.0) is None
    assert time.monotonic() - began < 60.0


def test_a_fork_that_computes_or_answers_slowly_is_not_given_up(
    read: Callable[..., Answer], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reader_fork, "PATIENCE_WITH_SLEEP", 0.1)
    monkeypatch.setattr(reader_fork, "_WATCH_INTERVAL", 0.02)

    def work(path: str, options: dict[str, Any]) -> tuple[None, list[bytes]]:
        until = time.process_time() + 0.5
        while time.process_time() < until:
            pass
        return None, [bytes(900_000)]

    assert read(work).verdict == "read"


def test_a_thread_of_many_reads_by_a_fork(read: Callable[..., Answer]) -> None:
    found: list[str] = []
    ended = threading.Event()
    others = [threading.Thread(target=ended.wait) for _ in range(3)]
    reads = [
        threading.Thread(target=lambda: found.append(read(lambda path, options: (path, ())).verdict))
        for _ in range(3)
    ]
    for thread in (*others, *reads):
        thread.start()
    for thread in reads:
        thread.join()
    ended.set()
    for thread in others:
        thread.join()
    assert found == ["read"] * 3


def test_a_program_that_takes_the_ends_of_all_its_processes_reads_all_the_same(
    read: Callable[..., Answer], monkeypatch: pytest.MonkeyPatch
) -> None:
    def gone(process: int, options: int) -> tuple[int, int]:
        raise ChildProcessError

    waitpid = os.waitpid
    monkeypatch.setattr(os, "waitpid", gone)
    assert read(lambda path, options: (path, ())).verdict == "read"
    monkeypatch.setattr(os, "waitpid", waitpid)
    os.waitpid(-1, 0)


def test_without_room_for_a_fork_nothing_is_said(
    read: Callable[..., Answer | None], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse() -> int:
        raise OSError(errno.ENOMEM, os.strerror(errno.ENOMEM))

    monkeypatch.setattr(os, "fork", refuse)
    assert read(lambda path, options: (path, ())) is None


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

"""A copy of the warm process behaves like a newly started Python for the process that started it."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import psutil
import pytest

from harness import warm

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the warm process runs on Linux alone")

ENDS = {
    "nothing": "pass",
    "a code": "import sys; sys.exit(3)",
    "words": "import sys; sys.exit('words')",
    "an exception": "1 / 0",
    "Ctrl-C": "raise KeyboardInterrupt",
    "a signal": "import os; os.kill(os.getpid(), 9)",
    "an exit function": "import atexit; atexit.register(print, 'at the end')",
    "a thread": "import threading, time; threading.Thread(target=lambda: (time.sleep(.05), print('late'))).start()",
    "a reader that has gone": "import os, sys; os.close(1); print('nowhere')",
    "arguments": "import sys; print(sys.argv, __name__)",
}


@pytest.mark.parametrize("program", ENDS.values(), ids=ENDS)
def test_it_ends_as_a_program_that_is_started_anew(program: str) -> None:
    warm_, cold = (warm.run(program, "a", "b c", cold=cold) for cold in (False, True))
    assert warm_.returncode == cold.returncode
    assert warm_.stdout == cold.stdout
    assert warm_.stderr.splitlines()[-1:] == cold.stderr.splitlines()[-1:]


def test_folder_environment_streams_and_process_group_are_its_own(tmp_path: Path) -> None:
    program = "import os, sys, tempfile; print(os.getcwd(), os.environ['A'], len(os.environ), tempfile.gettempdir(), "
    program += (
        "os.getpgrp() == os.getpid(), os.getsid(0) == os.getpid()); print(sys.stdin.read(), file=sys.stderr)"
    )
    for session in (False, True):
        environment = {"A": "b", "TMPDIR": str(tmp_path)}
        options = {
            "cwd": tmp_path,
            "env": environment,
            "stdin": subprocess.PIPE,
            "start_new_session": session,
        }
        process = warm.start(program, **options)
        assert process.stdin is not None
        process.stdin.write("given")
        process.stdin.close()
        process.stdin = None
        out, err = process.communicate(timeout=30)
        words = out.split()
        assert words[:2] + words[3:] == [str(tmp_path), "b", str(tmp_path), "True", str(session)]
        assert err == "given\n"


def test_the_end_of_one_that_ends_at_once_is_not_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    line = warm.Copy._line

    def late(copy: warm.Copy) -> bytes:
        # both process number and end have arrived before the first is read
        time.sleep(0.1)
        return line(copy)

    monkeypatch.setattr(warm.Copy, "_line", late)
    assert warm.run("pass").returncode == 0


def test_one_that_has_ended_before_its_request_is_seen_to_be_sent_is_no_error(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    send = socket.send_fds

    def late(*given: Any) -> int:
        sent = send(*given)
        time.sleep(0.5)
        return sent

    monkeypatch.setattr(socket, "send_fds", late)
    assert warm.run("pass").returncode == 0


def test_a_signal_reaches_it_alone() -> None:
    program = "import time; print('ready', flush=True); time.sleep(60)"
    first, second = warm.start(program), warm.start(program)
    for process in (first, second):
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
    os.killpg(first.pid, signal.SIGINT)
    assert first.wait(30) == -signal.SIGINT
    assert second.poll() is None
    with pytest.raises(subprocess.TimeoutExpired):
        second.wait(0.05)
    second.kill()
    assert second.wait(30) == -signal.SIGKILL
    for process in (first, second):
        process.communicate()


def test_nothing_stays_where_the_tests_are_killed() -> None:
    program = "from harness import warm; warm.start_server(); warm.wait_for_server(); "
    program += "print(warm.start('import time; time.sleep(600)', stdout=warm.DEVNULL).pid, flush=True); "
    program += "import os; os.kill(os.getpid(), 9)"
    done = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONPATH": str(warm.TESTS)},
    )
    assert done.returncode == -signal.SIGKILL
    sleeper, end = int(done.stdout), time.monotonic() + 60.0
    while _lives(sleeper) and time.monotonic() < end:
        time.sleep(0.05)
    assert not _lives(sleeper)


def _lives(pid: int) -> bool:
    try:
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False

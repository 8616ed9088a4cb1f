"""A process in a session of its own: it prints lines, ends on request, and ends its own children with it."""

from __future__ import annotations

import os
import signal
import sys

import pytest
from support.ends import SECONDS, ended, wait_until

from vibroimpact.fmus.processes.process import Process

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="sessions are those of POSIX")
STARTER = "import subprocess; print(subprocess.Popen(['sleep', '600']).pid, flush=True); input()"


def test_lines_come_one_by_one_and_none_when_nothing_is_said() -> None:
    with Process("-c", "print('a\\nb', flush=True); print(input()); input()") as process:
        assert [process.line(SECONDS), process.line(SECONDS), process.line(0.05)] == ["a", "b", ""]
        process.say([b"more\n", memoryview(b"\n")])
        assert [process.line(SECONDS), process.line(SECONDS)] == ["more", ""]


def test_lines_and_lines_of_errors_come_as_they_are_said_until_the_end() -> None:
    program = "import sys; print('a\\nb'); print('wrong', file=sys.stderr); sys.stdout.buffer.write(b'\\xff')"
    with Process("-c", program, errors="kept") as process:
        assert (list(process.lines()), list(process.lines_of_errors())) == (["a", "b", "\ufffd"], ["wrong"])


def test_one_that_is_interrupted_ends_in_good_order_or_is_killed() -> None:
    good = "import time\ntry:\n print(flush=True); time.sleep(600)\nexcept KeyboardInterrupt:\n raise SystemExit(7)"
    heard = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    deaf = "import signal, time; signal.signal(signal.SIGINT, signal.SIG_IGN); print(flush=True); time.sleep(600)"
    for program, seconds, code in ((heard + good, SECONDS, 7), (deaf, 0.05, -signal.SIGKILL)):
        with Process("-c", program) as process:
            next(process.lines())
            assert process.interrupt(seconds) == code


def test_ctrl_c_of_a_terminal_does_not_reach_it_nor_files_of_the_current_folder() -> None:
    with Process("-c", "import os, sys; print(os.getsid(0) == os.getpid(), '' in sys.path)") as process:
        assert process.line(SECONDS) == "True False"


@pytest.mark.parametrize(
    ("program", "code"), [("input()", 1), ("import sys; sys.stdin.read()", 0), ("import os; os._exit(3)", 3)]
)
def test_it_ends_by_itself_when_its_orders_do(program: str, code: int) -> None:
    with Process("-c", program) as process:
        assert process.end(SECONDS) == code


def test_one_that_does_not_end_is_killed_with_what_it_has_started() -> None:
    program = f"import signal; signal.signal(signal.SIGTERM, signal.SIG_IGN); {STARTER}; signal.pause()"
    with Process("-c", program.replace("; input()", "")) as process:
        started = int(process.line(SECONDS))
        assert process.end(0.05) == -signal.SIGKILL
    wait_until(lambda: ended(started))


def test_what_it_leaves_in_its_session_is_killed_after_its_end() -> None:
    with Process("-c", STARTER) as process:
        started = int(process.line(SECONDS))
        process.say([b"\n"])
        assert process.end(SECONDS) == 0
        assert not ended(started)
        process.kill_session()
    wait_until(lambda: ended(started))
    process.kill_session()


def test_orders_to_one_that_is_gone_are_lost_without_an_error() -> None:
    with Process("-c", "pass") as process:
        process.wait(SECONDS)
        process.say([b"order"])
        assert process.line(SECONDS) == ""
        assert process.end(SECONDS) == 0


def test_it_has_descriptors_that_are_passed_and_no_other() -> None:
    passed, kept = os.pipe()
    program = f"import os, sys; print([os.path.exists(f'/dev/fd/{{n}}') for n in ({passed}, {kept})])"
    with Process("-c", program, passed=[passed]) as process:
        assert process.line(SECONDS) == "[True, False]"
    os.close(passed)
    os.close(kept)

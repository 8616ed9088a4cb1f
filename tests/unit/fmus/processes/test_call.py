"""A call in a separate process answers, or reports its end; nothing of it outlives the call or its caller."""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path

import psutil
import pytest
from harness import warm
from support.ends import SECONDS, ended, wait_until

from vibroimpact.fmus.processes.call import ProcessDied, call, call_alone

posix = pytest.mark.skipif(sys.platform == "win32", reason="sessions and signals are those of POSIX")
RUN = "builtins:exec"


def test_a_function_gives_what_json_can_say() -> None:
    done = call("math:hypot", 3.0, 4.0, seconds=SECONDS)
    assert (done.answer, done.code, done.stderr, done.is_late) == (5.0, 0, "", False)


def test_a_module_without_a_function_is_run_as_a_program_in_the_folder_that_is_named(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text("{}")
    done = call("json.tool", "a.json", "b.json", seconds=SECONDS, folder=tmp_path)
    assert (done.code, (tmp_path / "b.json").read_text()) == (0, "{}\n")


@posix
@pytest.mark.parametrize(
    ("program", "code", "last"),
    [
        ("import os; os._exit(3)", 3, ""),
        ("import os; os._exit(0)", 0, ""),
        ("import os; os.abort()", -signal.SIGABRT, ""),
        ("import sys; sys.exit('why')", 1, "why"),
        ("raise KeyError('x')", 1, "KeyError: 'x'"),
        ("import os; os.write(1, b'printed'); print('too'); raise ValueError('y')", 1, "ValueError: y"),
    ],
)
def test_whatever_ends_it_is_told(program: str, code: int, last: str) -> None:
    done = call(RUN, program, seconds=SECONDS)
    assert (done.code, done.answer, done.last_line, done.is_late) == (code, None, last, False)


def test_what_it_prints_is_no_answer() -> None:
    program = "import os, sys; os.write(1, b'[1]'); print('[2]'); sys.stdout.flush()"
    assert call(RUN, program, seconds=SECONDS).answer is None
    assert call("os:write", 1, "text", seconds=SECONDS).code == 1


def test_arguments_and_answers_may_be_large() -> None:
    text = "x" * 3_000_000
    assert call("builtins:str", text, seconds=SECONDS).answer == text


@posix
def test_one_that_takes_too_long_is_killed_with_what_it_has_started(tmp_path: Path) -> None:
    program = f"import os, time; os.system('sleep 600 & echo $! > {tmp_path / 'started'}'); time.sleep(600)"
    began = time.monotonic()
    done = call(RUN, program, seconds=2.0)
    assert (done.code, done.is_late) == (-signal.SIGKILL, True)
    assert time.monotonic() - began < SECONDS
    wait_until(lambda: ended(int((tmp_path / "started").read_text())))


@posix
@pytest.mark.parametrize("leaves", ["", "setsid "])
def test_what_holds_its_pipes_open_does_not_hold_up_the_caller(leaves: str, tmp_path: Path) -> None:
    started = tmp_path / "started"
    done = call(RUN, f"import os; os.system('{leaves}sleep 600 & echo $! > {started}')", seconds=SECONDS)
    assert (done.code, done.is_late) == (0, False)
    if leaves:
        os.kill(int(started.read_text()), signal.SIGKILL)
    wait_until(lambda: ended(int(started.read_text())))


CALLER = """
import signal, sys
from vibroimpact.fmus.processes.call import call, call_alone
signal.signal(signal.SIGINT, signal.default_int_handler)
program = f"import os; os.spawnlp(os.P_NOWAIT, 'sleep', 'sleep', '600'); open({sys.argv[1]!r}, 'w').close(); os.wait()"
try:
    call("builtins:exec", program, seconds=600) if sys.argv[2] == "call" else call_alone(exec, program)
except KeyboardInterrupt:
    raise SystemExit(42) from None
"""


@posix
@pytest.mark.parametrize("way", ["call", "alone"])
@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGKILL, -9), (signal.SIGTERM, -15), (signal.SIGINT, 42)]
)
def test_a_caller_that_is_ended_leaves_no_process(tmp_path: Path, way: str, number: int, code: int) -> None:
    caller = warm.start(CALLER, tmp_path / "begun", way, stdout=None, stderr=None)
    wait_until((tmp_path / "begun").exists)
    below = psutil.Process(caller.pid).children(recursive=True)
    assert len(below) >= 2
    caller.send_signal(number)
    assert caller.wait() == code
    wait_until(lambda: all(ended(process.pid) for process in below))


@posix
def test_a_call_that_lets_no_thread_run_ends_though_its_caller_is_gone(tmp_path: Path) -> None:
    """A library that hangs while it is loaded does this: the system ends the process, some time after its caller."""
    program = f"import ctypes; open({str(tmp_path / 'begun')!r}, 'w').close(); ctypes.PyDLL(None).pause()"
    code = (
        "import sys; from vibroimpact.fmus.processes.call import call\n"
        "call('builtins:exec', sys.argv[1], seconds=2.0)"
    )
    caller = warm.start(code, program, stdout=None, stderr=None)
    wait_until((tmp_path / "begun").exists)
    (below,) = psutil.Process(caller.pid).children()
    caller.kill()
    assert caller.wait() == -signal.SIGKILL
    wait_until(lambda: ended(below.pid))


def test_a_call_of_this_packages_own_gives_any_object_and_raises_what_it_raises() -> None:
    assert call_alone(complex, 1.0, -0.0) == 1.0 - 0.0j
    assert call_alone(bytes, bytes(3_000_000)) == bytes(3_000_000)
    with pytest.raises(ValueError, match="invalid literal for int"):
        call_alone(int, "x")


def test_what_libraries_warn_of_in_a_call_of_this_packages_own_is_not_shown() -> None:
    warned = "import warnings; warnings.warn('x')"
    program = f"from vibroimpact.fmus.processes.call import call_alone; call_alone(exec, {warned!r})"
    assert call(RUN, program, seconds=SECONDS).stderr == ""
    program_with_warnings = "import sys; sys.warnoptions.append('default'); " + program
    assert "UserWarning: x" in call(RUN, program_with_warnings, seconds=SECONDS).stderr


@posix
@pytest.mark.parametrize(
    ("function", "number", "message"),
    [
        (os._exit, 4, "it ended with exit code 4"),
        (signal.raise_signal, signal.SIGSEGV, "it was ended by SIGSEGV"),
    ],
)
def test_a_call_of_this_packages_own_that_dies_says_how(function: object, number: int, message: str) -> None:
    with pytest.raises(ProcessDied, match=message):
        call_alone(function, number)  # type: ignore[arg-type]

"""Lines that a component logs: its own ring keeps them, and a wrong environment does no harm."""

from __future__ import annotations

import subprocess
import sys
from ctypes import c_char_p, c_int, c_void_p

from vibroimpact.fmus.core import core_library
from vibroimpact.orchestrator.fmi.log import LogTail

OF_ITS_OWN = c_void_p(2)
"""An environment that some FMUs pass in place of the environment that they were given: their component."""


def logged(environment: c_void_p, text: bytes) -> None:
    core_library().vi_log_ring_fmi3(environment, c_int(0), c_char_p(b""), c_char_p(text))
    core_library().vi_log_ring_fmi2(environment, c_char_p(b"x"), c_int(0), c_char_p(b""), c_char_p(text))


def test_each_of_many_components_has_its_own_lines() -> None:
    tails = [LogTail() for _ in range(200)]
    for number, tail in enumerate(tails):
        logged(tail.environment, b"%d" % number)
    assert [tail.take() for tail in tails] == [(str(number),) * 2 for number in range(200)]


def test_a_line_with_a_wrong_environment_is_dropped_where_several_components_may_have_logged_it() -> None:
    tails = LogTail(), LogTail()
    for environment in (OF_ITS_OWN, c_void_p()):
        logged(environment, b"lost")
    assert [tail.take() for tail in tails] == [(), ()]


def test_a_line_for_a_component_that_is_gone_is_dropped() -> None:
    gone, *kept = LogTail(), LogTail(), LogTail()
    environment = gone.environment
    del gone
    logged(environment, b"late")
    assert [tail.take() for tail in kept] == [(), ()]


def test_a_line_with_a_wrong_environment_belongs_to_the_only_component_of_a_process() -> None:
    code = (
        "from ctypes import c_char_p, c_int, c_void_p\n"
        "from vibroimpact.orchestrator.fmi.log import LogTail, core_library\n"
        "tail = LogTail()\n"
        "core_library().vi_log_ring_fmi3(c_void_p(2), c_int(0), c_char_p(b''), c_char_p(b'heard'))\n"
        "print(tail.take())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "('heard',)"

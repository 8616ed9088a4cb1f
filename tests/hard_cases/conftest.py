"""Nothing may hang: a test that takes too long ends the whole run, and prints the stack of the hang."""

import faulthandler
from collections.abc import Iterator

import pytest

LONGEST = 120.0
"""Longest duration of one test, s: each takes a few seconds at most on an idle machine."""


@pytest.fixture(autouse=True)
def _time_guard() -> Iterator[None]:
    # a thread independent of Python: it also ends a loop inside a component's C
    faulthandler.dump_traceback_later(LONGEST, exit=True)
    yield
    faulthandler.cancel_dump_traceback_later()

"""Nothing may hang: a test that takes too long ends the whole run, with the stack that it hangs in."""

import faulthandler
from collections.abc import Iterator

import pytest

LONGEST = 120.0
"""Longest that one test may take, s: every one takes a few at most on an idle machine."""


@pytest.fixture(autouse=True)
def _time_guard() -> Iterator[None]:
    # a thread that needs no Python: it also ends a loop inside a component's C
    faulthandler.dump_traceback_later(LONGEST, exit=True)
    yield
    faulthandler.cancel_dump_traceback_later()

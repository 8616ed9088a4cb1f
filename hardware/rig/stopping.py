"""Ctrl-C ends a program that measures; it does not interrupt it."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any


@contextmanager
def stopped_by_signals(stop: Callable[[], None]) -> Iterator[None]:
    """Let the first Ctrl-C, or SIGTERM, only call `stop`, which sets a flag; a second Ctrl-C interrupts.

    Nothing changes in a thread other than the main one, which receives no signals, or if Ctrl-C is ignored.

    Examples
    --------
    >>> flag = threading.Event()
    >>> with stopped_by_signals(flag.set):
    ...     signal.raise_signal(signal.SIGINT)
    ...     flag.is_set()
    True
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before: dict[int, Any] = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def heard(number: int, place: FrameType | None) -> None:
        signal.signal(number, before[number] or signal.SIG_DFL)
        stop()

    for number, handler in before.items():
        if handler is not signal.SIG_IGN:
            signal.signal(number, heard)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler or signal.SIG_DFL)

"""How messages name what a person has said: by its option where a command was typed, else by the argument in Python."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_OPTIONS = {"baseline_window": "baseline", "start": "from", "stop": "to"}
"""Options that have another name than the argument."""
_typed: ContextVar[bool] = ContextVar("whether a command was typed", default=False)


@contextmanager
def command_line() -> Iterator[None]:
    """Let the messages that arise meanwhile name options."""
    token = _typed.set(True)
    try:
        yield
    finally:
        _typed.reset(token)


def typed_or_called(command: str, call: str = "") -> str:
    """Return the first where a command was typed, the second where Python was called.

    >>> f"Choose another{typed_or_called(' with -o')}; the same {typed_or_called('command', 'call')} resumes."
    'Choose another; the same call resumes.'
    """
    return command if _typed.get() else call


def option(argument: str, value: str | bool = "") -> str:
    """Return what a person writes to give an argument, or to give it a value.

    >>> option("start"), option("method", "threshold"), option("events", False)
    ('start', "method='threshold'", 'events=False')
    >>> with command_line():
    ...     option("start"), option("time_column"), option("method", "threshold"), option("events", False)
    ('--from', '--time-column', '--method threshold', '--no-events')
    """
    name = _OPTIONS.get(argument, argument).replace("_", "-")
    typed = f"--no-{name}" if value is False else f"--{name} {value}".rstrip()
    return typed_or_called(typed, argument if value == "" else f"{argument}={value!r}")

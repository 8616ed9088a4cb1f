"""Errors of libraries on damaged files, as one line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from vibroimpact.fmus.errors import UsageError

LONGEST_REASON, LONGEST_REFUSAL = 300, 2000
"""Most characters of a library's reason, and of a reader's refusal."""


@contextmanager
def one_refusal(what: str) -> Iterator[None]:
    """Turn the errors of a library on a damaged file into a UsageError, except for want of memory.

    >>> with one_refusal("a whole MATLAB file"):
    ...     raise KeyError("K")
    Traceback (most recent call last):
    vibroimpact.fmus.errors.UsageError: expected a whole MATLAB file, got one that cannot be read (KeyError: 'K').
    """
    try:
        yield
    except (UsageError, MemoryError):
        raise
    except Exception as problem:  # libraries raise errors of many kinds on damaged bytes
        got = one_line(f"{type(problem).__name__}: {problem}")
        raise UsageError(f"expected {what}, got one that cannot be read ({got}).") from problem


def one_line(text: str, most: int = LONGEST_REASON) -> str:
    """Return the beginning of a text, as one line.

    >>> one_line("a\\n b")
    'a b'
    """
    return " ".join(text[:most].split())

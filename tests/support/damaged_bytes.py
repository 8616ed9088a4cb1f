"""Files with random damage, and readers that refuse them in one line."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from hypothesis import strategies as st

from vibroimpact.fmus.errors import UsageError

Found = TypeVar("Found")
TEXTS = (b",", b"\n", b"\t", b"*", b"$", b"-", b"\xff", b"\0", b"nan", b"1e999", b"9" * 50, b" " * 70)
"""Texts that damage inserts."""


@st.composite
def damaged(draw: st.DrawFn, whole: bytes) -> bytes:
    """Return a file with some bytes changed, inserted or removed, or with its end cut off."""
    content = bytearray(whole)
    for _ in range(draw(st.integers(1, 3))):
        place = draw(st.integers(0, max(0, len(content) - 1)))
        kind = draw(st.sampled_from(["flip", "cut", "insert", "remove"]))
        if kind == "flip" and content:
            content[place] ^= 1 << draw(st.integers(0, 7))
        elif kind == "cut":
            del content[place:]
        elif kind == "insert":
            content[place:place] = draw(st.one_of(st.sampled_from(TEXTS), st.binary(min_size=1, max_size=8)))
        else:
            del content[place : place + draw(st.integers(1, 60))]
    return bytes(content)


def read_or_refused(read: Callable[[], Found]) -> Found | None:
    """Return the result of a reader; None where it refuses in one line with the rule."""
    try:
        return read()
    except UsageError as refused:
        said = str(refused)
    if "expected" not in said or "\n" in said:
        raise AssertionError(f"expected one line with the rule, got {said!r}")
    return None

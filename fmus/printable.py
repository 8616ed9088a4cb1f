"""Untrusted text made safe for a terminal or a page: no character moves a cursor, sets colours or reverses text."""

from __future__ import annotations

import unicodedata

_KEPT = "\n\t"
# Control, format (such as U+202E, which reverses text), surrogate, line and paragraph separator.
_ESCAPED = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})


def printable(text: str) -> str:
    r"""Return a text with control and format characters shown as their escapes.

    >>> print(printable("a\x1b[31mred\u202eder, 5 \N{MICRO SIGN}s\r"))
    a\x1b[31mred\u202eder, 5 µs\r
    """
    if text.isprintable():
        return text
    return "".join(
        character.encode("unicode_escape").decode("ascii")
        if unicodedata.category(character) in _ESCAPED and character not in _KEPT
        else character
        for character in text
    )

"""Strangers' text as a terminal or a page may have it: no character moves a cursor, colours or turns text around."""

from __future__ import annotations

import unicodedata

_KEPT = "\n\t"
# Control, format (such as U+202E, which turns what follows around), surrogate, line and paragraph separator.
_ESCAPED = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})


def printable(text: str) -> str:
    r"""Return a text in which characters that are no letters, but orders, are shown as their escapes.

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

"""Untrusted TOML: parsed in time and memory in proportion to its size, or refused.

The parser of the standard library works through every prefix of a dotted key. A key of 20,000 parts (40 kB) takes
22 s and 1.6 GB. No file of vibroimpact has keys of more than four parts.
"""

from __future__ import annotations

import re
import tomllib
from typing import Any

MOST_PARTS = 8
"""Largest number of parts of a dotted key, or of the name of a table."""

_PART = r"""(?:[A-Za-z0-9_-]+|"[^"\n]*"|'[^'\n]*')"""
_LONG_KEY = re.compile(rf"(?:^|[{{,\[])[ \t]*+(?>{_PART}[ \t]*+\.[ \t]*+){{{MOST_PARTS}}}", re.MULTILINE)


class TooDeepError(ValueError):
    """A text is TOML that is nested deeper than any file of vibroimpact.

    Attributes
    ----------
    line : int or None
        Line of the problem, from 1; None if the parser only gave up.
    """

    def __init__(self, line: int | None) -> None:
        self.line = line
        super().__init__("nesting too deep to read" + ("" if line is None else f" (at line {line})"))


def parse_toml(text: str) -> dict[str, Any]:
    """Return the TOML document in a text.

    Raises
    ------
    tomllib.TOMLDecodeError
        The text is not TOML.
    ValueError
        A number has too many digits; or, as `TooDeepError`, keys have too many parts or values are nested too deep.

    Examples
    --------
    >>> parse_toml("[body]\\nmass = 2")
    {'body': {'mass': 2}}
    >>> parse_toml("a." * 20_000 + "a = 1")
    Traceback (most recent call last):
    vibroimpact.fmus.safe_toml.TooDeepError: nesting too deep to read (at line 1)
    """
    found = _LONG_KEY.search(text)
    if found is not None:
        raise TooDeepError(text.count("\n", 0, found.end()) + 1)
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise TooDeepError(None) from None

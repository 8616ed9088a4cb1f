"""Numbers as Fortran and Nastran write them: `1.5D+03`, and without a letter `1.5+3`."""

from __future__ import annotations

import re
from math import isfinite, nan

_REAL = re.compile(r"[ ]*([+-]?(?:\d+\.?\d*|\.\d+))(?:[EeDd][ ]?([+-]?\d+)|([+-]\d+))?[ ]*")
_INTEGER = re.compile(r"[ ]*[+-]?\d+[ ]*")
_LONGEST = 40


def real_of(text: str) -> float:
    """Return a real number.

    Raises
    ------
    ValueError
        The text is no number.

    Examples
    --------
    >>> real_of(" 1.5D+03"), real_of("1.5+3"), real_of("-.5-2"), real_of("2.")
    (1500.0, 1500.0, -0.005, 2.0)
    """
    if "_" not in text:
        try:  # most numbers need no more
            number = float(text.replace("D", "E"))
        except ValueError:
            number = nan
        if isfinite(number):
            return number
    found = _REAL.fullmatch(text) if len(text) <= _LONGEST else None
    if found is None:
        raise ValueError(f"expected a number, got {text[:_LONGEST]!r}")
    return float(f"{found[1]}e{found[2] or found[3] or 0}")


def integer_of(text: str) -> int:
    """Return an integer; ValueError: the text is none.

    >>> integer_of("  12")
    12
    """
    if text.isdigit() and len(text) <= _LONGEST:
        return int(text)
    if len(text) > _LONGEST or _INTEGER.fullmatch(text) is None:
        raise ValueError(f"expected an integer, got {text[:_LONGEST]!r}")
    return int(text)

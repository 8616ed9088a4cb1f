"""Tables, and numbers with their standard errors, as every command prints them."""

from __future__ import annotations

import math
from collections.abc import Iterable

from rich.box import SIMPLE_HEAD
from rich.table import Table

_ROUNDING = 1e-9
"""Relative standard error below which it is only rounding of the arithmetic."""
_MOST_PLACES = 12
"""Largest number of decimals; numbers with smaller errors are written with an exponent."""
_LARGE = 1e7
"""Standard error from which on the number is written with an exponent."""
_SMALL = 1e-4
"""Value below which the number is written with an exponent."""


def table(title: str, *headings: str, rows: Iterable[Iterable[str]] = ()) -> Table:
    """Return a table.

    A heading begins with `<` or `>`. `<` marks words, which wrap where the terminal is narrow; `>` marks numbers, which
    do not wrap.
    """
    made = Table(title=title, box=SIMPLE_HEAD, title_justify="left")
    for heading in headings:
        if heading.startswith(">"):
            made.add_column(heading[1:], justify="right", no_wrap=True)
        else:
            made.add_column(heading[1:], overflow="fold")
    for row in rows:
        made.add_row(*row)
    return made


def value_and_error(value: float, error: float) -> tuple[str, str]:
    """Return value and standard error, with the digits that the error allows: two digits of the error.

    >>> value_and_error(0.00556754, 0.0000610394), value_and_error(438.6585, 0.02306)
    (('0.005568', '0.000061'), ('438.659', '0.023'))
    >>> value_and_error(39357.0, 263.0), value_and_error(2.0, 0.0), value_and_error(3e-7, 2e-9)
    (('39360', '260'), ('2', '-'), ('3.000e-07', '2.0e-09'))
    """
    if not math.isfinite(value):
        return "-", "-"
    if not 0.0 < error < math.inf:
        return f"{value:.6g}", "-"
    size = abs(value) or 1.0
    if error < _ROUNDING * size:
        return f"{value:.12g}", f"< {_ROUNDING * size:.0e}"
    place = 1 - math.floor(math.log10(error))
    if place > _MOST_PLACES or error >= _LARGE or size < _SMALL:
        digits = max(1, min(15, math.floor(math.log10(size)) + place))
        return f"{value:.{digits}e}", f"{error:.1e}"
    return f"{round(value, place):.{max(place, 0)}f}", f"{round(error, place):.{max(place, 0)}f}"


def with_error(value: float, error: float, unit: str = "") -> str:
    """Return a value with its standard error and its unit, as people write it.

    >>> with_error(0.87483, 0.0062), with_error(2.5, float("nan"), "Hz")
    ('0.8748 ± 0.0062', '2.5 Hz')
    """
    number, standard_error = value_and_error(value, error)
    written = number if standard_error == "-" else f"{number} ± {standard_error}"
    return f"{written} {unit}" if unit else written

"""Small HTML tables of objects for notebooks. Names come from untrusted files: everything is escaped."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

from vibroimpact.fmus.printable import printable

MOST_ROWS = 30
"""Number of rows shown; further rows are only counted."""


def html_table(caption: str, headings: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a table in HTML.

    Parameters
    ----------
    caption : str
        Caption above the table.
    headings : sequence of str
        Headings of the columns; none: a table of names and values.
    rows : iterable of sequence
        Rows of cells, shown by `str`, numbers with six digits.

    Examples
    --------
    >>> html_table("a<b", (), [("x", 0.5)])
    '<table><caption>a&lt;b</caption><tbody><tr><td>x</td><td>0.5</td></tr></tbody></table>'
    """
    listed = list(rows)
    head = "".join(f"<th>{_cell(each)}</th>" for each in headings)
    body = "".join(
        f"<tr>{''.join(f'<td>{_cell(each)}</td>' for each in row)}</tr>" for row in listed[:MOST_ROWS]
    )
    if len(listed) > MOST_ROWS:
        body += f"<tr><td>and {len(listed) - MOST_ROWS} more</td></tr>"
    above = f"<thead><tr>{head}</tr></thead>" if head else ""
    return f"<table><caption>{_cell(caption)}</caption>{above}<tbody>{body}</tbody></table>"


def _cell(value: object) -> str:
    return escape(printable(f"{value:.6g}" if isinstance(value, float) else str(value)))

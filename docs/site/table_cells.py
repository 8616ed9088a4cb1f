"""Cells of tables: short ones keep one line, and long ones wrap at the width of a text. Wide tables scroll."""

from __future__ import annotations

from typing import Any

LONG = "long"
"""Class of cells that wrap: `static/site.css` gives them a width."""
MOST_CHARACTERS = 50
"""Length of a cell's text above which the cell wraps: two columns of this length fill the page of a laptop."""


def setup(sphinx: Any) -> dict[str, bool]:
    """Mark long cells once a page is read."""
    sphinx.connect("doctree-read", _mark)
    return {"parallel_read_safe": True}


def is_long(text: str) -> bool:
    """Return whether a cell wraps.

    Examples
    --------
    >>> is_long("restitution at 1 m/s"), is_long("an array of whole numbers, each of which is at least 1")
    (False, True)
    """
    return len(text) > MOST_CHARACTERS


def _mark(sphinx: Any, doctree: Any) -> None:
    from docutils import nodes

    for cell in doctree.findall(nodes.entry):
        if is_long(cell.astext()):
            cell["classes"].append(LONG)

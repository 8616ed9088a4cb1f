"""Blocks of commands and of sentences wrap on the site; printed tables keep their lines, and scroll."""

from __future__ import annotations

import re
from typing import Any

CLASS = "commands"
"""Class of blocks that hold only commands or sentences. `static/site.css` wraps them."""
PRINTED = "printed"
"""Class of all other blocks without a language, such as tables. `static/site.css` writes them small."""
_NO_LANGUAGE = ("", "none", "default", "text")
# Two blanks within a line, or a ruled line, separate columns; an indented line continues the line above.
_COLUMN = re.compile(r"\S {2,}\S|[─│]|^\s")
# A command starts a line; its continuation lines are indented, or follow a line that ends with a backslash.
_COMMAND = re.compile(r"(vibroimpact|pip|pip3|python|make|git|pytest|docker|curl|cd|export) \S")


def setup(sphinx: Any) -> dict[str, bool]:
    """Mark blocks of commands once a page is read."""
    sphinx.connect("doctree-read", _mark)
    return {"parallel_read_safe": True}


def is_commands(text: str) -> bool:
    """Return whether a block holds only commands.

    Examples
    --------
    >>> is_commands("vibroimpact run a.toml -o a.nc  # writes a.nc"), is_commands("run  impacts\\n  0       20")
    (True, False)
    """
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    continued = False
    for place, line in enumerate(lines):
        if not (continued or _COMMAND.match(line) or (place and line.startswith(" ") and lines[0][0] != " ")):
            return False
        continued = line.endswith("\\")
    return bool(lines)


def is_sentences(text: str) -> bool:
    """Return whether a block holds only messages, each of them a line without columns.

    Examples
    --------
    >>> is_sentences("a.toml: mass: expected a number.\\nAdd one."), is_sentences("run  impacts\\n  0       20")
    (True, False)
    """
    lines = [line for line in text.splitlines() if line]
    return bool(lines) and not any(map(_COLUMN.search, lines))


def _mark(sphinx: Any, doctree: Any) -> None:
    from docutils import nodes

    for block in doctree.findall(nodes.literal_block):
        text = block.astext()
        if is_commands(text):
            block["classes"].append(CLASS)
        elif block.get("language", "none") in _NO_LANGUAGE:
            block["classes"].append(CLASS if is_sentences(text) else PRINTED)

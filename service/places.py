"""Lines and columns of the keys of a TOML text, found in one pass over it."""

from __future__ import annotations

import re

BOM = "\ufeff"
_TOKEN = re.compile(
    r'"""(?:[^"\\]|\\.|"{1,2}(?!"))*+(?:"{3,5})?+'
    r"|'''(?:[^']|'{1,2}(?!'))*+(?:'{3,5})?+"
    r'|"(?:[^"\\\n]|\\[^\n])*+"?+'
    r"|'[^'\n]*+'?+"
    r"|#[^\n]*+",
    re.DOTALL,
)
"""Strings and comments of TOML. Each alternative consumes all that it reads, even unfinished: nothing is read twice."""
_HEADER = re.compile(r"[ \t]*+(\[\[?)[ \t]*+([^\[\]\s][^\[\]]*+)\]\]?+[ \t\r]*+(?:#|$)")
_ENTRY = re.compile(r"([ \t]*+)([\w\-.\"']++)[ \t]*+=")
_LAST_INDEX = re.compile(r"\[\d+\]$")


class Places:
    """Lines and columns of the keys of one TOML text.

    >>> places = Places("# a mass\\n[body]\\n  mass = -1")
    >>> places.of("body.mass"), places.of("body.stiffness"), places.of("record")
    ((3, 3), (2, 1), (1, 1))
    """

    def __init__(self, text: str) -> None:
        self._places: dict[str, tuple[int, int, str]] = {}
        table, counts = "", dict[str, int]()
        # a string of several lines holds no keys; TOML ends lines at these characters alone
        for number, line in enumerate(_TOKEN.sub(_blank, text.removeprefix(BOM)).split("\n"), 1):
            header, entry = _HEADER.match(line), _ENTRY.match(line)
            if header:
                table = _bare(header[2].rstrip())
                if header[1] == "[[":
                    counts[table] = counts.get(table, 0) + 1
                    table = f"{table}[{counts[table]}]"
                self._places.setdefault(table, (number, 1, ""))
            elif entry:
                full = f"{table}.{_bare(entry[2])}".lstrip(".")
                self._places.setdefault(full, (number, len(entry[1]) + 1, line))

    def of(self, key: str) -> tuple[int, int]:
        """Return line and column, from 1, of a key such as `stop[2].position`.

        The place of an absent key is that of its nearest table, else (1, 1).
        """
        target = _bare(_LAST_INDEX.sub("", key))
        full = target
        while full not in self._places:
            full = full[: max(full.rfind("."), full.rfind("["), 0)]
            if not full:
                return 1, 1
        number, column, line = self._places[full]
        return number, _within(line, column, target[len(full) :])


def _within(line: str, column: int, rest: str) -> int:
    """Return the column of the rest of a key in the inline tables of a line; else the column of the line's own key."""
    name = re.escape(rest.rpartition(".")[2])
    if not (line and name):
        return column
    index = re.match(r"\[(\d{1,9})\]", rest)
    place = int(index[1]) - 1 if index else 0
    found = [one.start(1) + 1 for one in re.finditer(rf"[{{,\s](\"?{name}\"?)[ \t]*+=", line)]
    return found[place] if place < len(found) else column


def _bare(key: str) -> str:
    return key.replace('"', "").replace("'", "")


def _blank(token: re.Match[str]) -> str:
    return "\n" * token[0].count("\n") or token[0]

"""The enumeration of contact laws, read from the table of the C core in `core/contact/contact_law.c`.

Each row there begins `[number] = {.name = "...", .description = "...",`; `.stop` and `.external` say who answers.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from vibroimpact.fmus.errors import ComponentFileError
from vibroimpact.fmus.packaging.description.model import EnumerationItem

_TABLE = re.compile(r"^const vi_law vi_laws\[\w+\] = \{$(.*?)^\};$", re.MULTILINE | re.DOTALL)
_ROW = re.compile(
    r'^    \[(?P<number>\d+)\] = \{\.name = "(?P<name>\w+)",\s*\.description = (?P<description>(?:"[^"\\\n]*"\s*)+)'
    r"(?P<rest>[^{}]*)\},$",
    re.MULTILINE,
)
_STOP, _EXTERNAL = re.compile(r"\.stop = VI_(RIGID|YIELDING)_STOP\b"), re.compile(r"\.external = true\b")
_START_OF_ROW = re.compile(r"^    \[", re.MULTILINE)
#: Ports of an enumeration item whose contact another FMU answers, or that another FMU hits.
_EXTERNAL_PORTS = "external"


def contact_laws(path: Path, *, of_stop: bool = False) -> tuple[EnumerationItem, ...]:
    """Return the items of the enumeration of contact laws.

    Parameters
    ----------
    path : Path
        The C file with the table.
    of_stop : bool
        Whether to return only laws that a stop evaluates itself.

    Raises
    ------
    ComponentFileError
        The file has no such table, or a row has another form.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise ComponentFileError(f"{path}: expected a file, got: {error.strerror}.") from error
    table = _TABLE.search(text)
    rows = list(_ROW.finditer(table[1])) if table else []
    if table is None or not rows or len(rows) != len(_START_OF_ROW.findall(table[1])):
        raise ComponentFileError(
            f"{path}: expected a table vi_laws whose rows begin [number] = {{.name = ..., .description = ...,"
            f" got {len(rows)} of that form."
        )
    items = tuple(_items(rows, of_stop))
    for key in ("name", "number"):
        values = [row[key] for row in rows]
        twice = {value for value in values if values.count(value) > 1}
        if twice:
            raise ComponentFileError(f"{path}: expected each {key} of a law once, got {sorted(twice)} twice.")
    return items


def _items(rows: list[re.Match[str]], of_stop: bool) -> Iterator[EnumerationItem]:
    for row in rows:
        external = _EXTERNAL.search(row["rest"]) is not None
        if of_stop and (external or not _STOP.search(row["rest"])):
            continue
        description = "".join(re.findall(r'"([^"]*)"', row["description"]))
        yield EnumerationItem(
            row["name"], int(row["number"]), description, _EXTERNAL_PORTS if external else ""
        )

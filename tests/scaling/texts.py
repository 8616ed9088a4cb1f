"""Tokens of tables of text, LabVIEW files and exports of instruments: cells, digits, signs, lines of all kinds."""

from __future__ import annotations

from collections.abc import Mapping

from support.direct_reading import imported_directly
from support.instrument_files import EXPORTS

from scaling._growth import Made, Tokens, texts
from vibroimpact.hardware.formats.choosing import read_raw

HEAD = "t,a\n0.1,1.5\n0.2,2.5\n"

IN_A_CELL: Mapping[str, str] = {
    "digits": "1",
    "letters": "x",
    "blanks": " ",
    "commas": ",",
    "semicolons": ";",
    "tabs": "\t",
    "bars": "|",
    "quotes": '"',
    "double quotes": '""',
    "quoted commas": '",',
    "points": ".",
    "groups of points": ".234",
    "groups of commas": ",234",
    "groups of blanks": " 234",
    "groups of narrow blanks": "\u202f234",
    "typeset minus signs": "\u2212",
    "typeset minus signs apart": ",\u22121",
    "minus signs": "-",
    "plus signs": "+",
    "exponents": "1e",
    "colons": "1:",
    "slashes": "1/",
    "dashes": "1-",
    "brackets": "(",
    "closed brackets": "()",
    "braces": "[",
    "hashes": "#",
    "percents": "%",
    "backslashes": "\\",
    "form feeds": "\x0c",
    "narrow blanks": "\u202f",
    "vertical tabs": "\x0b",
    "line separators": "\u2028",
    "carriage returns": "\r",
    "zeros": "0",
    "units in": " in m",
    "arrows": " -> ",
    "letters and blanks": "a ",
    "slashes apart": " / ",
    "combining marks": "\u0301",
}
"""Repeated text of a cell in the second row."""
LINES: Mapping[str, str] = {
    "rows": "0.5,1.25\n",
    "rows of whole numbers": "5,1\n",
    "quoted rows": '"0.5","1.25"\n',
    "empty lines": "\n",
    "comments": "# a comment\n",
    "words": "some words\n",
    "rows of dates": "2026-07-30 10:00:00.25,1.5\n",
    "rows of dates in slashes": "02/03/2019 10:00:00,1.5\n",
    "rows of clocks": "10:00:00.5,1.5\n",
    "rows of minutes": "10:00.5,1.5\n",
    "rows of half days": "10:00:00 PM,1.5\n",
    "markers": "OVRNG,\n",
    "sums": "mean,1.5\n",
    "footers": "word 1.5\n",
    "rows with words": "0.5,word\n",
    "rows without": "0.5,\n",
    "rows with a word": "0.5,1.5,word\n",
    "rows of one cell": "0.5\n",
    "carriage returns": "0.5,1.25\r",
    "groups of thousands": '"1,234.5","2,345,678.5"\n',
    "days and clocks": "2026-07-30,10:00:00,1.5\n",
    "signs": "=\n",
    "blank lines": "    \n",
    "quoted words": '"word","word"\n',
}
"""Lines that follow, or precede, a few rows."""
TABLES: Mapping[str, Made] = {
    "rows of a decimal comma": lambda n: "Zeit;a\n" + "".join(f"{k};0,5\n" for k in range(n)),
    "rows that ascend": lambda n: "t a\n" + "".join(f"{0.5 * k} {k % 7}\n" for k in range(n)),
    "rows that begin again": lambda n: "t,a\n" + "".join(f"{0.5 * (k % 9)},{k % 7}\n" for k in range(n)),
    "rows with gaps": lambda n: "t,a\n" + "".join(f"{k * (1 + k % 2)},{k % 7}\n" for k in range(n)),
    "rows after midnight": lambda n: "t,a\n" + "".join(f"{k % 24:02d}:00:00,{k % 7}\n" for k in range(n)),
    "columns": lambda n: "\n".join(",".join(f"{row}.{k}" for k in range(n)) for row in range(4)) + "\n",
    "columns with headings": lambda n: (
        "\n".join(",".join(f"{mark}{k}" for k in range(n)) for mark in ("a", "1.", "2.", "3.")) + "\n"
    ),
    "columns of one heading": lambda n: (
        "\n".join(",".join([mark] * n) for mark in ("base (g)", "1.5", "2.5", "3.5")) + "\n"
    ),
    "pairs of columns": lambda n: (
        "\n".join(",".join([mark] * n) for mark in ("t,a", "1,5", "2,6", "3,8")) + "\n"
    ),
    "a wide row among rows": lambda n: "t,a\n" + "0.5,x1.5\n0.5,1.5\n" * n + "1.5," * n + "1\n",
    "a wide row of words among rows": lambda n: "t,a\n" + "0.5,1.5\n" * n + "1.5" + ",x" * n + "\n",
    "rows that widen": lambda n: "".join("1.5," * (k % 1000) + "x\n" for k in range(n)),
    "Latin letters": lambda n: HEAD + "# \xe4\n" * n,
}


def _after(unit: str) -> Made:
    return lambda n: f"{HEAD}0.3,{unit * n}\n0.4,4.5\n"


def _between(line: str) -> Made:
    return lambda n: HEAD + line * n + "0.3,1.5\n"


def _before(line: str) -> Made:
    return lambda n: line * n + HEAD


def text_made() -> dict[str, Made]:
    """Return the texts of tables by the kind of their tokens."""
    made = {f"{kind} in a cell": _after(unit) for kind, unit in IN_A_CELL.items()}
    made |= {f"{kind} in a heading": _heading(unit) for kind, unit in IN_A_CELL.items()}
    made |= {f"{kind} below rows": _between(line) for kind, line in LINES.items()}
    made |= {f"{kind} above rows": _before(line) for kind, line in LINES.items()}
    return made | dict(TABLES)


def _heading(unit: str) -> Made:
    return lambda n: f"t,a{unit * n}\n0.1,1.5\n0.2,2.5\n"


LVM = (
    "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nX_Columns\t{columns}\n"
    "{more}***End_of_Header***\t\n\t\n"
)
SEGMENT = (
    "Channels\t1\t\nSamples\t2\t\nDate\t2026/07/30\t\nTime\t10:00:{second:02d}.5\t\nY_Unit_Label\tg\t\nX0\t0\t\n"
    "Delta_X\t0.5\t\n{more}***End_of_Header***\t\t\nX_Value\tbase\tComment\n"
)
LABVIEW: Mapping[str, Made] = {
    "rows": lambda n: _lvm() + SEGMENT.format(second=0, more="") + "0.5\t1.5\n" * n,
    "segments": lambda n: (
        _lvm() + "".join(SEGMENT.format(second=k % 60, more="") + "0.5\t1.5\n1\t2.5\n" * 40 for k in range(n))
    ),
    "segments without rows": lambda n: (
        _lvm() + "".join(SEGMENT.format(second=k % 60, more="") for k in range(n))
    ),
    "entries": lambda n: _lvm(more="Key\tvalue\n" * n) + SEGMENT.format(second=0, more="") + "0.5\t1.5\n",
    "entries of a segment": lambda n: (
        _lvm() + SEGMENT.format(second=0, more="Key\tvalue\n" * n) + "0.5\t1.5\n"
    ),
    "notes": lambda n: (
        _lvm() + SEGMENT.format(second=0, more="Notes" + "\tword" * n + "\n") + "0.5\t1.5\n" * 3
    ),
    "special blocks": lambda n: (
        _lvm()
        + "***Start_Special***\nx\n***End_Special***\n" * n
        + SEGMENT.format(second=0, more="")
        + "0.5\t1.5\n"
    ),
    "empty lines": lambda n: _lvm() + "\n" * n + SEGMENT.format(second=0, more="") + "0.5\t1.5\n",
    "tabs": lambda n: _lvm() + "\t" * n + "\n" + SEGMENT.format(second=0, more="") + "0.5\t1.5\n",
    "columns": lambda n: _lvm() + SEGMENT.format(second=0, more="") + ("0.5" + "\t1.5" * n + "\n") * 4,
    "columns with instants": lambda n: (
        _lvm("Multi") + SEGMENT.format(second=0, more="") + ("0.5\t1.5\t" * n + "\n") * 4
    ),
    "a wide row among rows": lambda n: (
        _lvm() + SEGMENT.format(second=0, more="") + "0.5\tx\n" * n + "0.5" + "\t1.5" * n + "\n"
    ),
    "headers": lambda n: (
        _lvm() + "***End_of_Header***\n" * n + SEGMENT.format(second=0, more="") + "0.5\t1\n"
    ),
    "a unit": lambda n: (
        _lvm() + SEGMENT.format(second=0, more="").replace("\tg\t", "\t" + "m " * n + "\t") + "0.5\t1.5\n" * 3
    ),
}


def _lvm(columns: str = "One", more: str = "") -> str:
    return LVM.format(columns=columns, more=more)


INSTRUMENT_CELLS = ("1", " ", ",", ";", "\t", ":", ".", '"', "-", "a", "_X;", " -> ", "Y[1]", "1,", "Volt,")
"""Repeated text of a line after the head of an export, and of a line before it."""


def _export(kind: str, count: int, unit: str = "") -> str:
    lines = list(EXPORTS[kind][1](1).lines)
    if unit:
        middle = len(lines) // 2
        return "\n".join([unit * count, *lines[:middle], unit * count, *lines[middle:]]) + "\n"
    return "\n".join([*lines, *(lines[-1:] * count)]) + "\n"


def _of_exports() -> list[Tokens]:
    made: dict[str, Made] = {}
    for kind in EXPORTS:
        made[f"{kind}, rows"] = lambda n, kind=kind: _export(kind, n)  # type: ignore[misc]
        for unit in INSTRUMENT_CELLS:
            made[f"{kind}, {unit!r}"] = lambda n, kind=kind, unit=unit: _export(kind, n, unit)  # type: ignore[misc]
    return texts("export of an instrument", made, read_raw, "tokens.csv")


def all_tokens() -> list[Tokens]:
    """Return all kinds of tokens of texts."""
    whole = {kind: TABLES[kind] for kind in TABLES} | {"rows": _between(LINES["rows"])}
    return [
        *texts("text", text_made(), read_raw, "tokens.csv"),
        *texts("imported text", whole, imported_directly, "tokens.csv"),
        *texts("LabVIEW", LABVIEW, read_raw, "tokens.lvm"),
        *texts("imported LabVIEW", LABVIEW, imported_directly, "tokens.lvm"),
        *_of_exports(),
    ]

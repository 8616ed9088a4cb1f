"""Tables of text of drawn dialects, and exports of instruments: read equal; with odd cells: read or refused."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
from support.direct_reading import imported_directly
from support.instrument_files import EXPORTS

from soak import _drawn_files as files
from soak.recordings import INSERTED
from vibroimpact.fmus.errors import VibroimpactError

CASES, SAMPLE, SECONDS = files.CASES, files.SAMPLE, files.SECONDS

MARKS = ("\t", ";", ",", "|", " ")
MISSING = ("", "NaN", "n/a", "---", "OVRNG", "-Inf", "OL", "9.9e37", "null")
BEFORE = ("# a comment", "% 12.5", "Operator: nobody", "", "!! 3", "// x", "Title")
ODD_CELLS = (
    *(
        "1.2.3",
        "1,2",
        "1e",
        "e5",
        "--1",
        "+-1",
        "0x1p3",
        "1_000",
        "1e999",
        "-1e999",
        "1" * 500,
        "1." + "0" * 500 + "1",
    ),
    *(
        "2026-07-30 10:00:00",
        "10:00:00",
        "30.02.2026 10:00",
        "25:61:00",
        "02/03/2019 10:00:00",
        "10:00 PM",
        "13:00 PM",
    ),
    *(
        "1234567890123",
        "1.234.567",
        "1,234,567.5",
        "\u2212",
        "\u2212" * 9,
        "1\u202f234",
        "NaN",
        "OVRNG",
        "mean",
        "word",
    ),
    *(
        '"',
        '""',
        '"a,b;c\td"',
        "'",
        "#",
        "\\",
        "\x00",
        "\x0c",
        "\x1b[31m",
        "\u202e",
        "\ufeff",
        "\u0663",
        "½",
        " ",
    ),
    *(
        "2026-07-30T10:00:00+05:30",
        "2026-07-30T10:00:00Z",
        "0000-00-00 00:00",
        "9999-12-31 23:59:59.999999999",
    ),
)
STAMPS = "timestamp"
SINCE = datetime(2026, 7, 30, 10, 11, 12)


@dataclass(frozen=True)
class Dialect:
    """Style of a table."""

    mark: str
    decimal: str
    form: str
    clock: str
    heading: str
    ending: str
    encoding: str
    is_quoted: bool
    has_end_mark: bool
    minus: str

    def cell(self, value: float) -> str:
        """Return a number in the table's style."""
        text = self.form.format(value).replace("-", self.minus)
        if self.decimal == ",":
            text = text.replace(",", " ").replace(".", ",").replace(" ", ".")
        return text

    def row(self, cells: Sequence[str]) -> str:
        """Return a row."""
        written = [f'"{cell}"' for cell in cells] if self.is_quoted else cells
        return self.mark.join(written) + (self.mark if self.has_end_mark else "")


def drawn_dialect(draw: random.Random) -> Dialect:
    """Return a dialect that the general reader accepts."""
    mark = draw.choice(MARKS)
    decimal = "," if mark != "," and draw.random() < 0.4 else "."
    forms = ["{:.5f}", "{:.6e}", "{:.9g}", "{:.12f}", "{:+.4E}"] + ["{:,.3f}"] * (decimal == ",")
    encoding = draw.choice(("utf-8", "utf-8", "utf-8-sig", "utf-16", "latin-1"))
    return Dialect(
        mark,
        decimal,
        draw.choice(forms),
        draw.choice(("seconds", "seconds", "thousandths", "stamps", "rate")),
        "{}[{}]" if mark == " " else draw.choice(("{} ({})", "{} [{}]", "{} / {}", "{}[{}]")),
        draw.choice(("\n", "\n", "\r\n")),
        encoding,
        mark != " " and draw.random() < 0.15,
        mark != " " and draw.random() < 0.2,
        "\u2212" if encoding.startswith("utf") and draw.random() < 0.1 else "-",
    )


def drawn_table(draw: random.Random) -> tuple[list[str], Dialect, files.Truth, dict[str, Any]]:
    """Return the lines of a table, its dialect, its expected reading, and the settings that it needs."""
    dialect, signals = drawn_dialect(draw), files.drawn_signals(draw)
    cells = [[dialect.cell(value) for value in values] for values in signals.values]
    values = [
        np.array([float(dialect.form.format(value).replace(",", "")) for value in one])
        for one in signals.values
    ]
    _leave_out(draw, dialect, cells, values)
    clock = _clock(dialect, signals)
    columns = cells if clock is None else [clock[1], *cells]
    headings = [_headed(dialect, name, unit) for name, unit in zip(signals.names, signals.units, strict=True)]
    head = headings if clock is None else [clock[0], *headings]
    before = [draw.choice(BEFORE) for _ in range(draw.choice((0, 0, 1, 4)))]
    rows = [dialect.row(list(row)) for row in zip(*columns, strict=True)]
    after = _footer(draw, dialect, len(columns))
    start = 0.0 if clock is None or clock[0] == STAMPS else signals.start
    truth = files.truth_of(signals, start=start)
    truth = files.Truth(values, truth.units, truth.interval, start, truth.names)
    settings: dict[str, Any] = {"rate": 1.0 / signals.interval} if clock is None else {}
    if len(columns) == 1:  # a single comma in each row may separate two columns
        settings["decimal"] = dialect.decimal
    return [*before, dialect.row(head), *rows, *after], dialect, truth, settings


def _headed(dialect: Dialect, name: str, unit: str) -> str:
    return dialect.heading.format(name, unit) if unit else name


def _leave_out(
    draw: random.Random, dialect: Dialect, cells: list[list[str]], values: list[files.Floats]
) -> None:
    """Remove some samples within the columns."""
    if draw.random() < 0.8:
        return
    can_be_empty = dialect.mark != " " and (len(cells) > 1 or dialect.clock != "rate")
    words = [one for one in MISSING if one or can_be_empty]
    for column, known in zip(cells, values, strict=True):
        for place in draw.sample(range(3, len(column) - 3), min(3, len(column) - 6)):
            text = draw.choice(words)
            column[place], known[place] = (
                text.replace(".", dialect.decimal) if text[:1] == "9" else text,
                np.nan,
            )


def _clock(dialect: Dialect, signals: files.Signals) -> tuple[str, list[str]] | None:
    """Return heading and cells of the instants; None where the user gives the rate."""
    if dialect.clock == "rate":
        return None
    if dialect.clock == "stamps" and dialect.mark != " " and signals.interval > 1e-3:
        steps = [SINCE + timedelta(seconds=place * signals.interval) for place in range(signals.count)]
        return STAMPS, [step.isoformat(sep=" ", timespec="microseconds") for step in steps]
    factor, unit = (1e3, "ms") if dialect.clock == "thousandths" else (1.0, "s")
    texts = [f"{factor * instant:.9f}".replace(".", dialect.decimal) for instant in signals.instants]
    return dialect.heading.format("time", unit), texts


def _footer(draw: random.Random, dialect: Dialect, width: int) -> list[str]:
    if dialect.mark == " " or width < 2 or draw.random() < 0.85:
        return []
    return [dialect.row([name, *[dialect.cell(1.25)] * (width - 1)]) for name in ("mean", "rms")]


def _written(lines: Sequence[str], dialect: Dialect) -> bytes:
    return (dialect.ending.join(lines) + dialect.ending).encode(dialect.encoding, "replace")


def odd_lines(draw: random.Random, lines: Sequence[str], mark: str) -> list[str]:
    """Return lines with cells or lines made odd, doubled, dropped or exchanged."""
    changed = list(lines)
    for _ in range(draw.choice((1, 1, 2, 5, 40))):
        place = draw.randrange(len(changed))
        match draw.randrange(5):
            case 0 | 1:
                cells = changed[place].split(mark)
                cells[draw.randrange(len(cells))] = draw.choice(ODD_CELLS)
                changed[place] = mark.join(cells)
            case 2:
                changed.insert(place, draw.choice((*ODD_CELLS, *BEFORE, mark * draw.choice((1, 9, 3000)))))
            case 3:
                changed[place] = changed[draw.randrange(len(changed))]
            case _ if len(changed) > 2:
                changed[place : place + draw.choice((1, 3, 30))] = changed[:1]
    return changed


def check(seed: int) -> str | None:
    """Read one table."""
    draw = random.Random(seed)
    if draw.random() < 0.2:
        return _export(draw)
    lines, dialect, truth, settings = drawn_table(draw)
    path = Path("table.csv")
    kind = draw.random()
    if kind < 0.5:
        path.write_bytes(_written(lines, dialect))
        return _with_dialect(files.sound(path, truth, settings), dialect)
    if kind < 0.6 and dialect.encoding != "utf-16":
        path.write_bytes(_written(lines, dialect)[: -draw.randint(1, 60)])
        return _cut(path, truth, settings)
    content = _written(odd_lines(draw, lines, dialect.mark), dialect)
    for _ in range(draw.choice((0, 0, 1, 3))):
        place = draw.randrange(len(content) + 1)
        content = content[:place] + draw.choice(INSERTED) + content[place:]
    path.write_bytes(content)
    return files.odd(path, settings if draw.random() < 0.5 else None)


def _with_dialect(problem: str | None, dialect: Dialect) -> str | None:
    return problem and f"{problem} ({dialect})"


def _cut(path: Path, truth: files.Truth, settings: dict[str, Any]) -> str | None:
    try:
        recording = imported_directly(path, settings)
    except VibroimpactError as refusal:
        return files.badly_said(refusal, path)
    return files.beginning(recording, truth)


def _export(draw: random.Random) -> str | None:
    """Read an export of an instrument, unchanged or with odd cells."""
    kind = draw.choice(sorted(EXPORTS))
    export = EXPORTS[kind][1](draw.randrange(2**31))
    path = Path("export.csv")
    if draw.random() < 0.6:
        path.write_text("\n".join(export.lines) + "\n", encoding=export.encoding)
        first = export.intervals[0]
        if any(other != first for other in export.intervals):
            return files.odd(path)
        truth = files.Truth(export.values, export.units, first, export.start, export.names)
        problem = files.sound(path, truth)
        return problem and f"{kind}: {problem}"
    mark = draw.choice((",", ";", "\t"))
    path.write_text("\n".join(odd_lines(draw, export.lines, mark)) + "\n", encoding="utf-8", errors="replace")
    problem = files.odd(path)
    return problem and f"{kind}: {problem}"

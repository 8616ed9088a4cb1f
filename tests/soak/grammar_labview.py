"""LabVIEW measurement files of drawn headers and segments: read equal; with odd entries and lines: read or refused."""

from __future__ import annotations

import random
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from soak import _drawn_files as files
from soak.grammar_text import ODD_CELLS, odd_lines

CASES, SAMPLE, SECONDS = files.CASES, files.SAMPLE, files.SECONDS

SEPARATORS = {"Tab": "\t", "Comma": ",", "Semicolon": ";"}
ENTRIES = (
    *(
        "Writer_Version\t2",
        "Reader_Version\t2",
        "Multi_Headings\tYes",
        "Time_Pref\tAbsolute",
        "Operator\tnobody",
    ),
    *("Date\t2026/07/30", "Time\t10:00:00.5000000000000000001", "Description\tbeam 3", "X_Columns\tOne"),
)
KEYS = (
    "Separator",
    "Decimal_Separator",
    "X_Columns",
    "Delta_X",
    "X0",
    "Samples",
    "Channels",
    "Date",
    "Time",
    "Notes",
    "X_Dimension",
    "Y_Unit_Label",
)
"""Entries with a meaning."""
END = "***End_of_Header***"


@dataclass(frozen=True)
class Form:
    """Style of a file: its separator, decimal sign and columns of instants."""

    name: str
    decimal: str
    columns: str

    @property
    def mark(self) -> str:
        return SEPARATORS[self.name]

    def written(self, value: float) -> str:
        """Return a number in the file's style."""
        return f"{value:.6f}".replace(".", self.decimal)


def drawn_file(draw: random.Random) -> tuple[list[str], Form, files.Truth]:
    """Return the lines of a file, its style, and its expected reading."""
    name = draw.choice(list(SEPARATORS))
    form = Form(
        name, draw.choice((".", ",")) if name != "Comma" else ".", draw.choice(("No", "One", "Multi"))
    )
    signals = files.drawn_signals(draw)
    values = [np.array([float(f"{value:.6f}") for value in one]) for one in signals.values]
    truth = files.Truth(values, files.truth_of(signals).units, signals.interval, signals.start, signals.names)
    head = ["LabVIEW Measurement", *_entries(draw, form), END, ""]
    special = ["***Start_Special***", "anything 1 2 3", "***End_Special***"] if draw.random() < 0.1 else []
    lines = [*head, *special, *_segment(draw, form, signals), *_rows(draw, form, signals, values)]
    return [line.replace("\t", form.mark) for line in lines], form, truth


def _entries(draw: random.Random, form: Form) -> list[str]:
    more = [entry for entry in draw.sample(ENTRIES, draw.randrange(4)) if not entry.startswith("X_Columns")]
    own = [f"Separator\t{form.name}", f"X_Columns\t{form.columns}"]
    return [
        *own,
        *([f"Decimal_Separator\t{form.decimal}"] if form.decimal == "," or draw.random() < 0.5 else []),
        *more,
    ]


def _segment(draw: random.Random, form: Form, signals: files.Signals) -> list[str]:
    many = len(signals.values)

    def each(key: str, cells: list[str]) -> str:
        between = "\t\t" if form.columns == "Multi" else "\t"
        return f"{key}\t{between.join(cells)}"

    entries = [
        f"Channels\t{many}",
        each("Samples", [str(signals.count)] * many),
        each("Date", ["2026/07/30"] * many),
        each("Time", ["10:00:00.25"] * many),
        each("Y_Unit_Label", list(signals.units)),
        each("X_Dimension", ["Time"] * many),
        each("X0", [repr(signals.start).replace(".", form.decimal)] * many),
        each("Delta_X", [repr(signals.interval).replace(".", form.decimal)] * many),
    ]
    if draw.random() < 0.2:
        entries.append("Notes\tof the beam")
    heads = (
        [f"X_Value\t{name}" for name in signals.names]
        if form.columns == "Multi"
        else ["X_Value", *signals.names]
    )
    return [*entries, END, "\t".join([*heads, "Comment"])]


def _rows(draw: random.Random, form: Form, signals: files.Signals, values: list[files.Floats]) -> list[str]:
    rows = []
    for place, instant in enumerate(signals.instants):
        time = "" if form.columns == "No" else f"{instant:.9f}".replace(".", form.decimal)
        cells = [form.written(one[place]) for one in values]
        row = [f"{time}\t{cell}" for cell in cells] if form.columns == "Multi" else [time, *cells]
        rows.append("\t".join(row) + ("\tstart" if place == 0 and draw.random() < 0.1 else ""))
    return rows


def odd_entries(draw: random.Random, lines: list[str], mark: str) -> list[str]:
    """Return a file with an odd header."""
    ends = [place for place, line in enumerate(lines) if line.startswith(END)]
    for _ in range(draw.choice((1, 2, 5))):
        cells = [
            draw.choice((files.word(draw), draw.choice(ODD_CELLS), str(files.number(draw))))
            for _ in range(draw.randint(1, 4))
        ]
        lines.insert(draw.randrange(1, ends[-1] + 2), mark.join([draw.choice((*KEYS, END)), *cells]))
    return lines


def check(seed: int) -> str | None:
    """Read one file."""
    draw = random.Random(seed)
    lines, form, truth = drawn_file(draw)
    path, kind = Path("record.lvm"), draw.random()
    if kind >= 0.5:
        lines = odd_entries(draw, lines, form.mark) if kind < 0.75 else odd_lines(draw, lines, form.mark)
    content = ("\r\n".join(lines) + "\r\n").encode("utf-8", "replace")
    path.write_bytes(content)
    if kind < 0.5:
        problem = files.sound(path, truth)
        return problem and f"{problem} ({form})"
    return files.odd(path)

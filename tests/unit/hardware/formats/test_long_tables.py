"""Long tables are parsed in pieces, with the same result as line by line."""

from __future__ import annotations

import subprocess
import sys
import time
import tracemalloc
from contextlib import suppress
from pathlib import Path

import numpy as np
import psutil
import pytest

from vibroimpact.hardware.formats import long_tables, text
from vibroimpact.hardware.formats.table import RawFile
from vibroimpact.hardware.formats.text import read_text

VALUES = np.round(np.random.default_rng(5).normal(size=(3, 900)), 6)
MOST_MEMORY = 1_000_000_000
"""Maximum memory of an import of 10^7 rows, bytes in all its processes; lines of text took 2.2 GB."""


def table(mark: str, decimal: str, end: str = "\n") -> str:
    rows = [
        mark.join(f"{one:.6f}" for one in (0.002 * at, *VALUES[:, at])).replace(".", decimal)
        for at in range(900)
    ]
    return "\n".join([mark.join(("Time (s)", "a (g)", "b (N)", "c (mV)")), *rows]) + end


def same(one: RawFile, other: RawFile) -> None:
    assert (one.source_format, list(one.remarks)) == (other.source_format, list(other.remarks))
    for left, right in zip(one.tables, other.tables, strict=True):
        assert (left.time is None) == (right.time is None)
        columns = [*left.columns, *([left.time] if left.time else [])]
        others = [*right.columns, *([right.time] if right.time else [])]
        for column, found in zip(columns, others, strict=True):
            assert (column.label, column.unit) == (found.label, found.unit)
            np.testing.assert_array_equal(column.values, found.values)
            assert (column.overrange is None) == (found.overrange is None)


COMMA, TABS = table(",", "."), table("\t", ",")
MARKED = COMMA.splitlines()
MARKED[300], MARKED[400] = "0.598000,9.9e37,inf,nan", "0.798000,-inf,1.5,9.91e37"
TEXTS = {
    "plain": COMMA,
    "decimal commas": TABS,
    "cut off": COMMA[:-9],
    "cut off in a row": COMMA[:-30],
    "no final line break": COMMA[:-1],
    "a comment": COMMA[:9000] + COMMA[9000:].replace("\n", "\n# a remark\n", 1),
    "an empty cell": COMMA[:9000] + COMMA[9000:].replace("\n", "\n,,,\n", 1),
    "a footer": COMMA + "Mean,0.1,0.2,0.3\n",
    "marked": "\n".join(MARKED) + "\n",
    "windows": COMMA.replace("\n", "\r\n"),
    "blanks": COMMA.replace(",", "  "),
    "a comment above": "# of a lab\n" + COMMA,
}


@pytest.mark.parametrize("kind", sorted(TEXTS))
def test_a_table_in_pieces_is_the_table_by_lines(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    by_lines = read_text(TEXTS[kind])
    monkeypatch.setattr(text, "LONG", 1000)
    monkeypatch.setattr(text, "_LONG_HEAD", 4000)
    monkeypatch.setattr(long_tables, "_PIECE", 8000)
    same(read_text(TEXTS[kind]), by_lines)


@pytest.mark.parametrize("kind", ["plain", "decimal commas", "cut off", "windows", "a comment above"])
def test_a_table_of_plain_numbers_is_read_in_pieces(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(text, "LONG", 1000)
    monkeypatch.setattr(long_tables, "_PIECE", 8000)
    monkeypatch.setattr(text, "_rows", None)  # the reader by lines
    assert len(read_text(TEXTS[kind]).tables[0].columns) == 3


def test_a_long_table_takes_a_few_times_its_numbers() -> None:
    content = "\n".join(f"{value:.6f}" for value in np.tile(VALUES[0], 1000)) + "\n"
    tracemalloc.start()
    try:
        raw = read_text(content)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    (column,) = raw.tables[0].columns
    assert len(column.values) == 900_000
    # lines of text took 250 bytes a row
    assert peak < 100 * len(column.values)


@pytest.mark.long
def test_ten_million_rows_of_one_column_are_imported_in_less_than_a_gigabyte(tmp_path: Path) -> None:
    path = tmp_path / "rows.txt"
    with path.open("w") as file:
        for _ in range(10):
            file.write("\n".join(f"{one:.6f}" for one in np.random.default_rng(1).normal(size=10**6)) + "\n")
    program = "from vibroimpact.orchestrator.commands.cli import main; main()"
    words = ["import", path, "--rate", "20000", "-o", tmp_path / "r.nc"]
    importing = psutil.Popen([sys.executable, "-c", program, *words], stdout=subprocess.DEVNULL)
    most = 0
    while importing.poll() is None:
        with suppress(psutil.Error):
            everyone = [importing, *importing.children(recursive=True)]
            most = max(most, sum(process.memory_full_info().pss for process in everyone))
        time.sleep(0.05)
    assert importing.returncode == 0
    assert most < MOST_MEMORY

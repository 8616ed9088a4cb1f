"""`make exchange`: every export in every tool that is here, into docs/exchange.md; exit code 1 where one differs."""

from __future__ import annotations

import re
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from rich.console import Console
from support.places import ROOT

from exchange._cases import (
    COUNT,
    NAMES,
    PAIR_OUTPUTS,
    PAIRS,
    RATE,
    Rows,
    difference,
    made,
    made_pair,
    outputs,
)
from exchange._tools import TOOLS, Answer, Tool, ToolFailedError, run, run_coupled

PAGE = ROOT / "docs" / "exchange.md"
GOAL = 1e-9
CONSOLE = Console(width=180)
CONSOLE.soft_wrap = True


def main() -> int:
    """Try all, print and write the tables."""
    bad = [*_write("tools", list(NAMES), _row_of_tool), *_write("pairs", list(PAIRS), _row_of_pair)]
    for line in bad:
        CONSOLE.print(line, style="red", markup=False)
    CONSOLE.print(f"The tables are in {PAGE.relative_to(ROOT)}.")
    return 1 if bad else 0


Cell = float | str
Row = Callable[[Tool, str, list[str]], Iterator[Cell]]


def _write(table: str, names: list[str], row: Row) -> Iterator[str]:
    """Write a table into the page; yield what was not as it should be."""
    lines = ["| tool | FMI | " + " | ".join(names) + " |", "|---" * (2 + len(names)) + "|"]
    for tool in TOOLS:
        for versions, cells in _cells(tool, table, row):
            texts = [cell if isinstance(cell, str) else f"{cell:.1g}" for cell in cells]
            texts += [""] * (len(names) - len(texts))
            lines.append(
                f"| {tool.name if tool.missing() else tool.shown()} | {versions} | {' | '.join(texts)} |"
            )
            CONSOLE.print(lines[-1], markup=False)
            tried = [cell for cell in cells if not str(cell).startswith(("not tried", "couples none"))]
            if not all(isinstance(cell, float) and cell <= GOAL for cell in tried):
                yield f"{tool.name}, FMI {versions}: expected {GOAL:g} at most, got {', '.join(texts)}."
    begin, end = f"<!-- {table}: written by make exchange -->", f"<!-- end of {table} -->"
    written = "\n".join((begin, *lines, end))
    text = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(re.sub(f"{begin}.*{end}", lambda _: written, text, flags=re.S), encoding="utf-8")


def _cells(tool: Tool, table: str, row: Row) -> Iterator[tuple[str, list[Cell]]]:
    """Yield the rows of a tool: the version or versions of FMI, and the cells."""
    versions = tool.couples if table == "pairs" else tool.versions
    if not versions:
        yield ", ".join(tool.versions), ["couples none"]
    elif reason := tool.missing():
        yield ", ".join(versions), [f"not tried: {reason}"]
    else:
        for fmi in versions:
            yield fmi, list(row(tool, fmi, list(PAIRS if table == "pairs" else NAMES)))


def _row_of_tool(tool: Tool, fmi: str, names: list[str]) -> Iterator[Cell]:
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            path, expected = made(name, fmi, Path(folder))
            yield _cell(run, expected, tool, path, outputs(name), 1.0 / RATE, COUNT, Path(folder))


def _row_of_pair(tool: Tool, fmi: str, names: list[str]) -> Iterator[Cell]:
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            fmus, expected = made_pair(name, fmi, Path(folder))
            connections = PAIRS[name].connections
            yield _cell(
                run_coupled, expected, tool, fmus, connections, PAIR_OUTPUTS, 1.0 / RATE, COUNT, Path(folder)
            )


def _cell(ask: Callable[..., Answer], expected: Rows, *arguments: object) -> Cell:
    try:
        answer = ask(*arguments)
    except ToolFailedError as error:
        print(error, file=sys.stderr)
        return "failed"
    if answer.complaints:
        print(*dict.fromkeys(answer.complaints), sep="\n", file=sys.stderr)
        return "warned"
    rows = np.array(answer.rows)
    return difference(rows, expected) if rows.shape == expected.shape else f"{len(rows)} steps"


if __name__ == "__main__":
    sys.exit(main())

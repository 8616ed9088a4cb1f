"""`make exchange`: every export in every tool that is here, into docs/exchange.md; exit code 1 where one differs."""

from __future__ import annotations

import re
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from rich.console import Console
from support.places import ROOT

from exchange._cases import COUNT, NAMES, RATE, difference, made, outputs
from exchange._tools import TOOLS, Tool, ToolFailedError, values

PAGE = ROOT / "docs" / "exchange.md"
BEGIN, END = "<!-- tools: written by make exchange -->", "<!-- end of tools -->"
GOAL = 1e-9


def main() -> int:
    """Try all, print and write the table."""
    console = Console(width=140)
    lines = ["| tool | FMI | " + " | ".join(NAMES) + " |", "|---" * (2 + len(NAMES)) + "|"]
    good = True
    for tool in TOOLS:
        if reason := tool.missing():
            lines.append(
                f"| {tool.name} | {', '.join(tool.versions)} | not tried: {reason} |"
                + " |" * (len(NAMES) - 1)
            )
            console.print(lines[-1])
            continue
        for fmi in tool.versions:
            cells = list(_cells(tool, fmi))
            good &= all(isinstance(cell, float) and cell <= GOAL for cell in cells)
            texts = [cell if isinstance(cell, str) else f"{cell:.1g}" for cell in cells]
            lines.append(f"| {tool.shown()} | {fmi} | {' | '.join(texts)} |")
            console.print(lines[-1])
    text = PAGE.read_text(encoding="utf-8")
    table = "\n".join((BEGIN, *lines, END))
    PAGE.write_text(re.sub(f"{BEGIN}.*{END}", lambda _: table, text, flags=re.S), encoding="utf-8")
    console.print(f"The table is in {PAGE.relative_to(ROOT)}.")
    return 0 if good else 1


def _cells(tool: Tool, fmi: str) -> Iterator[float | str]:
    for name in NAMES:
        with tempfile.TemporaryDirectory() as folder:
            path, expected = made(name, fmi, Path(folder))
            try:
                rows = values(tool, path, outputs(name), 1.0 / RATE, COUNT, Path(folder))
            except ToolFailedError as error:
                print(error, file=sys.stderr)
                yield "failed"
                continue
        yield difference(np.array(rows), expected)


if __name__ == "__main__":
    sys.exit(main())

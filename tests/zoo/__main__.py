"""`make zoo ZOO=folder`: every FMU and system below a folder in our importer, beside FMPy; into docs/exchange.md.

Each trial has a process of its own with limits of time and memory. `build/zoo.json` has the result of each file.
Exit code 1 if an FMU or a system is not run for a reason that no cause explains.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path

from support.places import ROOT

from zoo._collection import fmus, systems
from zoo._guarded import tried
from zoo._table import (
    CLOSE,
    OTHER,
    Row,
    beside_reference,
    cause_of,
    difference,
    maker_of,
    table_of_systems,
    table_of_tools,
)

PAGE = ROOT / "docs" / "exchange.md"
RECORD = ROOT / "build" / "zoo.json"
AT_ONCE = min(4, os.cpu_count() or 1)


def main() -> int:
    """Try all files, print a line for each, and write the tables."""
    if len(sys.argv) != 2 or not Path(sys.argv[1]).is_dir():
        print(
            "make zoo: expected a folder of FMUs and systems. Name it: make zoo ZOO=folder", file=sys.stderr
        )
        return 2
    folder = Path(sys.argv[1])
    with tempfile.TemporaryDirectory() as packed, ThreadPoolExecutor(AT_ONCE) as pool:
        rows = list(_shown(pool.map(lambda path: fmu_row(path, folder), fmus(folder))))
        tested = list(_shown_systems(pool.map(_system, systems(folder, Path(packed)))))
    RECORD.parent.mkdir(exist_ok=True)
    record = {"fmus": [asdict(row) for row in rows], "systems": dict(tested)}
    RECORD.write_text(json.dumps(record, indent=1))
    write(PAGE, "zoo", table_of_tools(rows))
    write(PAGE, "zoo of systems", table_of_systems(refusal for _, refusal in tested))
    unexplained = [
        one for one in (*(r.refusal for r in rows), *(r for _, r in tested)) if cause_of(one) == OTHER
    ]
    print(
        f"The tables are in {PAGE.relative_to(ROOT)}, the result of each file in {RECORD.relative_to(ROOT)}."
    )
    return 1 if unexplained else 0


def fmu_row(path: Path, folder: Path) -> Row:
    """Try an FMU: facts and `fmu check`, our run, and FMPy's run if ours ran."""
    mine = tried("ours", path)
    row = Row(str(path.relative_to(folder)), maker_of(mine.get("tool", "")), ", ".join(mine.get("kinds", [])))
    row.passes = not mine.get("refused", True)
    row.refusal = mine.get("refusal", "").replace(str(path.resolve()), path.name)
    if row.refusal:
        return row
    peer = tried("fmpy", path)
    row.peer_refusal = peer.get("refusal", "")
    if not row.peer_refusal and mine["values"]:
        row.difference, row.worst = difference(mine["time"], mine["values"], peer["time"], peer["values"])
    row.reference = beside_reference(path, mine["time"], mine["values"])
    return row


def write(page: Path, table: str, lines: Sequence[str]) -> None:
    """Write a table between its two marks on a page."""
    text = page.read_text(encoding="utf-8")
    start, end = f"<!-- {table}: written by make zoo -->", f"<!-- end of {table} -->"
    before, _, rest = text.partition(start)
    _, _, after = rest.partition(end)
    page.write_text(before + "\n".join([start, *lines, end]) + after, encoding="utf-8")


def _system(named: tuple[str, Path]) -> tuple[str, str]:
    name, path = named
    return name, str(tried("system", path).get("refusal", "")).replace(str(path.resolve()), path.name)


def _shown(rows: Iterator[Row]) -> Iterator[Row]:
    for row in rows:
        if row.refusal:
            said = f"not run: {row.refusal}"
        elif row.peer_refusal:
            said = f"ran; FMPy: {row.peer_refusal}"
        elif row.difference is None:
            said = "ran; no output to compare"
        else:
            said = (
                "ran, equal" if row.difference <= CLOSE else f"ran, {row.difference:.1e} off in {row.worst}"
            )
        print(f"{row.name} ({row.maker}): {said}", flush=True)
        yield row


def _shown_systems(found: Iterator[tuple[str, str]]) -> Iterator[tuple[str, str]]:
    for name, refusal in found:
        print(f"{name}: {f'not run: {refusal}' if refusal else 'ran'}", flush=True)
        yield name, refusal


if __name__ == "__main__":
    sys.exit(main())

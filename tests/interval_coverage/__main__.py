"""`make coverage`: 480 records, side by side; resumable; exit code 1 if a target is missed. SEED= RECORDS="""

from __future__ import annotations

import json
import multiprocessing
import os
import sys
from collections.abc import Iterable
from functools import partial
from pathlib import Path

from rich.console import Console
from soak._journal import state_of_the_code
from support.places import ROOT

from interval_coverage._asked import journal_line
from interval_coverage._table import Line, again, shares, table_of, thin_cells

SEED, RECORDS = 7, 480
DRAWS = 7
"""Number of further noises for the records of a table cell with few intervals."""
Place = tuple[int, int]
"""Number of the case, and of the draw of its noise."""


def main() -> int:
    """Estimate all records outside of the journal, and further noises for cells with few intervals; print the table."""
    seed, count = int(os.environ.get("SEED") or SEED), int(os.environ.get("RECORDS") or RECORDS)
    console = Console(width=110)
    path = ROOT / "results" / "coverage" / f"seed-{seed}-{state_of_the_code()}.jsonl"
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = {place: line for place, line in read(path).items() if place[0] < count}
    console.print(f"seed {seed}, {count} records, journal {path.relative_to(ROOT)} ({len(lines)} there)")
    with multiprocessing.get_context("spawn").Pool(os.cpu_count()) as pool, path.open("a") as journal:

        def ask(places: Iterable[Place]) -> None:
            waiting = [place for place in places if place not in lines]
            for line in pool.imap_unordered(partial(journal_line, seed=seed), waiting):
                print(json.dumps(line), file=journal, flush=True)
                lines[line["case"], line["draw"]] = line
                if len(lines) % 10 == 0:
                    console.print(f"{len(lines)} answers, {count} records")

        ask((case, 0) for case in range(count))
        cases = sorted(
            {case for found in thin_cells(lines.values()).values() for case in found if count >= RECORDS}
        )
        ask((case, draw) for case in cases for draw in range(1, DRAWS + 1))
    first = [line for line in lines.values() if not line["draw"]]
    found = [*shares(first), *(again(list(lines.values()), DRAWS) if count >= RECORDS else [])]
    console.print(table_of(found))
    missed = [one.what for one in found if one.missed]
    console.print(f"{len(missed)} targets missed")
    return int(bool(missed))


def read(path: Path) -> dict[Place, Line]:
    """Return the complete lines of a journal by case and draw; a truncated line is computed again."""
    if not path.exists():
        return {}
    text = path.read_text(encoding="utf-8")
    whole = text[: text.rfind("\n") + 1]
    if whole != text:
        path.write_text(whole, encoding="utf-8")
    return {(line["case"], line["draw"]): line for line in map(json.loads, whole.splitlines())}


if __name__ == "__main__":
    sys.exit(main())

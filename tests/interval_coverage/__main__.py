"""`make coverage`: 300 records, side by side; resumable; exit code 1 where a target is missed. SEED= RECORDS="""

from __future__ import annotations

import json
import multiprocessing
import os
import sys
from functools import partial
from pathlib import Path

from rich.console import Console
from soak._journal import ROOT, state_of_the_code

from interval_coverage._asked import asked
from interval_coverage._table import Line, shares, table_of

SEED, RECORDS = 7, 300


def main() -> int:
    """Ask all records that the journal does not hold, and print the table."""
    seed, count = int(os.environ.get("SEED") or SEED), int(os.environ.get("RECORDS") or RECORDS)
    console = Console(width=110)
    path = ROOT / "results" / "coverage" / f"seed-{seed}-{state_of_the_code()}.jsonl"
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = {case: line for case, line in read(path).items() if case < count}
    console.print(f"seed {seed}, {count} records, journal {path.relative_to(ROOT)} ({len(lines)} there)")
    waiting = [case for case in range(count) if case not in lines]
    with multiprocessing.get_context("spawn").Pool(os.cpu_count()) as pool, path.open("a") as journal:
        for line in pool.imap_unordered(partial(asked, seed=seed), waiting):
            print(json.dumps(line), file=journal, flush=True)
            lines[line["case"]] = line
            if len(lines) % 10 == 0:
                console.print(f"{len(lines)} of {count}")
    found = shares(list(lines.values()))
    console.print(table_of(found))
    missed = [one.what for one in found if one.missed]
    console.print(f"{len(missed)} targets missed")
    return int(bool(missed))


def read(path: Path) -> dict[int, Line]:
    """Return the whole lines of a journal by case; one that was cut off is asked again."""
    if not path.exists():
        return {}
    text = path.read_text(encoding="utf-8")
    whole = text[: text.rfind("\n") + 1]
    if whole != text:
        path.write_text(whole, encoding="utf-8")
    return {line["case"]: line for line in map(json.loads, whole.splitlines())}


if __name__ == "__main__":
    sys.exit(main())

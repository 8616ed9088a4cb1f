"""`make soak`: all kinds, many cases each, side by side; resumable.

`python -m soak KIND ...` runs these kinds alone; `python -m soak KIND SEED` tries one case.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Sequence

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table
from support.places import ROOT

from soak._case import attempt
from soak._journal import Journal, Tried, state_of_the_code
from soak._kinds import Kind, kind, names
from soak._runner import Counts, run

BASE_SEED = 1998
MINUTES = 60.0
LINE_SECONDS = 60.0
"""Time between two lines of progress where there is no terminal to draw bars on."""
PROBLEMS_SHOWN = 20
"""Problems of each kind that are shown; the journal holds all."""


def main(arguments: Sequence[str]) -> int:
    """Run one case or all; return the exit code: 0 without problems, 1 with problems, 2 for misuse."""
    if len(arguments) == 2 and arguments[1].isdecimal():
        seconds, problem = attempt(arguments[0], "soak", int(arguments[1]))
        print(f"{arguments[0]} {arguments[1]}: {problem or 'no problem'} ({seconds:.2f} s)")
        return int(problem is not None)
    chosen = [*arguments] or os.environ.get("KINDS", "").replace(",", " ").split() or names()
    if unknown := sorted(set(chosen) - set(names())):
        where = "kinds" if arguments else "KINDS"
        print(
            f"soak: {where}: expected some of {', '.join(names())}, got {', '.join(unknown)}.",
            file=sys.stderr,
        )
        return 2
    kinds = [kind(name) for name in chosen]
    number = _number("CASES", 0.0)
    return _soak(
        kinds,
        {one.name: int(number) or one.cases for one in kinds},
        int(_number("SEED", BASE_SEED)),
        60.0 * _number("MINUTES", MINUTES),
    )


def _number(name: str, default: float) -> float:
    given = os.environ.get(name, "")
    try:
        value = float(given) if given else default
    except ValueError:
        value = -1.0
    if not 0 <= value < 1e9:
        print(f"soak: {name}: expected a number from 0 on, got {given!r}.", file=sys.stderr)
        sys.exit(2)
    return value


def _soak(kinds: Sequence[Kind], counts: Counts, base: int, seconds: float) -> int:
    console = Console()
    journal = Journal(ROOT / "results" / "soak" / f"seed-{base}-{state_of_the_code()}.jsonl")
    console.print(f"seed {base}, at most {seconds / 60:g} minutes, journal {journal.path.relative_to(ROOT)}")
    try:
        with _Display(console, kinds, counts, journal) as shown:
            done = run(kinds, counts, base, journal, seconds, report=shown.add)
    except KeyboardInterrupt:
        console.print("Interrupted; the same command goes on from here.")
        done = False
    finally:
        journal.close()
    return _report(console, kinds, counts, journal, done)


class _Display:
    """Progress: bars on a terminal, else a line each minute."""

    def __init__(self, console: Console, kinds: Sequence[Kind], counts: Counts, journal: Journal) -> None:
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
        self._progress = Progress(*columns, TextColumn("{task.fields[problems]} problems"), console=console)
        self._tried = {one.name: journal.of(one.name) for one in kinds}
        self._counts, self._said = counts, time.monotonic()
        self._tasks = {
            one.name: self._progress.add_task(
                one.name,
                total=counts[one.name],
                completed=len(self._tried[one.name]),
                problems=_problems(self._tried[one.name]),
            )
            for one in kinds
        }

    def __enter__(self) -> _Display:
        if self._progress.console.is_terminal:
            self._progress.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._progress.stop()

    def add(self, entry: Tried) -> None:
        """Count a case."""
        self._tried[entry.kind].append(entry)
        problems = _problems(self._tried[entry.kind]) if entry.problem is not None else None
        task = self._tasks[entry.kind]
        self._progress.update(task, advance=1, **({} if problems is None else {"problems": problems}))
        if not self._progress.console.is_terminal and time.monotonic() - self._said > LINE_SECONDS:
            self._said = time.monotonic()
            far = (f"{name} {len(tried)}/{self._counts[name]}" for name, tried in self._tried.items())
            print(f"{', '.join(far)}; {sum(map(_problems, self._tried.values()))} problems", flush=True)


def _problems(tried: Sequence[Tried]) -> int:
    return sum(entry.problem is not None for entry in tried)


def _report(console: Console, kinds: Sequence[Kind], counts: Counts, journal: Journal, done: bool) -> int:
    table = Table("kind", "cases", "problems", "slowest, s", "its seed", "seeds of problems")
    for one in kinds:
        tried = journal.of(one.name)
        slowest = max(tried, key=lambda entry: entry.seconds, default=None)
        seeds = [str(entry.seed) for entry in tried if entry.problem is not None]
        more = [f"and {len(seeds) - PROBLEMS_SHOWN} more"] if len(seeds) > PROBLEMS_SHOWN else []
        table.add_row(
            one.name,
            f"{len(tried)} of {counts[one.name]}",
            str(len(seeds)),
            "" if slowest is None else f"{slowest.seconds:.2f}",
            "" if slowest is None else str(slowest.seed),
            " ".join(seeds[:PROBLEMS_SHOWN] + more),
        )
    bad = [entry for one in kinds for entry in journal.of(one.name) if entry.problem is not None]
    for one in kinds:
        for entry in [entry for entry in bad if entry.kind == one.name][:PROBLEMS_SHOWN]:
            console.print(f"{entry.kind} {entry.seed}: {entry.problem}", markup=False, soft_wrap=True)
    console.print(table)
    if not done:
        console.print(
            "The time was up; the table says how far each kind came, and the same command goes on from there."
        )
    console.print(f"{len(bad)} problems")
    return int(bool(bad))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

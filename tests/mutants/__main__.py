"""`python -m mutants`: 60 drawn faults and the chosen ones, side by side; resumable. SEED= MINUTES= KINDS= CASES=

Exit code 1 if fewer than 95 % of all, or 90 % of the drawn ones, are detected. `python -m mutants KIND SEED` tries
a single fault.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

from rich.console import Console
from soak._case import attempt
from soak._journal import Journal, Tried, state_of_the_code
from soak._kinds import kind, names
from soak._runner import run
from support.places import ROOT

PACKAGE = "mutants"
SEED, MINUTES = 1998, 60.0
LEAST, LEAST_DRAWN = 0.95, 0.9


def main(arguments: Sequence[str]) -> int:
    """Try one fault or all; return the exit code."""
    if len(arguments) == 2:
        seconds, problem = attempt(arguments[0], PACKAGE, int(arguments[1]))
        print(f"{arguments[0]} {arguments[1]}: {problem or 'noticed'} ({seconds:.0f} s)")
        return int(problem is not None)
    console, base = Console(), int(os.environ.get("SEED") or SEED)
    # the variables are those of `make soak`, which may name only kinds of its own
    requested = os.environ.get("KINDS", "").replace(",", " ").split()
    kinds = [kind(name, PACKAGE) for name in names(PACKAGE) if not requested or name in requested]
    if not kinds:
        return 0
    counts = {one.name: min(one.cases, int(os.environ.get("CASES") or one.cases)) for one in kinds}
    journal = Journal(ROOT / "results" / "mutants" / f"seed-{base}-{state_of_the_code()}.jsonl")
    console.print(f"seed {base}, journal {journal.path.relative_to(ROOT)}")

    def report(entry: Tried) -> None:
        console.print(
            f"{entry.kind} {entry.seed}: {entry.problem or 'noticed'} ({entry.seconds:.0f} s)", markup=False
        )

    try:
        done = run(
            kinds, counts, base, journal, 60.0 * float(os.environ.get("MINUTES") or MINUTES), report=report
        )
    except KeyboardInterrupt:
        done = False
    finally:
        journal.close()
    if not done:
        console.print("Not all were tried; the same command goes on from here.")
    return _report(console, {one.name: journal.of(one.name)[: counts[one.name]] for one in kinds})


def _report(console: Console, tried: dict[str, list[Tried]]) -> int:
    shares = {}
    for name, found in (*tried.items(), ("all", [entry for each in tried.values() for entry in each])):
        survivors = [entry for entry in found if entry.problem is not None]
        shares[name] = 1.0 - len(survivors) / max(1, len(found))
        console.print(
            f"{name}: {len(found) - len(survivors)} of {len(found)} noticed, {100.0 * shares[name]:.1f} %"
        )
    for entry in [entry for found in tried.values() for entry in found if entry.problem is not None]:
        console.print(f"{entry.kind} {entry.seed}: {entry.problem}", markup=False, soft_wrap=True)
    return int(shares["all"] < LEAST or shares.get("drawn", 1.0) < LEAST_DRAWN)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

"""What `vibroimpact hard-cases` does: it runs what breaks solvers, and prints each figure beside its bound."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import typer
from rich.live import Live
from rich.table import Table

from vibroimpact.analysis.commands.found import refuse_places, write_found
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.terminal import say, wide_terminal
from vibroimpact.orchestrator.commands.check import duration
from vibroimpact.orchestrator.commands.failures import counted
from vibroimpact.orchestrator.hard_cases import CASES, Measured, cases_named, dataset_of, measured_cases
from vibroimpact.orchestrator.operations.hard_cases import HardCases

VERDICTS = ("wrong", "slow")
"""Of cases beyond their bound: a figure that is an error, and one that is a time."""


def show_hard_cases(options: HardCases) -> None:
    """Run hard cases, print a table, and write what was asked for.

    Raises
    ------
    typer.Exit
        A figure is wrong, or Ctrl-C came; what was measured before is printed and written.
    """
    only = options.only or ()
    if options.names:
        for case in CASES:
            say(f"{case.name}: {case.title}")
        return
    cases_named(only)  # a name that is none is refused before anything is run
    refuse_places(options, [], results_kind="hard_cases")
    measured: list[Measured] = []
    interrupted = False
    try:
        with _shown() as told:

            def taken(one: Measured) -> None:
                measured.append(one)
                told(one)

            measured_cases(only, taken)
    except KeyboardInterrupt:
        interrupted = True
    if measured:
        wide_terminal().print(_table(measured))
        write_found(dataset_of(measured), "hard_cases", options)
    missed = [one.case.name for one in measured if not one.is_met]
    met = f"{len(measured) - len(missed)} of {counted(len(measured), 'bound')} met"
    worded = (
        f"{word.capitalize()}: {', '.join(found)}" for word in VERDICTS if (found := _of(measured, word))
    )
    say(". ".join([met, *worded]) + ".")
    if interrupted:
        say(f"Interrupted: {len(measured)} of {len(cases_named(only))} cases were measured.", err=True)
        raise typer.Exit(130)
    if _of(measured, "wrong"):
        raise typer.Exit(1)


def _of(measured: Sequence[Measured], verdict: str) -> list[str]:
    return [one.case.name for one in measured if one.verdict == verdict]


@contextmanager
def _shown() -> Iterator[Callable[[Measured], None]]:
    """Show the table as it grows on a terminal; elsewhere a line for each case."""
    found: list[Measured] = []
    if not sys.stderr.isatty():
        yield lambda one: say(f"  {one.case.name}: {_told(one)}", err=True)
        return
    console = wide_terminal()
    console.stderr = True
    with Live(_table(found), console=console, transient=True, refresh_per_second=4) as live:

        def grown(one: Measured) -> None:
            found.append(one)
            live.update(_table(found))

        yield grown


def _told(one: Measured) -> str:
    if one.failure:
        return f"did not run: {one.failure}"
    return f"{one.found.figure:.1e}" if one.found.figure else "0"


def _table(measured: Sequence[Measured]) -> Table:
    rows = table("Hard cases", "<case", "<what is hard", ">figure", ">bound", "<figure is", ">time", "<")
    for one in measured:
        rows.add_row(
            one.case.name,
            one.case.title,
            _told(one),
            f"{one.case.bound:.2g}",
            one.case.of,
            duration(one.seconds),
            "" if one.is_met else one.verdict.upper(),
        )
    return rows

"""The study `hard-cases`: runs hard cases, and prints each figure with its bound."""

from __future__ import annotations

import sys
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import typer
import xarray as xr
from rich.live import Live
from rich.table import Table

from vibroimpact.analysis.study import Study
from vibroimpact.fmus.messages import counted, duration
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.terminal import say, wide_terminal
from vibroimpact.orchestrator.hard_cases.measuring import (
    CASES,
    Measured,
    cases_named,
    dataset_of,
    measured_cases,
)
from vibroimpact.orchestrator.operations.hard_cases import HardCases

VERDICTS = ("wrong", "slow")
"""Verdicts on cases beyond their bound: the figure is an error, or a time."""


def _say_measured(one: Measured) -> None:
    say(f"  {one.case.name}: {_figure_text(one)}", err=True)


@dataclass(eq=False)
class MeasuredCases(Study[Measured]):
    """Hard cases with their measurements; a row is a case.

    Parameters
    ----------
    names : sequence of str
        Cases to run; without names all.
    """

    name = "hard-cases"
    nothing = "a case"
    mark = ""

    names: Sequence[str] = ()

    def __post_init__(self) -> None:
        self._many = len(cases_named(self.names))
        self._show: Callable[[Measured], None] = lambda one: None

    @classmethod
    def reads(cls, options: HardCases) -> Sequence[Path]:
        """Return no file."""
        return []

    @classmethod
    def prepare(cls, options: HardCases, stack: ExitStack) -> Self | None:
        """Choose the cases, or list them."""
        if not options.names:
            return cls(options.only or ())
        for case in CASES:
            say(f"{case.name}: {case.title}")
        return None

    @contextmanager
    def shown(self) -> Iterator[None]:
        """Show the growing table on a terminal; without one, print a line for each case."""
        self._show = _say_measured
        if not sys.stderr.isatty():
            yield
            return
        console = wide_terminal()
        console.stderr = True
        with Live(_table(self.found), console=console, transient=True, refresh_per_second=4) as live:
            self._show = lambda one: live.update(_table(self.found))
            yield

    def rows(self) -> Generator[Measured, None, None]:
        """Run case after case."""
        yield from measured_cases(self.names)

    def take(self, row: Measured) -> None:
        """Keep and show a case."""
        super().take(row)
        self._show(row)

    def made(self) -> xr.Dataset:
        """Return the dataset of the measurements."""
        return dataset_of(self.found)

    def print_results(self) -> None:
        """Print the table."""
        wide_terminal().print(_table(self.found))
        self.interruption = f"Interrupted: {len(self.found)} of {self._many} cases were measured."

    def conclude(self, options: HardCases) -> None:
        """Print the number of bounds that were met.

        typer.Exit: a figure is wrong, and no case was left out.
        """
        missed: Mapping[str, list[str]] = {word: self._of(word) for word in VERDICTS}
        met = sum(one.is_met for one in self.found)
        worded = [f"{word.capitalize()}: {', '.join(names)}" for word, names in missed.items() if names]
        say(". ".join([f"{met} of {counted(len(self.found), 'bound')} met", *worded]) + ".")
        if missed["wrong"] and not self.incomplete:
            raise typer.Exit(1)

    def _of(self, verdict: str) -> list[str]:
        return [one.case.name for one in self.found if one.verdict == verdict]


def _figure_text(one: Measured) -> str:
    if one.failure:
        return f"did not run: {one.failure}"
    return f"{one.found.figure:.1e}" if one.found.figure else "0"


def _table(measured: Sequence[Measured]) -> Table:
    rows = table("Hard cases", "<case", "<what is hard", ">figure", ">bound", "<figure is", ">time", "<")
    for one in measured:
        rows.add_row(
            one.case.name,
            one.case.title,
            _figure_text(one),
            f"{one.case.bound:.2g}",
            one.case.of,
            duration(one.seconds),
            "" if one.is_met else one.verdict.upper(),
        )
    return rows

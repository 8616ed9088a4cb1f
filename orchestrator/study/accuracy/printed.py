"""The printed table of a study of accuracy, and the scene file written with the chosen way."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from rich.live import Live
from rich.table import Table

from vibroimpact.analysis.files.atomic import write_atomically
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.messages import duration
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.terminal import say, wide_terminal
from vibroimpact.orchestrator.study.accuracy.choice import advice, error_of_reference
from vibroimpact.orchestrator.study.accuracy.measured import Comparison, Measured
from vibroimpact.orchestrator.study.accuracy.tuned import tuned_text

MEGABYTE = 1e6
WIDE = 120
"""Letters in a line of a terminal, from which on the table has all columns; the dataset always has them."""


@contextmanager
def shown(title: str, quantity: str) -> Iterator[Callable[[Measured], None]]:
    """Show each way as soon as it has run once: as a growing table in a terminal, else as a line."""
    if not sys.stdout.isatty():
        yield _say_tried
        return
    found: list[Measured] = []
    console = wide_terminal()
    with Live(console=console, transient=True) as live:

        def take(one: Measured) -> None:
            found.append(one)
            live.update(table_of(title, found, quantity, 0.0, console.width))

        yield take


def _say_tried(one: Measured) -> None:
    said = one.errors.failure or f"error {one.error('all'):.1e}"
    say(f"  {one.way.label}: {said}{_part_in_words(one.part)}")


def table_of(
    title: str,
    measured: Sequence[Measured],
    quantity: str,
    known: float,
    width: int,
    periods: float = math.nan,
) -> Table:
    """Return the measurements as a table.

    `known` is the error of the reference. `width` is the width of the terminal: a narrow terminal gets fewer columns,
    so that the names of the ways stay whole. `periods` is the number of forcing periods of a run; NaN without forcing.
    """
    scored = any(one.variance == one.variance for one in measured)
    wide, of_periods = width >= WIDE, periods == periods
    of_runs = wide or not of_periods
    rows = table(
        f"What accuracy costs: {title}",
        *("<way", "<set", ">value", ">error"),
        *((">a run",) if of_runs else ()),
        *((">a period",) if of_periods else ()),
        ">spread",
        *((">an impact", ">calls", ">memory") if wide else ()),
        *((">accounts for",) if scored else ()),
        "<remark",
    )
    for one in measured:
        spread = (max(one.seconds) - min(one.seconds)) / one.each if len(one.seconds) > 1 else math.nan
        about = "~" if one.is_extrapolated else ""
        each = (
            _known_duration(one.cost_of_impact),
            str(one.calls) if one.calls >= 0 else "-",
            f"{one.memory / MEGABYTE:.1f} MB" if one.memory >= 0 else "-",
        )
        rows.add_row(
            f"{one.way.name}{' (another model)' if one.way.model else ''}",
            one.way.knob or "-",
            f"{one.way.setting:.3g}" if one.way.knob else "-",
            one.error_in_words(quantity, known),
            *((about + _known_duration(one.cost),) if of_runs else ()),
            *((about + _known_duration(one.cost_of_one(periods)),) if of_periods else ()),
            "-" if math.isnan(spread) else f"{100.0 * spread:.0f} %",
            *(each if wide else ()),
            *((f"{one.variance:.2f} %",) if scored else ()),
            f"{one.errors.failure or one.errors.remark}{_part_in_words(one.part)}".removeprefix(", "),
        )
    return rows


def _part_in_words(part: float) -> str:
    """Return the simulated part of the time, a power of two, in words after a comma; empty for all of it."""
    return "" if part == 1.0 else f", first 1/{1.0 / part:.0f} only"


def _known_duration(seconds: float) -> str:
    return "-" if math.isnan(seconds) else duration(seconds)


def print_comparison(compared: Comparison) -> None:
    """Print the ways, the parts left out, and the advice."""
    known = error_of_reference(compared.reference, compared.quantity)
    console, title = wide_terminal(), compared.scene.title or compared.scene.source
    console.print(
        table_of(title, compared.measured, compared.quantity, known, console.width, compared.periods)
    )
    motion = f"Motion: {compared.orbit}. " if compared.orbit else ""
    say(f"{motion}Reference: {compared.reference.name}, known to {known:.0e}.")
    if compared.modes_reference:
        say(f"Other numbers of modes are compared with {compared.modes_reference}.")
    for remark in compared.remarks:
        say(f"Left out: {remark}.")
    if any(one.is_extrapolated for one in compared.measured):
        say("~: cost extrapolated from the first part of the time; the error is that of this part.")
    say(compared.effort.in_words())
    say(advice(compared))


def write_tuned(text: str, compared: Comparison, target: Path) -> None:
    """Write a scene with the settings of the chosen way; UsageError where a scene cannot ask for that way."""
    chosen = compared.chosen
    assert chosen is not None  # `refuse_unreached` comes first
    known = error_of_reference(compared.reference, compared.quantity)
    settings = {key.partition(".")[2]: value for key, value in chosen.way.changes.items()}
    if not settings:
        raise UsageError(
            f"--write: expected a way that a scene can ask for, got {chosen.way.label}. "
            "It is the cheapest all the same."
        )
    error = chosen.error_in_words(compared.quantity, known)
    reason = (
        f"{chosen.way.label}: {compared.quantity.replace('_', ' ')} to {error} "
        f"(asked: {compared.tolerance:g}), {duration(chosen.cost)} a run; vibroimpact accuracy"
    )
    write_atomically(target, tuned_text(text, settings, reason).encode("utf-8"))
    say(f"Scene written to {target}.")

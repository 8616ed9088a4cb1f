"""What `vibroimpact accuracy` does: it shows what accuracy costs in time, for a person's own scene."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from rich.live import Live
from rich.table import Table

from vibroimpact.analysis.commands.found import refuse_places, write_found
from vibroimpact.analysis.dataset.outputs import refuse_outputs
from vibroimpact.analysis.files.atomic import write_atomically
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.terminal import say, wide_terminal
from vibroimpact.orchestrator.commands.check import duration
from vibroimpact.orchestrator.commands.preparing import with_modes
from vibroimpact.orchestrator.operations.accuracy import Accuracy
from vibroimpact.orchestrator.ssp import opened_scene
from vibroimpact.orchestrator.study.accuracy import Measured, Study, dataset_of, study_accuracy
from vibroimpact.orchestrator.study.accuracy.choice import advice, error_of_reference, refuse_unreached
from vibroimpact.orchestrator.study.accuracy.refusals import refuse_misuse
from vibroimpact.orchestrator.study.accuracy.tuned import tuned_text

MEGABYTE = 1e6
WIDE = 120
"""Letters in a line of a terminal from which on the table has all columns; the dataset has them in any case."""


def study_scene(options: Accuracy) -> None:
    """Study a scene, print a table and what to choose, and write what was asked for.

    Raises
    ------
    UsageError
        Before anything runs, where the arguments alone show it.
    """
    tolerance, quantity, path, write = options.tolerance, options.of, options.scene, options.write
    refuse_misuse(tolerance, quantity, options.budget)
    if write is not None and tolerance is None:
        raise UsageError("--write: expected a tolerance to tune for, got none. Add --tolerance 1e-6.")
    opened = opened_scene(path, options.changes or ())
    if write is not None:
        refuse_outputs([path], write, ending=".toml")
    refuse_places(options, [path, *opened.files], results_kind="accuracy", scene_file=str(path))
    scene = with_modes(opened)
    with _shown(scene.title or scene.source, quantity) as told:
        study = study_accuracy(
            scene, tolerance=tolerance, quantity=quantity, budget=options.budget, told=told
        )
    _print(study)
    write_found(dataset_of(study).assign_attrs(scene_file=str(path)), "accuracy", options)
    refuse_unreached(study)
    if write is not None:
        _write_tuned(scene.text, study, write)


@contextmanager
def _shown(title: str, quantity: str) -> Iterator[Callable[[Measured], None]]:
    """Show each way as soon as it has run once: in a terminal a table that grows, else a line."""
    if not sys.stdout.isatty():
        yield _say_tried
        return
    found: list[Measured] = []
    console = wide_terminal()
    with Live(console=console, transient=True) as live:

        def told(one: Measured) -> None:
            found.append(one)
            live.update(table_of(title, found, quantity, 0.0, console.width))

        yield told


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
    """Return what was measured as a table.

    Parameters
    ----------
    known : float
        Error of the reference.
    width : int
        Of the terminal: a narrow one gets fewer columns, lest it cuts the names of the ways.
    periods : float
        Forcing periods of a run; NaN where nothing forces it.
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
            one.told(quantity, known),
            *((about + _known_duration(one.cost),) if of_runs else ()),
            *((about + _known_duration(one.cost_of_one(periods)),) if of_periods else ()),
            "-" if math.isnan(spread) else f"{100.0 * spread:.0f} %",
            *(each if wide else ()),
            *((f"{one.variance:.2f} %",) if scored else ()),
            f"{one.errors.failure}{_part_in_words(one.part)}".removeprefix(", "),
        )
    return rows


def _part_in_words(part: float) -> str:
    """Return which part of the time was simulated, a power of two, after a comma; empty for all of it."""
    return "" if part == 1.0 else f", first 1/{1.0 / part:.0f} only"


def _known_duration(seconds: float) -> str:
    return "-" if math.isnan(seconds) else duration(seconds)


def _print(study: Study) -> None:
    known = error_of_reference(study.reference, study.quantity)
    console, title = wide_terminal(), study.scene.title or study.scene.source
    console.print(table_of(title, study.measured, study.quantity, known, console.width, study.periods))
    motion = f"Motion: {study.orbit}. " if study.orbit else ""
    say(f"{motion}Reference: {study.reference.name}, known to {known:.0e}.")
    if study.modes_reference:
        say(f"Other numbers of modes are compared with {study.modes_reference}.")
    for remark in study.remarks:
        say(f"Left out: {remark}.")
    if any(one.is_extrapolated for one in study.measured):
        say("~: cost extrapolated from the first part of the time; the error is that of this part.")
    say(study.effort.in_words())
    say(advice(study))


def _write_tuned(text: str, study: Study, target: Path) -> None:
    chosen = study.chosen
    assert chosen is not None  # else refused
    known = error_of_reference(study.reference, study.quantity)
    settings = {key.partition(".")[2]: value for key, value in chosen.way.changes.items()}
    if not settings:
        raise UsageError(
            f"--write: expected a way that a scene can ask for, got {chosen.way.label}. "
            "It is the cheapest all the same."
        )
    reason = (
        f"{chosen.way.label}: {study.quantity.replace('_', ' ')} to {chosen.told(study.quantity, known)} "
        f"(asked: {study.tolerance:g}), {duration(chosen.cost)} a run; vibroimpact accuracy"
    )
    write_atomically(target, tuned_text(text, settings, reason).encode("utf-8"))
    say(f"Scene written to {target}.")

"""What `vibroimpact basins` does: it finds where starts end, prints the shares, writes and draws them."""

from __future__ import annotations

import numpy as np
import typer
import xarray as xr

from vibroimpact.analysis.commands.found import write_found
from vibroimpact.analysis.dataset.outputs import refuse_outputs, refuse_overwriting
from vibroimpact.analysis.orbits.basins import Basins as Found
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.terminal import Terminal, say, wide_terminal
from vibroimpact.orchestrator.operations.basins import Basins
from vibroimpact.orchestrator.orbits.basins import (
    HISTORY,
    Plane,
    Span,
    basins_dataset,
    prepare_basins,
    run_basins,
)
from vibroimpact.orchestrator.ssp import opened_scene


def span_of(text: str | None, name: str) -> Span | None:
    """Return `LOW:HIGH` as two numbers.

    Raises
    ------
    UsageError

    Examples
    --------
    >>> span_of("-1:0.5", "x")
    (-1.0, 0.5)
    """
    if text is None:
        return None
    parts = text.split(":")
    try:
        low, high = map(float, parts)
    except ValueError:
        raise UsageError(f"--{name}: expected LOW:HIGH, two numbers, got {text!r}.") from None
    return low, high


def points_of(text: str) -> tuple[int, int]:
    """Return `N` or `NxM` as the starts along both axes.

    Raises
    ------
    UsageError

    Examples
    --------
    >>> points_of("200"), points_of("300x200")
    ((200, 200), (300, 200))
    """
    parts = text.lower().split("x")
    if len(parts) > 2 or not all(part.isascii() and part.isdigit() for part in parts):
        raise UsageError(f"--points: expected a number of starts, or two as 300x200, got {text!r}.")
    return int(parts[0]), int(parts[-1])


def show_basins(options: Basins) -> None:
    """Find where the starts of a plane end; print, write and draw it.

    Raises
    ------
    VibroimpactError
        The scene has no basins to be looked for.
    typer.Exit
        Ctrl-C came, and what is known is printed and written.
    """
    plane = Plane(span_of(options.x, "x"), span_of(options.y, "y"), points_of(options.points), options.number)
    refuse_outputs([options.scene], options.output, options.figure)
    scene = opened_scene(options.scene, options.changes or ())
    refuse_overwriting(options.output, options.force, lambda there: there.get("history") == HISTORY)
    alone, x, y, found = prepare_basins(scene, plane)
    interrupted = False
    with Terminal(stderr=True).status("Looking for attractors") as status:

        def told(now: Found) -> None:
            names = ", ".join(now.names) or "none yet"
            status.update(f"{100.0 * now.decided:.1f} % of {now.possible} starts; {names}")

        try:
            run_basins(alone, found, told)
        except KeyboardInterrupt:
            interrupted = True
    data = basins_dataset(alone, plane, x, y, found)
    rows = table(
        f"Basins of attraction: {alone.title or alone.source}",
        *("<attractor", ">share of the starts", "<displacement, velocity at forcing phase 0"),
    )
    for place, name in enumerate(found.names):
        states = np.column_stack(
            [data[f"attractor_{what}"].values[place] for what in ("displacement", "velocity")]
        )
        told_states = "; ".join(f"{a:.6g}, {b:.6g}" for a, b in states[:4] if np.isfinite(a))
        rows.add_row(
            name, f"{100.0 * found.fractions[place]:.2f} %", told_states + (" ..." if len(states) > 4 else "")
        )
    wide_terminal().print(rows)
    _say_rest(found, data)
    write_found(data.assign_attrs(scene_file=str(options.scene)), "basins", options)
    if interrupted:
        say("Interrupted: the above is what is known so far.", err=True)
        raise typer.Exit(130)


def _say_rest(found: Found, data: xr.Dataset) -> None:
    undecided = 1.0 - found.decided
    if undecided > 0.0:
        say(f"{100.0 * undecided:.3g} % of the starts came near to no attractor that is known.")
    if found.told_by_sample:
        say(
            f"{found.told_by_sample} starts count as chaotic because all of a sample of those like them were. Such a "
            f"sample may miss an attractor with up to {100.0 * found.undetected_share_below:.2g} % of the starts "
            "(95 % confidence)."
        )
    _say_chaotic(found)
    share, dimension = float(data["border_fraction"]), float(data["border_dimension"])
    if np.isfinite(dimension):
        error = float(data["border_dimension_error"])
        say(f"{100.0 * share:.3g} % lie on a border, whose dimension is {dimension:.3f} +- {error:.3f}.")
    elif share > 0.0:
        say(f"{100.0 * share:.3g} % lie on a border.")


def _say_chaotic(found: Found) -> None:
    """Print what tells chaotic attractors apart, or that they are not told apart."""
    chaotic = [
        (name, each) for name, each in zip(found.names, found.attractors, strict=True) if each.is_chaotic
    ]
    for name, each in chaotic:
        if not each.is_one:
            say(
                "Chaotic runs differ by more than their own scatter: there may be several chaotic attractors."
            )
        elif len(chaotic) > 1:
            rates = ", ".join(f"{rate:.3g} at stop {stop}" for stop, rate in enumerate(each.impacts, start=1))
            say(f"{name}: impacts in a forcing period: {rates}.")

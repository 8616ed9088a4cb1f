"""What `vibroimpact follow` does: it follows orbits over a parameter, and prints where they change."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import typer

from vibroimpact.analysis.dataset import open_dataset, write_dataset
from vibroimpact.analysis.dataset.outputs import refuse_outputs, refuse_overwriting, writing
from vibroimpact.analysis.orbits import OrbitError
from vibroimpact.analysis.orbits.following import STABILITY_CHANGE, Branch, BranchOrbit, FollowSettings
from vibroimpact.fmus.errors import UsageError, VibroimpactError
from vibroimpact.fmus.messages import typed
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.terminal import Terminal, say, wide_terminal
from vibroimpact.orchestrator.commands.beginning import Begun, begun, files_of, refuse_contradictions
from vibroimpact.orchestrator.commands.failures import counted
from vibroimpact.orchestrator.commands.orbit import multiplier_text
from vibroimpact.orchestrator.operations.follow import Follow
from vibroimpact.orchestrator.orbits.follow import (
    HISTORY,
    Followed,
    FollowedLoci,
    follow_branches,
    follow_loci,
    orbits_not_followed,
)
from vibroimpact.orchestrator.ssp import opened_scene

EXACT_DIGITS, UNEXPLAINED_DIGITS = 11, 6
"""Digits of the value of a special point: of one that is a zero of a test, and of one that only a bracket holds."""


def _second_range(options: Follow) -> tuple[float, float] | None:
    """Return the range of the second number.

    Raises
    ------
    UsageError
        It is half given, or empty.
    """
    low, high = options.second_start, options.second_stop
    given = (options.second is not None, low is not None, high is not None)
    if any(given) and not all(given):
        raise UsageError(
            "--second: expected --second, --second-from and --second-to together, got some of them."
        )
    if low is None or high is None:
        return None
    if low == high:
        raise UsageError("--second-from, --second-to: expected two different numbers, got the same.")
    return min(low, high), max(low, high)


def show_branches(options: Follow) -> None:
    """Follow branches, print their special points, and write what was asked for.

    Raises
    ------
    VibroimpactError
        There is nothing to follow; or it went wrong on the way, and what was followed before is printed and written.
    typer.Exit
        Ctrl-C came; likewise.
    """
    refuse_contradictions(options)
    second_range = _second_range(options)
    changes, output, figure = options.changes or (), options.output, options.figure
    refuse_outputs([options.scene, *files_of(options)], output, figure)
    first = begun(
        options, opened_scene(options.scene, changes, for_orbits=True), changes, [options.parameter]
    )
    refuse_overwriting(output, options.force, lambda there: there.get("history") == HISTORY)
    followed = Followed(first.scene, options.parameter)
    loci = FollowedLoci(followed, options.second or "")
    interrupted, failure = False, None
    with Terminal(stderr=True).status("Looking for orbits") as status:
        try:
            _follow(options, first, second_range, loci, status.update)
        except KeyboardInterrupt:
            interrupted = True
        except VibroimpactError as problem:
            if not followed.branches:
                raise
            failure = problem
    if not followed.branches:
        raise OrbitError("follow: interrupted before there was an orbit.")
    _print(followed)
    if first.seed is None and first.impacts is None and not (interrupted or failure):
        for line in orbits_not_followed(followed, options.start, options.stop):
            say(typed(line))
    _print_loci(loci)
    _write(loci if loci.loci else followed, output, figure)
    if loci.loci and output is not None:
        say(f"{output} has the curves over both numbers; branches are written without --second.")
    elif options.second is not None and not loci.loci and output is not None:
        say(f"No curves over {options.second} were found: {output} has the branches.")
    if failure is not None:
        raise failure
    if interrupted:
        say("Interrupted: the above is what was followed.", err=True)
        raise typer.Exit(130)


def _follow(
    options: Follow,
    first: Begun,
    second_range: tuple[float, float] | None,
    loci: FollowedLoci,
    show: Callable[[str], None],
) -> None:
    def told(branch: Branch, orbit: BranchOrbit) -> None:
        if len(branch.orbits) % 20 == 1:
            many = counted(len(branch.orbits), "orbit")
            show(f"{branch.name}: {many}, {options.parameter} {orbit.value:.6g}")

    follow_branches(
        first.scene,
        options.parameter,
        options.start,
        options.stop,
        impacts=first.impacts,
        periods=1 if first.periods is None else first.periods,
        seed=first.seed,
        doublings=options.doublings,
        longest=options.step,
        told=told,
        looking=lambda value: show(f"Looking for orbits, {options.parameter} {value:.6g}"),
        followed=loci.followed,
    )
    if second_range is None:
        return
    ranges = [
        FollowSettings(min(ends), max(ends), options.step)
        for ends in ((options.start, options.stop), second_range)
    ]
    follow_loci(
        loci, *ranges, told=lambda locus: show(f"{locus.kind}: {counted(len(locus.points), 'orbit')}")
    )


def _print(followed: Followed) -> None:
    rows = table(
        f"Orbits over {followed.parameter}: {followed.scene.title or followed.scene.source}",
        *("<orbit", "<what happens", f">{followed.parameter}", "<impact velocities", "<largest multipliers"),
    )
    for number, branch in enumerate(followed.branches, start=1):
        name = f"{number}  {branch.full_name}"
        for point in branch.points:
            orbit = point.at.orbit
            largest = (
                ""
                if point.kind == "graze"
                else ", ".join(multiplier_text(each) for each in orbit.multipliers[:2])
            )
            speeds = ", ".join(f"{speed:.8g}" if speed > 1e-12 else "0" for speed in orbit.velocities)
            digits = UNEXPLAINED_DIGITS if point.kind == STABILITY_CHANGE else EXACT_DIGITS
            rows.add_row(name, point.kind, f"{point.at.value:.{digits}g}", speeds, largest)
        if not branch.points:
            rows.add_row(name, "nothing", "", "", "")
    wide_terminal().print(rows)
    for number, branch in enumerate(followed.branches, start=1):
        stable = sum(each.orbit.is_stable for each in branch.orbits)
        low, high = float(branch.values.min()), float(branch.values.max())
        say(
            f"{number}  {branch.full_name}: {counted(len(branch.orbits), 'orbit')} from {low:.8g} to {high:.8g}, "
            f"{stable} stable; begun from {branch.origin}; ends: {', '.join(branch.ends) or 'interrupted'}."
        )
    _say_unexplained(followed)


def _say_unexplained(followed: Followed) -> None:
    for number, branch in enumerate(followed.branches, start=1):
        points = [point for point in branch.points if point.kind == STABILITY_CHANGE]
        values = [f"{point.at.value:.{UNEXPLAINED_DIGITS}g}" for point in points]
        if values:
            say(
                f"{number}  {branch.full_name}: stability changes at {', '.join(values)}, and no cause was found. "
                "Another branch may cross there (a branch point): it is not followed."
            )


def _print_loci(loci: FollowedLoci) -> None:
    first, second = loci.followed.parameter, loci.second
    for name, locus in zip(loci.names, loci.loci, strict=True):
        rows = np.array([each.values for each in locus.points])
        low, high = rows.min(axis=0), rows.max(axis=0)
        say(
            f"{name}: {counted(len(rows), 'orbit')}, "
            f"{first} from {low[0]:.8g} to {high[0]:.8g}, {second} from {low[1]:.8g} to {high[1]:.8g}; "
            f"ends: {', '.join(locus.ends)}."
        )
        for kind, point in locus.special:
            say(f"   codimension 2, {locus.kind} and {kind}: {point.values[0]:.11g}, {point.values[1]:.11g}")
    if loci.second:
        say(loci.left_out)


def _write(followed: Followed | FollowedLoci, output: Path | None, figure: Path | None) -> None:
    if output is None and figure is None:
        return
    with TemporaryDirectory() as folder:
        target = output or Path(folder, "branches.nc")
        write_dataset(followed.dataset, target)
        if output is not None:
            say(f"Dataset written to {output}.")
        if figure is not None:
            from vibroimpact.analysis import figures  # half a second, which a table needs not

            with open_dataset(target) as dataset, writing(figure):
                figures.save(figures.draw(dataset), figure)
            say(f"Figure written to {figure}.")

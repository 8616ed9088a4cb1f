"""What `vibroimpact follow` does: it follows orbits over a parameter, and prints where they change."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import typer

from vibroimpact.analysis.dataset import open_dataset, write_dataset
from vibroimpact.analysis.dataset.outputs import refuse_outputs, refuse_overwriting, writing
from vibroimpact.analysis.orbits import OrbitError
from vibroimpact.analysis.orbits.following import Branch, BranchOrbit
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.terminal import Terminal, say, wide_terminal
from vibroimpact.orchestrator.commands.failures import counted
from vibroimpact.orchestrator.commands.orbit import multiplier_text
from vibroimpact.orchestrator.orbits.follow import Followed, follow_branches
from vibroimpact.orchestrator.ssp import opened_scene

HISTORY = "periodic orbits followed by vibroimpact"


def show_branches(
    path: Path,
    parameter: str,
    span: tuple[float, float],
    options: tuple[int, int, float],
    changes: Sequence[str],
    output: Path | None,
    figure: Path | None,
    force: bool,
) -> None:
    """Follow branches, print their special points, and write what was asked for.

    Raises
    ------
    typer.Exit
        Ctrl-C came; what was followed before is printed and written.
    """
    refuse_outputs([path], output, figure)
    scene = opened_scene(path, changes)
    refuse_overwriting(output, force, lambda there: there.get("history") == HISTORY)
    alone = scene.with_sweep({}) if scene.sweep else scene
    followed = Followed(alone, parameter)
    interrupted = False
    with Terminal(stderr=True).status("Looking for orbits") as status:

        def told(branch: Branch, orbit: BranchOrbit) -> None:
            if len(branch.orbits) % 20 == 1:
                status.update(
                    f"{branch.name}: {counted(len(branch.orbits), 'orbit')}, {parameter} {orbit.value:.6g}"
                )

        periods, doublings, longest = options
        try:
            follow_branches(
                alone,
                parameter,
                *span,
                periods=periods,
                doublings=doublings,
                longest=longest,
                told=told,
                followed=followed,
            )
        except KeyboardInterrupt:
            interrupted = True
    if not followed.branches:
        raise OrbitError("follow: interrupted before there was an orbit.")
    _print(followed)
    _write(followed, output, figure)
    if interrupted:
        say("Interrupted: the branches above are what was followed.", err=True)
        raise typer.Exit(130)


def _print(followed: Followed) -> None:
    rows = table(
        f"Orbits over {followed.parameter}: {followed.scene.title or followed.scene.source}",
        *("<orbit", "<what happens", f">{followed.parameter}", "<impact velocities", "<largest multipliers"),
    )
    for number, branch in enumerate(followed.branches, start=1):
        name = f"{number}  {branch.name}"
        for point in branch.points:
            orbit = point.at.orbit
            largest = (
                ""
                if point.kind == "graze"
                else ", ".join(multiplier_text(each) for each in orbit.multipliers[:2])
            )
            speeds = ", ".join(f"{speed:.8g}" if speed > 1e-12 else "0" for speed in orbit.velocities)
            rows.add_row(name, point.kind, f"{point.at.value:.11g}", speeds, largest)
        if not branch.points:
            rows.add_row(name, "nothing", "", "", "")
    wide_terminal().print(rows)
    for number, branch in enumerate(followed.branches, start=1):
        stable = sum(each.orbit.is_stable for each in branch.orbits)
        low, high = float(branch.values.min()), float(branch.values.max())
        say(
            f"{number}  {branch.name}: {counted(len(branch.orbits), 'orbit')} from {low:.8g} to {high:.8g}, "
            f"{stable} stable; begun from {branch.origin}; ends: {', '.join(branch.ends) or 'interrupted'}."
        )


def _write(followed: Followed, output: Path | None, figure: Path | None) -> None:
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

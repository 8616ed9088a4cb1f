"""What `vibroimpact control` does: it keeps an orbit over a range of frequencies, and says how far and by how much."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import typer

from vibroimpact.analysis.commands.found import write_found
from vibroimpact.analysis.dataset.outputs import refuse_folder, refuse_outputs, refuse_overwriting
from vibroimpact.fmus.errors import ComponentError, UsageError
from vibroimpact.fmus.packaging.python_fmus import require_pythonfmu
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.terminal import Terminal, say, wide_terminal
from vibroimpact.orchestrator.commands.failures import counted
from vibroimpact.orchestrator.operations.control import Control
from vibroimpact.orchestrator.orbits.control import HISTORY, Controlled, run_plan
from vibroimpact.orchestrator.orbits.control_parts import coupled_scene
from vibroimpact.orchestrator.orbits.control_plan import (
    ControlPlan,
    ControlSettings,
    control_plan,
    settings_of,
)
from vibroimpact.orchestrator.ssp import opened_scene

_SHOWN = 8
"""Frequencies that are told."""


def show_control(options: Control) -> None:
    """Keep an orbit; print, write and draw how far that went.

    Raises
    ------
    VibroimpactError
        There is no orbit to keep; or a component failed on the way, and what came before is printed and written.
    typer.Exit
        Ctrl-C came; likewise.
    """
    settings, keep = _settings(options), options.keep
    require_pythonfmu()
    refuse_outputs([options.scene], options.output, options.figure)
    if keep is not None:
        refuse_folder(keep)
        if keep.exists():
            raise UsageError(f"{keep}: expected a new folder, got one that is there.")
    scene = opened_scene(options.scene, options.changes or ())
    refuse_overwriting(options.output, options.force, lambda there: there.get("history") == HISTORY)
    interrupted, failure = False, None
    with Terminal(stderr=True).status("Looking for the orbits") as status:
        plan = control_plan(scene, options.start, options.stop, settings)
        if keep is not None:
            _keep(plan, keep)
        found = Controlled(plan)

        def told(frequency: float, impacts: int) -> None:
            status.update(f"Angular frequency {frequency:.6g}, {counted(impacts, 'impact')}")

        try:
            run_plan(plan, told, into=found)
        except KeyboardInterrupt:
            interrupted = True
        except ComponentError as problem:
            failure = problem
    if found.impacts:
        _print(found)
        write_found(found.dataset.assign_attrs(scene_file=str(options.scene)), "control", options)
    if failure is not None:
        raise failure
    if interrupted:
        say("Interrupted: the above is what was kept so far.", err=True)
        raise typer.Exit(130)


def _settings(options: Control) -> ControlSettings:
    return settings_of(
        law=options.law,
        step=options.step,
        tolerance=options.tolerance,
        limit=options.limit,
        noise=options.noise,
        seed=options.seed,
        periods=options.periods,
        stay=options.stay,
    )


def _keep(plan: ControlPlan, folder: Path) -> None:
    folder.mkdir(parents=True)
    controller = plan.controller(folder / "controller.fmu")
    (folder / "scene.toml").write_text(coupled_scene(plan, controller.name), encoding="utf-8")
    say(f"Controller and scene written to {folder}.")


def _print(found: Controlled) -> None:
    plan, data = found.plan, found.dataset
    rows = table(
        f"P(1,{plan.settings.periods}) kept by {plan.settings.law}: {plan.scene.title or plan.scene.source}",
        *(">angular frequency", ">impact velocity", ">largest multiplier", ">impacts", ">largest correction"),
    )
    at, correction = data["impact_orbit"].values, np.abs(data["correction"].values)
    for place in np.unique(np.linspace(0, int(at.max()), _SHOWN).round().astype(int)):
        orbit, own = plan.orbits[place], at == place
        rows.add_row(
            f"{orbit.body.angular_frequency:.8g}",
            f"{float(orbit.velocities[0]):.8g}",
            f"{abs(orbit.multipliers[0]):.5g}",
            f"{int(own.sum())}",
            f"{100.0 * float(correction[own].max()):.2g} %" if own.any() else "",
        )
    wide_terminal().print(rows)
    unstable = int((data["orbit_multiplier"].values[: int(at.max()) + 1] >= 1.0).sum())
    say(
        f"{counted(len(found.impacts), 'impact')}, {counted(int(at.max()) + 1, 'orbit')}, {unstable} of them unstable; "
        f"largest correction {100.0 * float(correction.max()):.3g} %."
    )
    kept = "nowhere" if found.kept_to is None else f"to {found.kept_to:.8g}"
    say(f"Kept {kept}: {found.end}.")
    if plan.ends_at is not None:
        away = "" if found.kept_to is None else f", {abs(found.kept_to - plan.ends_at):.2g} away"
        say(f"There is no such orbit beyond {plan.ends_at:.10g}{away}.")

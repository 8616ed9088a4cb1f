"""The command `vibroimpact rig sweep`."""

from __future__ import annotations

from pathlib import Path

import typer

from vibroimpact.analysis import figures
from vibroimpact.analysis.dataset.outputs import refuse_folder, writing
from vibroimpact.analysis.files.folder_lock import make_folder
from vibroimpact.fmus.terminal import say
from vibroimpact.hardware.operations.rig_sweep import MeasureSweep
from vibroimpact.hardware.programs.sweep.calibrating import calibrations_of
from vibroimpact.hardware.programs.sweep.drawing import draw_plan
from vibroimpact.hardware.programs.sweep.plan import planned
from vibroimpact.hardware.programs.sweep.program import measure
from vibroimpact.hardware.programs.sweep.settings import SweepSettings, read_sweep
from vibroimpact.orchestrator.run.progress import clock, shown_progress

PLAN = "plan.png"


def sweep_rig(options: MeasureSweep) -> None:
    """Measure the sweep of a file into a folder, or only draw its planned output."""
    refuse_folder(options.output)
    settings = read_sweep(options.file)
    if options.dry_run:
        _draw_only(settings, options.output)
        return
    with shown_progress() as progress:
        report = measure(settings, options.output, options.rig, progress)
    if report.before == report.planned:
        say(f"Nothing to do: all {report.planned} steps are in {report.dataset} already.")
        return
    kept = f", {report.before} were there" if report.before else ""
    where = f": {report.dataset}" if report.steps else ""
    say(f"{report.steps - report.before} of {report.planned} steps measured{kept}{where}")
    if report.stopped:
        say("Stopped; the output is at 0 V. The same command goes on.", err=True)
        raise typer.Exit(130)


def _draw_only(settings: SweepSettings, folder: Path) -> None:
    calibrations_of(settings)
    plan = planned(settings)
    make_folder(folder)
    with writing(folder / PLAN):
        figures.save(draw_plan(plan, settings), folder / PLAN)
    say(
        f"{len(settings.steps)} steps of {settings.step_periods} periods, {settings.output.amplitude:g} V on "
        f"{settings.output.terminal}: {clock(plan.duration)} of the rig's time. Nothing was driven: {folder / PLAN}"
    )

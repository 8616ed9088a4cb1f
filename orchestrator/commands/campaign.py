"""The command `vibroimpact campaign`."""

from __future__ import annotations

import os
from pathlib import Path

import typer

from vibroimpact.analysis.dataset.outputs import refuse_folder
from vibroimpact.fmus.errors import SceneError
from vibroimpact.fmus.messages import counted, typed
from vibroimpact.fmus.terminal import say
from vibroimpact.orchestrator.campaign import CampaignInterrupted, CampaignReport, run_campaign
from vibroimpact.orchestrator.campaign.formats import DatasetFormat
from vibroimpact.orchestrator.campaign.manifest import keeps_scene, kept_scene
from vibroimpact.orchestrator.campaign.workers.processors import refuse_two_kinds_of_workers
from vibroimpact.orchestrator.commands.failures import outcome_lines
from vibroimpact.orchestrator.operations.campaign import Campaign
from vibroimpact.orchestrator.run.progress import shown_progress
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.ssp import opened_scene, refuse_system_elsewhere
from vibroimpact.orchestrator.study.preparing import prepared

NO_FILE = "expected a file that can be read"
"""Text of the problem of a body whose file is not there."""


def run_to_folder(options: Campaign) -> None:
    """Run a scene's sweep into the folder of a campaign and print a summary."""
    refuse_two_kinds_of_workers(options.workers, options.scheduler)
    refuse_system_elsewhere(options.scene, options.scheduler)
    loaded = _scene_of(options)
    refuse_folder(options.output)
    compute(prepared(loaded), options.output, options.workers, options.scheduler, options.format)


def _scene_of(options: Campaign) -> Scene:
    """Return the scene of a file, or the one that the folder of a campaign keeps, whose bodies need no files."""
    changes = options.changes or ()
    if os.path.isdir(options.scene):  # no error for a name that is too long
        return kept_scene(options.scene, changes)
    try:
        return opened_scene(options.scene, changes, strict=options.strict)
    except SceneError as error:
        if not any(NO_FILE in str(problem) for problem in error.problems) or not keeps_scene(options.output):
            raise
        again = f"vibroimpact campaign {options.output} -o {options.output}"
        hint = f"`{again}` goes on without it, with the modes that the campaign keeps."
        raise SceneError([f"{problem} {hint}" for problem in error.problems]) from None


def compute(
    scene: Scene,
    folder: Path,
    workers: int | None,
    scheduler: str | None,
    format: DatasetFormat | None = None,
) -> None:
    """Run a campaign and print a summary."""
    report = computed(scene, folder, workers=workers, scheduler=scheduler, format=format)
    if report.resumed == report.runs and not report.chunks and not report.compaction_seconds:
        say(f"Nothing to do: all {report.runs} points are in {report.dataset} already.")
        return
    kept = f", {report.resumed} were there" if report.resumed else ""
    by = f"by {counted(report.workers, 'worker')}" if report.workers else "in this process"
    say(
        f"{counted(report.runs - report.resumed, 'point')} computed in {report.compute_seconds:.1f} s "
        f"{by}{kept}: {report.dataset}"
    )
    if report.lost_workers:
        lost = "was lost; what it" if report.lost_workers == 1 else "were lost; what they"
        say(f"{counted(report.lost_workers, 'worker')} {lost} had not finished was computed again.", err=True)
    for line in () if report.is_silent else outcome_lines(report.dataset, report.runs):
        say(line, err=True)


def computed(
    scene: Scene,
    folder: Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    format: DatasetFormat | None = None,
) -> CampaignReport:
    """Run a campaign; an interrupted one prints how to resume it and raises typer.Exit."""
    try:
        with shown_progress() as progress:
            return run_campaign(
                scene, folder, workers=workers, scheduler=scheduler, progress=progress, format=format
            )
    except CampaignInterrupted as interrupted:
        say(typed(interrupted.args[0]), err=True)
        raise typer.Exit(130) from None

"""The command `vibroimpact run`."""

from __future__ import annotations

import time

import typer

from vibroimpact.analysis.dataset.outputs import refuse_outputs, refuse_overwriting
from vibroimpact.fmus.messages import counted
from vibroimpact.fmus.terminal import say
from vibroimpact.orchestrator.campaign.manifest import holds_scene
from vibroimpact.orchestrator.commands.failures import FAILED, outcome_lines
from vibroimpact.orchestrator.operations.run import Run
from vibroimpact.orchestrator.run.dataset import has_messages
from vibroimpact.orchestrator.run.progress import shown_progress
from vibroimpact.orchestrator.run.summary import in_one_line
from vibroimpact.orchestrator.running import run_scene
from vibroimpact.orchestrator.ssp import opened_scene
from vibroimpact.orchestrator.study.preparing import prepared


def run_to_dataset(options: Run) -> None:
    """Run a scene into a dataset and print its runs and failures; typer.Exit if a single run failed."""
    began = time.perf_counter()
    output = options.output
    loaded = opened_scene(options.scene, options.changes or (), strict=options.strict)
    refuse_outputs([options.scene, *loaded.files], output)
    loaded = prepared(loaded)
    refuse_overwriting(output, options.force, lambda there: holds_scene(there, loaded))
    with shown_progress() as progress:
        found = run_scene(loaded, output, progress=progress)
    runs = found.sizes["run"]
    say(f"{counted(runs, 'run')} in {time.perf_counter() - began:.1f} s: {output}")
    say(in_one_line(loaded))
    if has_messages(found):
        for line in outcome_lines(output, runs):
            say(line, err=True)
    if runs == 1 and found["outcome"].item() in FAILED:
        raise typer.Exit(1)

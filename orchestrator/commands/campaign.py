"""The commands `check`, `run`, `campaign` and `demo`."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vibroimpact.analysis.dataset.outputs import FORCE_HELP
from vibroimpact.fmus.terminal import say

if TYPE_CHECKING:
    import xarray as xr

    from vibroimpact.orchestrator.campaign import CampaignReport

#: Different warnings that a command repeats.
MOST_WARNINGS = 3
#: Larger campaigns keep their warnings to the dataset.
MOST_RUNS_READ = 100_000

Changes = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Change a key of the scene before it is checked, the key as messages write it; may be repeated.",
    ),
]

# Each command imports what it needs when it runs: `vibroimpact --help` loads neither xarray nor Dask.


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    app.command("check")(check)
    app.command("run")(run)
    app.command("campaign")(campaign)
    app.command("demo")(demo)


def check(scene: Annotated[Path, typer.Argument(help="Scene file (TOML).")], changes: Changes = None) -> None:
    """Say what is wrong with a scene or, where nothing is, what would run and what it would cost.

    One point of the scene is computed, the middle one of its sweep, for 20 s at most; times, memory and sizes are
    those of this point, for all points. Nothing is written. Exit code 2: the scene has problems; 1: the point failed.

    Example: vibroimpact check examples/bifurcation.toml
    """
    from vibroimpact.orchestrator.campaign import cost_of
    from vibroimpact.orchestrator.commands.check_lines import cost_lines, engine_lines
    from vibroimpact.orchestrator.commands.failures import FAILED
    from vibroimpact.orchestrator.scene import load_scene

    loaded = load_scene(scene, changes or ())
    say(f"{scene}: no problems")
    for line in engine_lines(loaded):
        say(line)
    cost = cost_of(loaded)
    for line in cost_lines(loaded, cost):
        say(line)
    if cost.trial is not None and cost.trial.outcome in FAILED and not cost.trial.given_up:
        raise typer.Exit(1)


def run(
    scene: Annotated[Path, typer.Argument(help="Scene file (TOML).")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Dataset to write (.nc).")],
    changes: Changes = None,
    force: Annotated[bool, typer.Option("--force", help=FORCE_HELP)] = False,
) -> None:
    """Run a scene in this process, one point after the other, into one dataset.

    Example: vibroimpact run examples/single_run.toml -o run.nc
    """
    from vibroimpact.analysis.dataset.outputs import refuse_outputs, refuse_overwriting
    from vibroimpact.orchestrator.campaign import run_scene
    from vibroimpact.orchestrator.campaign.manifest import holds_scene
    from vibroimpact.orchestrator.campaign.progress import shown_progress
    from vibroimpact.orchestrator.commands.failures import FAILED
    from vibroimpact.orchestrator.scene import load_scene
    from vibroimpact.orchestrator.scene.summary import in_one_line

    began = time.perf_counter()
    loaded = load_scene(scene, changes or ())
    refuse_outputs([scene], output)
    refuse_overwriting(output, force, lambda there: holds_scene(there, loaded))
    with shown_progress() as progress:
        outcomes = run_scene(loaded, output, progress=progress)
    runs = sum(outcomes.values())
    say(f"{_counted(runs, 'run')} in {time.perf_counter() - began:.1f} s: {output}")
    say(in_one_line(loaded))
    _tell_rows(output, runs)
    if runs == 1 and any(kind.name in outcomes for kind in FAILED):
        raise typer.Exit(1)


def campaign(
    scene: Annotated[Path, typer.Argument(help="Scene file (TOML) that sweeps something.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the campaign.")],
    changes: Changes = None,
    workers: Annotated[
        int | None, typer.Option(help="Worker processes; one for each processor by default.", min=1)
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(help="Use the workers of this Dask scheduler (tcp://host:8786) instead.")
    ] = None,
) -> None:
    """Run all points of a scene's sweep with many workers; the same command resumes.

    Example: vibroimpact campaign examples/bifurcation.toml -o bifurcation --workers 2
    """
    from vibroimpact.analysis.dataset.outputs import refuse_folder
    from vibroimpact.fmus.errors import UsageError
    from vibroimpact.orchestrator.campaign import CampaignInterrupted, run_campaign
    from vibroimpact.orchestrator.campaign.progress import shown_progress
    from vibroimpact.orchestrator.scene import load_scene

    if workers is not None and scheduler is not None:
        raise UsageError(
            "--workers and --scheduler: expected one of them, got both. A scheduler has its own workers."
        )
    loaded = load_scene(scene, changes or ())
    refuse_folder(output)
    try:
        with shown_progress() as progress:
            report = run_campaign(loaded, output, workers=workers, scheduler=scheduler, progress=progress)
    except CampaignInterrupted as interrupted:
        say(str(interrupted), err=True)
        raise typer.Exit(130) from None
    tell(report)


def tell(report: CampaignReport) -> None:
    """Say what a campaign did."""
    if report.resumed == report.runs and not report.chunks and not report.compaction_seconds:
        say(f"Nothing to do: all {report.runs} points are in {report.dataset} already.")
        return
    computed = report.runs - report.resumed
    kept = f", {report.resumed} were there" if report.resumed else ""
    say(
        f"{_counted(computed, 'point')} computed in {report.compute_seconds:.1f} s by "
        f"{_counted(report.workers, 'worker')}{kept}: {report.dataset}"
    )
    if report.lost_workers:
        lost = "was lost; what it" if report.lost_workers == 1 else "were lost; what they"
        say(
            f"{_counted(report.lost_workers, 'worker')} {lost} had not finished was computed again.", err=True
        )
    _tell_rows(report.dataset, report.runs)


def _tell_rows(dataset: Path, runs: int) -> None:
    """List the points that failed, and repeat what bodies said of runs that went well."""
    from vibroimpact.analysis import open_dataset
    from vibroimpact.orchestrator.commands.failures import failure_lines

    with open_dataset(dataset) as opened:
        for line in failure_lines(opened):
            say(line, err=True)
        if runs <= MOST_RUNS_READ:
            _tell_warnings(opened)


def _tell_warnings(opened: xr.Dataset) -> None:
    """Repeat the messages of runs that went well: such runs have one only where their body warned."""
    fine = opened.outcome.isin([0, 1]).values  # ok, stuck
    messages = sorted({str(text) for text in opened.message.values[fine] if text})
    for message in messages[:MOST_WARNINGS]:
        say(f"warning: {message}", err=True)
    if len(messages) > MOST_WARNINGS:
        say(f"{len(messages) - MOST_WARNINGS} more warnings are in the dataset.", err=True)


def _counted(count: int, what: str) -> str:
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def demo(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the results.")] = Path("demo"),
) -> None:
    """Run the bifurcation of the impact oscillator: campaign, dataset, figure, and what is read off it.

    Example: vibroimpact demo -o demo
    """
    from vibroimpact.orchestrator.campaign import CampaignInterrupted
    from vibroimpact.orchestrator.commands.demo import run_demo

    try:
        run_demo(output)
    except CampaignInterrupted as interrupted:
        say(str(interrupted), err=True)
        raise typer.Exit(130) from None

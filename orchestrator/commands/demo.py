"""The command `vibroimpact demo`: a scene file becomes a campaign, a dataset, a figure and numbers to check."""

from __future__ import annotations

import time
from importlib import resources

from rich.table import Table

from vibroimpact.analysis import figures
from vibroimpact.analysis.dataset import open_dataset
from vibroimpact.analysis.landmarks import Reading, bifurcation_readings
from vibroimpact.fmus.errors import CampaignError
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.terminal import Terminal
from vibroimpact.orchestrator.campaign import CampaignReport
from vibroimpact.orchestrator.commands.campaign import computed
from vibroimpact.orchestrator.operations.demo import Demo
from vibroimpact.orchestrator.scene import Scene, load_scene

SCENE = "demo_scene.toml"
STEPS_ALLOWED = 2.0
"""Largest allowed distance of a reading from the exact value, in steps of the sweep."""


def run_demo(options: Demo) -> None:
    """Run the packaged bifurcation scene into a folder, draw its figure there, and print the readings.

    CampaignError: a reading is not within `STEPS_ALLOWED` of its exact value. typer.Exit: the campaign was
    interrupted.
    """
    console, output = Terminal(soft_wrap=True), options.output
    began = time.perf_counter()
    with resources.as_file(resources.files("vibroimpact.orchestrator.commands") / SCENE) as path:
        scene = load_scene(path)
    console.print(f"Scene: {scene.title}; {len(scene.sweep[0].values)} frequencies, up and down.")
    report = computed(scene, output)
    console.print(_summary(report, scene))
    with open_dataset(report.dataset) as dataset:
        figure = output / "bifurcation.png"
        figures.save(figures.draw(dataset, "bifurcation"), figure)
        readings = bifurcation_readings(dataset)
    console.print(_table(readings))
    for reading in readings:
        console.print(f"  {reading.name}: {reading.how}.")
    console.print(f"Dataset: {report.dataset}\nFigure:  {figure.absolute()}")
    console.print(f"Everything together took {time.perf_counter() - began:.1f} s.")
    _refuse_far_readings(readings)


def _summary(report: CampaignReport, scene: Scene) -> str:
    if not report.chunks:
        return f"All {report.runs} points were there already; delete the folder to compute them again."
    periods = (scene.record.transient_periods or 0) + (scene.record.recorded_periods or 0)
    return (
        f"{report.runs - report.resumed} points of {periods} forcing periods each, computed by "
        f"{report.workers} workers in {report.compute_seconds:.1f} s."
    )


def _table(readings: list[Reading]) -> Table:
    rows = ((one.name, f"{one.value:.6f}", f"{one.exact:.6f}", f"{abs(one.steps):.2f}") for one in readings)
    headings = ("<what", ">read", ">exact", ">grid steps apart")
    return table("Angular frequencies read off the dataset", *headings, rows=rows)


def _refuse_far_readings(readings: list[Reading]) -> None:
    far = [reading.name for reading in readings if abs(reading.steps) > STEPS_ALLOWED]
    if far:
        raise CampaignError(
            f"demo: expected every reading within {STEPS_ALLOWED:.0f} steps of its exact value, "
            f"got more for {', '.join(far)}."
        )

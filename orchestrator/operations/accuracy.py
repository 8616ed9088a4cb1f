"""Operation `accuracy`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from vibroimpact.fmus.operations import DatasetFile, Door, FigureFile, Force, Operation, Option, study
from vibroimpact.orchestrator.operations.arguments import Changes, SceneFile


@study("orchestrator.study.accuracy.study:AccuracyOfScene", Door("accuracy", without=("write",)))
class Accuracy(Operation):
    """Show accuracy against computing time: simulate a scene in all possible ways, against the best reference.

    The ways are: stops inside the body's FMU; stops as FMUs of their own (FMI 3.0, 2.0); plain steps of equal size;
    model exchange. Structures have numbers of modes. Each way runs at its own settings. Times are medians of runs in
    turn. A sweep is ignored. Exit code 2: no way reaches the tolerance.

    Example: vibroimpact accuracy examples/single_run.toml -o accuracy.nc --figure accuracy.png --tolerance 1e-6
    """

    scene: SceneFile
    output: DatasetFile = None
    figure: FigureFile = None
    tolerance: Annotated[float | None, Option(help="Relative error that the cheapest way must reach.")] = None
    of: Annotated[
        str,
        Option(
            help="Compared result: impact_time, impact_velocity, displacement_range, final_state, samples; or all."
        ),
    ] = "all"
    write: Annotated[
        Path | None,
        Option(help="Scene file (TOML) to write, with the cheapest way that reaches the tolerance."),
    ] = None
    budget: Annotated[float, Option(help="Processor time of all processes, s; at least 10.")] = 40.0
    changes: Changes = None
    force: Force = False

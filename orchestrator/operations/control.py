"""Operation `control`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from vibroimpact.fmus.operations import DatasetFile, Door, FigureFile, Force, Operation, Option, study
from vibroimpact.orchestrator.operations.arguments import Changes, SceneFile


@study("orchestrator.orbits.control:Controlled", Door("control", without=("output", "keep")))
class Control(Operation):
    """Keep a periodic orbit, even an unstable one, by small corrections of the forcing amplitude at each impact.

    The angular frequency moves on, step by step, whenever the impact velocity has settled. Body, stop and controller
    are coupled FMUs (the controller needs vibroimpact[python-fmus]).

    Example: vibroimpact control examples/bifurcation.toml --from 1 --to 0.7 -o kept.nc --figure kept.png
    """

    scene: SceneFile
    start: Annotated[float, Option("--from", help="First angular frequency (rad/s).")]
    stop: Annotated[float, Option("--to", help="Last angular frequency (rad/s).")]
    law: Annotated[
        str,
        Option(
            python="law: Law = 'ogy'",
            help="ogy: put on the stable direction; deadbeat: reached in two impacts; newton: located.",
        ),
    ] = "ogy"
    step: Annotated[float, Option(help="Step of the angular frequency (rad/s).")] = 1e-4
    stay: Annotated[int, Option(help="Minimum flights at each angular frequency.")] = 1
    tolerance: Annotated[
        float, Option(help="Relative difference of two successive speeds below which the frequency changes.")
    ] = 1e-4
    limit: Annotated[
        float, Option(help="Largest correction relative to the forcing amplitude; 0: no correction.")
    ] = 0.1
    noise: Annotated[float, Option(help="Relative error of measured speeds (standard deviation).")] = 0.0
    seed: Annotated[int, Option(help="Seed of the noise.")] = 1
    periods: Annotated[int, Option(help="Forcing periods of the orbit with one impact.")] = 1
    output: DatasetFile = None
    figure: FigureFile = None
    keep: Annotated[
        Path | None,
        Option(
            metavar="FOLDER",
            help="New folder for the controller's FMU, with a scene of all components.",
        ),
    ] = None
    changes: Changes = None
    force: Force = False

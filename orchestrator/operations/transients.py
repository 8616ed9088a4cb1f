"""Operation `transients`."""

from __future__ import annotations

from typing import Annotated

from vibroimpact.fmus.operations import DatasetFile, Door, FigureFile, Force, Operation, Option, study
from vibroimpact.orchestrator.operations.arguments import Changes, SceneFile


@study("orchestrator.orbits.transients:Transients", Door("transients"))
class TransientsOf(Operation):
    """Find the number of periods in which a scene forgets its start, by motions from other starts.

    Motions from the scene's start and from others are compared at each forcing phase 0. Their distance falls by a
    constant factor a period, which is printed with the factor of the body without impacts. Starts that end on another
    attractor are named; a chaotic motion forgets nothing. Without a force the period is that of the first mode.

    Example: vibroimpact transients examples/basins.toml --tolerance 1e-6 -o transients.nc --figure transients.png
    """

    scene: SceneFile
    output: DatasetFile = None
    figure: FigureFile = None
    starts: Annotated[int, Option(help="Number of starts besides that of the scene.")] = 8
    spread: Annotated[
        float, Option(help="Largest distance of these starts, relative to the size of the scene's motion.")
    ] = 1.0
    tolerance: Annotated[
        float, Option(help="Distance, relative to that size, below which a start is forgotten.")
    ] = 1e-6
    periods: Annotated[int, Option(help="Maximum number of periods.")] = 3000
    changes: Changes = None
    force: Force = False

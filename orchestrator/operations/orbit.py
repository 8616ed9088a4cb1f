"""Operation `orbit`."""

from __future__ import annotations

from typing import Annotated

from vibroimpact.fmus.operations import DatasetFile, Door, FigureFile, Force, Operation, Option, study
from vibroimpact.orchestrator.operations.arguments import Changes, FromDataset, Run, SceneFile, Seed


@study("orchestrator.orbits.find:OrbitsOfScene", Door("find_orbits", without=("output",)))
class FindOrbits(Operation):
    """Find periodic orbits of a scene, stable and unstable ones, and their multipliers.

    Without --impacts and --periods the result is all orbits of one impact a period, and the orbit on which a long run
    ends. With --seed or --from-dataset it is the orbit near the seed. No orbit passes a stop: all maxima between its
    impacts are found, and the nearest to a stop is printed. Without a force the period is the orbit's own.

    Example: vibroimpact orbit examples/bifurcation.toml --set "sweep={}" --impacts 2 --periods 2 --figure orbits.png
    """

    scene: SceneFile
    impacts: Annotated[int | None, Option(help="Impacts of an orbit.")] = None
    periods: Annotated[int | None, Option(help="Forcing periods of an orbit.")] = None
    seed: Seed = None
    from_dataset: FromDataset = None
    run: Run = None
    penetrating: Annotated[
        bool, Option("--penetrating", help="Also report orbits that pass through a stop.")
    ] = False
    output: DatasetFile = None
    figure: FigureFile = None
    changes: Changes = None
    force: Force = False

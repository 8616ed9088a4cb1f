"""Operation `follow`."""

from __future__ import annotations

from typing import Annotated

from vibroimpact.fmus.operations import DatasetFile, Door, FigureFile, Force, Operation, Option, study
from vibroimpact.orchestrator.operations.arguments import (
    Changes,
    Doublings,
    FromDataset,
    Grazes,
    Run,
    SceneFile,
    SecondStart,
    SecondStop,
    Seed,
)


@study("orchestrator.orbits.follow:Following", Door("follow"))
class Follow(Operation):
    """Follow periodic orbits over a number of a scene, stable and unstable ones, through their bifurcations.

    Folds, branch points, period doublings, tori and grazes are located and printed, and branches that begin there are
    followed. Stops may be rigid or yield; the force must be periodic or absent. First orbits are those of one impact
    and those on which runs over the range end. Index sums then show whether orbits are missing.

    --impacts and --periods search other orbits. --seed gives one for the scene as it is, --from-dataset one at the
    values of its run. With --second, folds, period doublings, tori, pitchforks and grazes are curves over both numbers,
    also those that leave points where two curves meet. The curves are then written and drawn, and the branches are
    printed. Closed branches that exist at some values of the second number only are found and named (isolas).

    Example: vibroimpact follow examples/bifurcation.toml --parameter forcing.angular_frequency --from 0.6 --to 1.6
    """

    scene: SceneFile
    parameter: Annotated[str, Option(metavar="KEY", help="Varied number of the scene.")]
    start: Annotated[float, Option("--from", help="First end of its range.")]
    stop: Annotated[float, Option("--to", help="Second end of its range.")]
    output: DatasetFile = None
    figure: FigureFile = None
    impacts: Annotated[int | None, Option(help="Impacts of the first orbits.")] = None
    periods: Annotated[
        int | None, Option(python="periods: int = 1", help="Forcing periods of the first orbits.")
    ] = None
    seed: Seed = None
    from_dataset: FromDataset = None
    run: Run = None
    doublings: Doublings = 1
    grazes: Grazes = 1
    step: Annotated[float, Option(help="Largest step along a branch, relative to the range.")] = 0.01
    starts: Annotated[
        int, Option(help="Trains of impacts from which each search for orbits of several impacts starts.")
    ] = 256
    second: Annotated[
        str | None,
        Option(metavar="KEY", help="Second number, over which the bifurcations are followed."),
    ] = None
    second_start: SecondStart = None
    second_stop: SecondStop = None
    changes: Changes = None
    force: Force = False

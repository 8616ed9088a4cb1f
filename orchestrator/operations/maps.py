"""Operation `maps`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from vibroimpact.fmus.operations import (
    DatasetFile,
    FigureFile,
    Force,
    Operation,
    Option,
    Positional,
    study,
)
from vibroimpact.orchestrator.operations.arguments import Changes


@study("orchestrator.orbits.maps:MapOfScene")
class Maps(Operation):
    """Draw a map of a scene: impacts or states at phase 0 with its orbits, sets of grazing impacts, normal forms.

    The set S has the impacts whose next impact is a graze, the set W the impacts after a graze. Nordmark's map varies
    the forcing amplitude around its first graze.

    Example: vibroimpact maps examples/thesis/figure_2_12.toml --kind discontinuity --figure sets.png
    """

    scene: Annotated[
        Path | None,
        Positional(help="Scene file (TOML); square-root, and nordmark with --alpha, need none."),
    ] = None
    kind: Annotated[
        str, Option(help="impact, strobe, discontinuity (sets S and W), nordmark, square-root.")
    ] = "impact"
    start: Annotated[float | None, Option("--from", help="First end of the range of rho or d.")] = None
    stop: Annotated[float | None, Option("--to", help="Second end of the range.")] = None
    points: Annotated[
        int, Option(help="Number of values in that range, or of grazing phases of S and W.")
    ] = 1500
    alpha: Annotated[float | None, Option(help="alpha of the Nordmark map, instead of the scene's.")] = None
    gamma: Annotated[float | None, Option(help="gamma of the Nordmark map, instead of the scene's.")] = None
    restitution: Annotated[
        float | None, Option(help="Restitution of the Nordmark map, instead of the scene's (1).")
    ] = None
    slope: Annotated[float | None, Option(help="lambda of the square-root map (0.5).")] = None
    output: DatasetFile = None
    figure: FigureFile = None
    changes: Changes = None
    force: Force = False

"""The commands of orbits and their options."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from vibroimpact.analysis.commands.shared_options import FigureFile, Force
from vibroimpact.orchestrator.commands.scene_options import Changes, SceneFile

Seed = Annotated[
    str | None,
    typer.Option(
        metavar="PHASE:STOP,...",
        help="Forcing phases (rad) of impacts near to those of an orbit, and their stops (1).",
    ),
]
FromDataset = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE", help="Dataset (.nc, or the folder of a campaign) on the orbit of whose run it begins."
    ),
]
Run = Annotated[int | None, typer.Option(help="run_index of that run, where there are several.", min=0)]


def register(app: typer.Typer) -> None:
    """Add the commands of orbits to the command line."""
    for command in (orbit, follow, maps, basins, control):
        app.command()(command)


def orbit(
    scene: SceneFile,
    impacts: Annotated[int | None, typer.Option(help="Impacts of an orbit.")] = None,
    periods: Annotated[int | None, typer.Option(help="Forcing periods of an orbit.")] = None,
    seed: Seed = None,
    from_dataset: FromDataset = None,
    run: Run = None,
    penetrating: Annotated[
        bool, typer.Option("--penetrating", help="Tell orbits that pass through a stop as well.")
    ] = False,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Dataset to write (.nc).")] = None,
    figure: FigureFile = None,
    changes: Changes = None,
    force: Force = False,
) -> None:
    """Find periodic orbits of a scene, stable and unstable ones, and say what their multipliers are.

    Without --impacts and --periods all orbits of one impact a period, and the orbit that a long run ends on; with
    --seed or --from-dataset the orbit near to it. Each is nowhere beyond a stop: all maxima between its impacts are
    found, the nearest to a stop is told.

    Example: vibroimpact orbit examples/bifurcation.toml --set "sweep={}" --impacts 2 --periods 2 --figure orbits.png
    """
    from vibroimpact.orchestrator.commands.beginning import Beginning
    from vibroimpact.orchestrator.commands.orbit import Wanted, show_orbits

    wanted = Wanted(Beginning(impacts, periods, seed, from_dataset, run), penetrating)
    show_orbits(scene, wanted, changes or (), output, figure, force)


def follow(
    scene: SceneFile,
    parameter: Annotated[str, typer.Option(metavar="KEY", help="Number of the scene that is varied.")],
    start: Annotated[float, typer.Option("--from", help="One end of its range.")],
    stop: Annotated[float, typer.Option("--to", help="The other end.")],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Dataset to write (.nc).")] = None,
    figure: FigureFile = None,
    impacts: Annotated[int | None, typer.Option(help="Impacts of the orbits to begin with (1).")] = None,
    periods: Annotated[
        int | None, typer.Option(help="Forcing periods of the orbits to begin with (1).")
    ] = None,
    seed: Seed = None,
    from_dataset: FromDataset = None,
    run: Run = None,
    doublings: Annotated[
        int, typer.Option(help="How often branches of twice the period are followed on.")
    ] = 1,
    step: Annotated[float, typer.Option(help="Largest step along a branch, over its range.")] = 0.01,
    second: Annotated[
        str | None,
        typer.Option(metavar="KEY", help="Another number, over which the bifurcations are followed as well."),
    ] = None,
    second_start: Annotated[float | None, typer.Option("--second-from", help="One end of its range.")] = None,
    second_stop: Annotated[float | None, typer.Option("--second-to", help="The other end.")] = None,
    changes: Changes = None,
    force: Force = False,
) -> None:
    """Follow periodic orbits over a number of a scene, stable and unstable ones, through their bifurcations.

    Folds, period doublings, grazes and the loss of physicality are located and printed. The stops must be rigid ones
    and the force harmonic. Orbits to begin with are looked for along the range; --seed is one of the scene as it is,
    --from-dataset one at the values of its run. With --second folds, period doublings and grazes are curves over both
    numbers, and these are what is written and drawn; the branches are printed.

    Example: vibroimpact follow examples/bifurcation.toml --parameter forcing.angular_frequency --from 0.6 --to 1.6
    """
    from vibroimpact.orchestrator.commands.beginning import Beginning
    from vibroimpact.orchestrator.commands.follow import Wanted, show_branches

    begun = Beginning(impacts, periods, seed, from_dataset, run)
    wanted = Wanted(parameter, (start, stop), begun, doublings, step, second, (second_start, second_stop))
    show_branches(scene, wanted, changes or (), output, figure, force)


def maps(
    scene: Annotated[
        Path | None,
        typer.Argument(help="Scene file (TOML); square-root, and nordmark with --alpha, need none."),
    ] = None,
    kind: Annotated[
        str, typer.Option(help="impact, strobe, discontinuity (sets S and W), nordmark, square-root.")
    ] = "impact",
    start: Annotated[float | None, typer.Option("--from", help="Of rho or d: one end of its range.")] = None,
    stop: Annotated[float | None, typer.Option("--to", help="The other end.")] = None,
    points: Annotated[
        int, typer.Option(help="Values in that range; phases of the grazes of S and W.")
    ] = 1500,
    alpha: Annotated[float | None, typer.Option(help="Of the Nordmark map, instead of the scene's.")] = None,
    gamma: Annotated[float | None, typer.Option(help="Likewise.")] = None,
    restitution: Annotated[float | None, typer.Option(help="Likewise (1).")] = None,
    slope: Annotated[float | None, typer.Option(help="lambda of the square-root map (0.5).")] = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Dataset to write (.nc).")] = None,
    figure: FigureFile = None,
    changes: Changes = None,
    force: Force = False,
) -> None:
    """Draw a map of a scene: impacts or states at phase 0 with its orbits, sets of grazing impacts, normal forms.

    S are the impacts whose next one is a graze, W those that a graze leads to. Nordmark's map is that of the forcing
    amplitude at its first graze.

    Example: vibroimpact maps examples/thesis/figure_2_12.toml --kind discontinuity --figure sets.png
    """
    from vibroimpact.fmus.errors import UsageError
    from vibroimpact.orchestrator.commands.maps import show_map
    from vibroimpact.orchestrator.orbits.maps import settings_of

    if (start is None) != (stop is None):
        raise UsageError("maps: from, to: expected both or neither, got one of them.")
    span = None if start is None or stop is None else (start, stop)
    settings = settings_of(
        kind, span=span, points=points, alpha=alpha, gamma=gamma, restitution=restitution, slope=slope
    )
    show_map(scene, settings, changes or (), output, figure, force)


def basins(
    scene: SceneFile,
    x: Annotated[
        str | None,
        typer.Option(metavar="LOW:HIGH", help="Displacements at the start (m); twice the scene's own."),
    ] = None,
    y: Annotated[
        str | None,
        typer.Option(metavar="LOW:HIGH", help="Velocities at the start (m/s); twice the scene's own."),
    ] = None,
    points: Annotated[str, typer.Option(metavar="N or NxM", help="Starts along both axes.")] = "200",
    number: Annotated[
        int | None,
        typer.Option(
            help="Mass of a chain (the one that is hit first) or mode of a beam (1) that starts so."
        ),
    ] = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Dataset to write (.nc).")] = None,
    figure: FigureFile = None,
    changes: Changes = None,
    force: Force = False,
) -> None:
    """Find which attractor each start of a plane of displacements and velocities ends on, and the share of each.

    Attractors are found by long runs, named as classify names runs, and a start counts as soon as it is so near to one
    that all starts tried at that distance came back.

    Example: vibroimpact basins examples/basins.toml --points 500 -o basins.nc --figure basins.png
    """
    from vibroimpact.orchestrator.commands.basins import points_of, show_basins, span_of
    from vibroimpact.orchestrator.orbits.basins import Plane

    plane = Plane(span_of(x, "x"), span_of(y, "y"), points_of(points), number)
    show_basins(scene, plane, changes or (), output, figure, force)


def control(
    scene: SceneFile,
    start: Annotated[float, typer.Option("--from", help="Angular frequency to begin with (rad/s).")],
    stop: Annotated[float, typer.Option("--to", help="Angular frequency to go to.")],
    law: Annotated[
        str,
        typer.Option(
            help="ogy: put on the stable direction; deadbeat: reached in two impacts; newton: located."
        ),
    ] = "ogy",
    step: Annotated[float, typer.Option(help="Of the angular frequency.")] = 1e-4,
    stay: Annotated[int, typer.Option(help="Flights at each angular frequency at least.")] = 1,
    tolerance: Annotated[
        float, typer.Option(help="Relative difference of two speeds in a row at which the frequency goes on.")
    ] = 1e-4,
    limit: Annotated[
        float, typer.Option(help="Largest correction over the forcing amplitude; 0: nothing is corrected.")
    ] = 0.1,
    noise: Annotated[
        float, typer.Option(help="Relative error of measured speeds (standard deviation).")
    ] = 0.0,
    seed: Annotated[int, typer.Option(help="Of the noise.")] = 1,
    periods: Annotated[int, typer.Option(help="Forcing periods of the orbit of one impact.")] = 1,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Dataset to write (.nc).")] = None,
    figure: FigureFile = None,
    keep: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="New folder to leave the controller's FMU in, with a scene of all components.",
        ),
    ] = None,
    changes: Changes = None,
    force: Force = False,
) -> None:
    """Keep a periodic orbit, also where it is unstable, by small corrections of the forcing amplitude at each impact.

    Meanwhile the angular frequency goes on, step by step, whenever the impact velocity has settled. Body, stop and
    controller are coupled FMUs (the controller's needs vibroimpact[python-fmus]).

    Example: vibroimpact control examples/bifurcation.toml --from 1 --to 0.7 -o kept.nc --figure kept.png
    """
    from vibroimpact.orchestrator.commands.control import show_control
    from vibroimpact.orchestrator.orbits.control_plan import settings_of

    settings = settings_of(
        law=law,
        step=step,
        tolerance=tolerance,
        limit=limit,
        noise=noise,
        seed=seed,
        periods=periods,
        stay=stay,
    )
    show_control(scene, (start, stop), settings, changes or (), output, figure, keep, force)

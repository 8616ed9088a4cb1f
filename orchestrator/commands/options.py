"""The commands of this package and their options.

What a command does is imported when it is called: `--help` loads nothing heavy.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from vibroimpact.analysis.commands.shared_options import FigureFile, Force
from vibroimpact.fmus.commands.options import commands as fmu_commands
from vibroimpact.orchestrator.commands.energy_options import register as register_energies
from vibroimpact.orchestrator.commands.orbit_options import register as register_orbits
from vibroimpact.orchestrator.commands.scene_options import Changes, SceneFile, Strict

ssp_commands = typer.Typer(no_args_is_help=True, help="Exchange systems of FMUs with other tools.")


def register(app: typer.Typer) -> None:
    """Add the commands of this package to the command line."""
    for command in (check, run, campaign, demo, accuracy, effects, replay):
        app.command()(command)
    app.command("hard-cases")(hard_cases)
    register_orbits(app)
    fmu_commands.command()(export)
    ssp_commands.command("export")(export_ssp)
    ssp_commands.command("import")(import_ssp)
    app.add_typer(ssp_commands, name="ssp")
    register_energies(app)


def check(scene: SceneFile, changes: Changes = None, strict: Strict = False) -> None:
    """Say what is wrong with a scene or, where nothing is, what would run and what it would cost.

    One point of the scene is computed, the middle one of its sweep, for 20 s at most; times, memory and sizes are
    those of this point, for all points. Nothing is written. Exit code 2: the scene has problems; 1: the point failed.

    Example: vibroimpact check examples/bifurcation.toml
    """
    from vibroimpact.orchestrator.commands.check import check_scene

    check_scene(scene, changes or (), strict=strict)


def run(
    scene: SceneFile,
    output: Annotated[Path, typer.Option("--output", "-o", help="Dataset to write (.nc).")],
    changes: Changes = None,
    force: Force = False,
    strict: Strict = False,
) -> None:
    """Run a scene in this process, one point after the other, into one dataset.

    Example: vibroimpact run examples/single_run.toml -o run.nc
    """
    from vibroimpact.orchestrator.commands.run import run_to_dataset

    run_to_dataset(scene, output, changes or (), force, strict)


def campaign(
    scene: Annotated[
        Path, typer.Argument(help="Scene file (TOML), or a system (SSP), that sweeps something.")
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the campaign.")],
    changes: Changes = None,
    workers: Annotated[
        int | None, typer.Option(help="Worker processes; one for each processor by default.", min=1)
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(help="Use the workers of this Dask scheduler (tcp://host:8786) instead.")
    ] = None,
    strict: Strict = False,
) -> None:
    """Run all points of a scene's sweep with many workers; the same command resumes.

    Example: vibroimpact campaign examples/bifurcation.toml -o bifurcation --workers 2
    """
    from vibroimpact.orchestrator.commands.campaign import run_to_folder

    run_to_folder(scene, output, changes or (), workers, scheduler, strict=strict)


def accuracy(
    scene: SceneFile,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Dataset to write (.nc).")] = None,
    figure: FigureFile = None,
    tolerance: Annotated[
        float | None, typer.Option(help="Relative error for which the cheapest way is looked for.")
    ] = None,
    of: Annotated[
        str,
        typer.Option(
            help="What errors are of: impact_time, impact_velocity, displacement_range, final_state, samples; or all."
        ),
    ] = "all",
    write: Annotated[
        Path | None, typer.Option(help="Scene file (TOML) to write, with the way that reaches the tolerance.")
    ] = None,
    budget: Annotated[
        float, typer.Option(help="Processor time to spend, of all processes, s; at least 10.")
    ] = 40.0,
    changes: Changes = None,
    force: Force = False,
) -> None:
    """Show what accuracy costs in time: simulate a scene in all ways that it can be, against the best reference.

    Ways: stops inside the body's FMU or as FMUs of their own (FMI 3.0, 2.0), plain steps of equal size, model
    exchange; each at its settings. Times are medians of runs in turn. A sweep is left out. Exit code 2: no way
    reaches the tolerance.

    Example: vibroimpact accuracy examples/single_run.toml -o accuracy.nc --figure accuracy.png --tolerance 1e-6
    """
    from vibroimpact.orchestrator.commands.accuracy import study_scene

    study_scene(scene, changes or (), output, figure, tolerance, of, write, budget, force)


def effects(
    scene: SceneFile,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Dataset to write (.nc).")] = None,
    figure: FigureFile = None,
    changes: Changes = None,
    force: Force = False,
) -> None:
    """Say what a scene asks for, what each of it costs and changes, and what is not simulated.

    The scene is run with and without each effect (forcing, damping, stops, modes, what is recorded, how it runs), in
    five pairs in turn. A sweep is left out. Exit code 2: the scene has problems.

    Example: vibroimpact effects examples/thesis/figure_7_11.toml --figure effects.png
    """
    from vibroimpact.orchestrator.commands.effects import show_effects

    show_effects(scene, changes or (), output, figure, force)


def hard_cases(
    only: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="A case to run; may be repeated. All without it.")
    ] = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Dataset to write (.nc).")] = None,
    figure: FigureFile = None,
    names: Annotated[bool, typer.Option("--list", help="Print the names of the cases and run none.")] = False,
    force: Force = False,
) -> None:
    """Run what breaks solvers of impacts, and print each figure beside its bound.

    Grazes, resonance, chatter into rest, stops that are next to rigid, units from nano to giga: each against a closed
    form or a law of conservation. Exit code 1: a figure is wrong on this machine; what is slow alone is told.

    Example: vibroimpact hard-cases --only grazing-from-above --only chatter --figure hard_cases.png
    """
    from vibroimpact.orchestrator.commands.hard_cases import show_hard_cases

    show_hard_cases(only or (), output, figure, force, names)


def demo(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the results.")] = Path("demo"),
) -> None:
    """Run the bifurcation of the impact oscillator: campaign, dataset, figure, and what is read off it.

    Example: vibroimpact demo -o demo
    """
    from vibroimpact.orchestrator.commands.demo import run_demo

    run_demo(output)


def replay(
    scene: Annotated[Path, typer.Argument(help=r"Scene file (TOML) with a \[replay] table.")],
    recordings: Annotated[
        list[Path] | None,
        typer.Argument(help="Recordings to replay, and to fit to; left out, those that the scene names."),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Dataset to write (.nc); of a campaign its folder.")
    ] = None,
    fit: Annotated[
        str | None, typer.Option(help="Numbers of the scene to fit: body.damping_ratio,sensor.gain")
    ] = None,
    score: Annotated[
        list[Path] | None, typer.Option(help="Recording to score that was not fitted on; may be repeated.")
    ] = None,
    save_scene: Annotated[
        Path | None,
        typer.Option(
            help="Scene to write with the numbers found (.toml); one that is there only with --force."
        ),
    ] = None,
    figure: FigureFile = None,
    execution: Annotated[
        str | None,
        typer.Option(help="auto, fused, or coupled (a Replay FMU drives); else as the scene says."),
    ] = None,
    workers: Annotated[int | None, typer.Option(help="Worker processes of a campaign.", min=1)] = None,
    scheduler: Annotated[str | None, typer.Option(help="Dask scheduler of a campaign.")] = None,
    force: Force = False,
) -> None:
    """Drive a scene by recorded channels and compare its motion with what was measured.

    One recording, or several with --fit and --score, make a dataset. A folder as output makes a campaign over all
    recordings and the grid that the scene sweeps, on many workers; the same command resumes it.

    Example: vibroimpact replay examples/recordings/board.toml a0.nc -o fit.nc --fit body.damping_ratio --score a1.nc
    """
    from vibroimpact.orchestrator.commands.replay import replay_recordings

    replay_recordings(
        *(scene, recordings or (), score or (), output, fit, save_scene, figure, execution),
        *(workers, scheduler, force),
    )


def export(
    component: Annotated[
        str, typer.Argument(help="Component, for example oscillator, or the scene file (TOML) of one body.")
    ],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="File to write.")] = None,
    changes: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="NAME=VALUE",
            help="Start value of a variable, for example contact[1].law=restitution, or a key of the scene; "
            "may be repeated.",
        ),
    ] = None,
    contacts: Annotated[int | None, typer.Option(help="Contacts in its description.")] = None,
    modes: Annotated[int | None, typer.Option(help="Beam: modes in its description.")] = None,
    masses: Annotated[int | None, typer.Option(help="Chain: masses, likewise.")] = None,
    sensors: Annotated[int | None, typer.Option(help="Beam: sensors, likewise.")] = None,
    fmi: Annotated[str, typer.Option(help="FMI version, 3.0 or 2.0.")] = "3.0",
    full: Annotated[
        bool,
        typer.Option("--full", help="Describe all variables, as the importer of this package needs them."),
    ] = False,
    ports: Annotated[
        Literal["external"] | None,
        typer.Option(help="external: describe what a tool needs that answers contacts itself."),
    ] = None,
    enumerations: Annotated[
        bool, typer.Option("--enumerations", help="Keep enumerations; else they are integers.")
    ] = False,
    platform: Annotated[
        str | None,
        typer.Option(
            help="Machines it is for: all, or names such as x86_64-windows,x86_64-linux. Needs the extra cross where "
            "this release has no libraries for them."
        ),
    ] = None,
    law: Annotated[Path | None, typer.Option(help="user-contact-law: the Python file of your law.")] = None,
) -> None:
    """Write an FMU for another tool: a component, or the body of a scene with its stops. Needs no compiler.

    A component that is given no forcing, contact or start of motion starts displaced, so that a run of it shows motion.
    A scene's numbers are the start values; what it sweeps has the value that it has in its own table.

    Example: vibroimpact fmu export beam --modes 8 --contacts 2 -o beam8.fmu

    A rig, ready: vibroimpact fmu export examples/single_run.toml -o rig.fmu

    A contact law of your own in Python: vibroimpact fmu export user-contact-law --law my_law.py -o my_law.fmu
    """
    from vibroimpact.orchestrator.commands.export import export_to_file

    counts = {"contacts": contacts, "modes": modes, "masses": masses, "sensors": sensors}
    kinds = {"full": full, "external": ports == "external", "enumerations": enumerations}
    export_to_file(component, output, counts, changes, fmi, kinds, platform, law)


def export_ssp(
    scene: Annotated[Path, typer.Argument(help="Scene file (TOML) of components.")],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Archive to write (.ssp).")] = None,
    changes: Changes = None,
    ssp: Annotated[str, typer.Option(help="SSP version, 1.0 or 2.0.")] = "1.0",
    fmi: Annotated[
        str | None,
        typer.Option(
            help="FMI version of this package's components in the archive, 2.0 or 3.0; by default 2.0, with "
            "SSP 2.0 as the scene says."
        ),
    ] = None,
    gains: Annotated[
        str,
        typer.Option(
            help="A gain is a component with units of its own, or a transformation of its connection: without delay "
            "where values are exchanged once a step, but OMSimulator leaves it out."
        ),
    ] = "component",
    platform: Annotated[
        str | None, typer.Option(help="Machines it is for, as `vibroimpact fmu export` has them.")
    ] = None,
) -> None:
    """Write a scene of components as a system that other tools run: FMUs, start values, connections.

    What SSP has no words for (events, record, sweep, execution) travels in an annotation, and comes back with it.

    Example: vibroimpact ssp export examples/two_oscillators.toml -o two.ssp
    """
    from vibroimpact.orchestrator.commands.ssp import export_to_archive

    export_to_archive(scene, output, changes or (), ssp, fmi, gains, platform)


def import_ssp(
    archive: Annotated[Path, typer.Argument(help="System (.ssp, version 1.0 or 2.0).")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Scene file to write (.toml); FMUs go beside it.")
    ] = None,
    changes: Changes = None,
    parameters: Annotated[
        list[Path] | None,
        typer.Option(
            help="Parameter set (.ssv), a file or one in the archive; repeated, they are made a sweep."
        ),
    ] = None,
    force: Force = False,
) -> None:
    """Write a system as a scene file, with its FMUs in a folder beside it. `vibroimpact run` takes the system as it is.

    Example: vibroimpact ssp import two.ssp -o two.toml

    A sweep: vibroimpact ssp import two.ssp --parameters soft.ssv --parameters hard.ssv -o sweep.toml
    """
    from vibroimpact.orchestrator.commands.ssp import import_to_scene

    import_to_scene(archive, output, changes or (), parameters or (), force)

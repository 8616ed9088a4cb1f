"""Operation `export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from vibroimpact.fmus.operations import Door, Operation, Option, Positional, operation


@operation(
    "orchestrator.commands.export:export_to_file",
    Door("export_fmu", without=("changes", "contacts", "modes", "masses", "sensors", "law")),
)
class ExportFmu(Operation):
    """Write an FMU for another tool: a component, or the body of a scene with its stops. Needs no compiler.

    A component without forcing, contact or initial motion starts displaced, so that its run shows motion. A scene's
    numbers are the start values; a swept key has the value in its own table.

    Example: vibroimpact fmu export beam --modes 8 --contacts 2 -o beam8.fmu

    A whole rig: vibroimpact fmu export examples/single_run.toml -o rig.fmu

    A contact law of your own in Python: vibroimpact fmu export user-contact-law --law my_law.py -o my_law.fmu
    """

    component: Annotated[
        str,
        Positional(
            python="scene: SceneLike",
            help="Component, for example oscillator, or the scene file (TOML) of one body.",
        ),
    ]
    output: Annotated[
        Path | None, Option("--output", "-o", python="path: PathLike", help="File to write.")
    ] = None
    changes: Annotated[
        list[str] | None,
        Option(
            "--set",
            metavar="NAME=VALUE",
            help="Start value of a variable, for example contact[1].law=restitution, or a key of the scene; "
            "may be repeated.",
        ),
    ] = None
    contacts: Annotated[int | None, Option(help="Number of contacts in its description.")] = None
    modes: Annotated[int | None, Option(help="Beam: number of modes in its description.")] = None
    masses: Annotated[int | None, Option(help="Chain: number of masses in its description.")] = None
    sensors: Annotated[int | None, Option(help="Beam: number of sensors in its description.")] = None
    fmi: Annotated[str, Option(help="FMI version, 3.0 or 2.0.")] = "3.0"
    full: Annotated[
        bool,
        Option("--full", help="Describe all variables, as the importer of this package needs them."),
    ] = False
    ports: Annotated[
        Literal["external"] | None,
        Option(
            python="external: bool = False",
            help="external: describe the variables for a tool with contact laws of its own.",
        ),
    ] = None
    enumerations: Annotated[bool, Option("--enumerations", help="Keep enumerations instead of integers.")] = (
        False
    )
    model_exchange: Annotated[
        bool,
        Option(
            "--model-exchange",
            help="Structure: describe the states of its modes, too, for tools that integrate them. Other bodies "
            "always have theirs.",
        ),
    ] = False
    sensitivities: Annotated[
        str | None,
        Option(
            metavar="KEY,...",
            help="Add the derivatives of outputs over these parameters since the start, through impacts, for example "
            "stop[1].restitution,forcing.amplitude; for co-simulation alone.",
        ),
    ] = None
    strobes: Annotated[
        bool,
        Option(
            "--strobes",
            help="FMI 3.0: add the output clock phase_zero, which ticks at forcing phase zero, with displacement and "
            "velocity there.",
        ),
    ] = False
    structural: Annotated[
        bool,
        Option(
            "--structural",
            help="FMI 3.0: make modes, masses and contacts structural parameters, which are set in configuration mode.",
        ),
    ] = False
    platform: Annotated[
        str | None,
        Option(
            help="Target machines: all, or names such as x86_64-windows,x86_64-linux. Needs the extra cross where "
            "this release has no libraries for them."
        ),
    ] = None
    law: Annotated[Path | None, Option(help="user-contact-law: the Python file of the law.")] = None

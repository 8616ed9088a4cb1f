"""The options of the commands `vibroimpact rig`; what these do is imported when they are called."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

RigFile = Annotated[Path, typer.Argument(help="File of a virtual rig (TOML).", metavar="RIG.toml")]
RigChoice = Annotated[
    str | None,
    typer.Option("--rig", help="virtual:RIG.toml, grpc://host:port or local.", metavar="RIG"),
]


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    group = typer.Typer(no_args_is_help=True, help="Rigs: boards of NI, and a virtual one.")
    group.command("serve")(serve)
    group.command("devices")(devices)
    group.command("record")(record)
    group.command("sweep")(sweep)
    app.add_typer(group, name="rig")


def serve(
    file: RigFile,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port; 0: any free one.")] = 31763,
    speed: Annotated[
        float | None, typer.Option(help="Seconds of the rig in a second; else as the file says.")
    ] = None,
    lockstep: Annotated[
        bool, typer.Option("--lockstep", help="Time goes on only while a program waits for it.")
    ] = False,
) -> None:
    """Serve a virtual rig on this machine, as NI's gRPC device server serves a board, until Ctrl-C.

    Example: vibroimpact rig serve examples/rig/oscillator.toml
    """
    from vibroimpact.hardware.commands.rigs import serve_rig

    serve_rig(file, port, speed, lockstep)


def devices(rig: RigChoice = None) -> None:
    """List the devices of a rig with their channels and ranges.

    Example: vibroimpact rig devices --rig virtual:examples/rig/oscillator.toml
    """
    from vibroimpact.hardware.commands.rigs import list_devices

    list_devices(rig)


def record(
    output: Annotated[Path, typer.Option("--output", "-o", help="Recording to write (.nc).")],
    channel: Annotated[
        list[str],
        typer.Option(
            help="NAME=TERMINAL[,RANGE]: an input and its range in V; repeat it, 8 at most.",
            metavar="NAME=TERMINAL[,RANGE]",
        ),
    ],
    rate: Annotated[float, typer.Option(help="Samples per second and channel.")],
    duration: Annotated[float, typer.Option(help="s.")],
    rig: RigChoice = None,
    force: Annotated[bool, typer.Option("--force", help="Replace what is there.")] = False,
) -> None:
    """Record inputs of a rig; the volts become a recording, which says which rig made it.

    Example: vibroimpact rig record --rig virtual:RIG.toml --channel tip=Dev1/ai0,5 --rate 5000 --duration 2 -o tip.nc
    """
    from vibroimpact.hardware.programs.record import record_channels

    record_channels(rig, channel, rate, duration, output, force)


def sweep(
    file: Annotated[Path, typer.Argument(help="File of a sweep (TOML).", metavar="SWEEP.toml")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of its dataset.", metavar="FOLDER")],
    rig: RigChoice = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Draw the planned output, say how long it takes, drive nothing.")
    ] = False,
) -> None:
    """Measure a frequency sweep, up and down, as a dataset like that of a campaign; the same command goes on with it.

    Ctrl-C brings the output to rest; what is measured is kept.

    Example: vibroimpact rig sweep examples/rig/sweep.toml -o sweep
    """
    from vibroimpact.hardware.programs.sweep.command import sweep_rig

    sweep_rig(file, output, rig, dry_run)

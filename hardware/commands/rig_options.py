"""The options of the commands `vibroimpact rig`; what these do is imported when they are called."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from vibroimpact.analysis.commands.shared_options import Force

RigFile = Annotated[Path, typer.Argument(help="File of a virtual rig (TOML).", metavar="RIG.toml")]
RigChoice = Annotated[
    str | None,
    typer.Option("--rig", help="virtual:RIG.toml, grpc://host:port or local.", metavar="RIG"),
]

Recorded = Annotated[Path, typer.Option("--output", "-o", help="Recording to write (.nc).")]
Channels = Annotated[
    list[str],
    typer.Option(
        help="NAME=TERMINAL[,RANGE]: an input and its range in V; repeat it, 8 at most.",
        metavar="NAME=TERMINAL[,RANGE]",
    ),
]
Rate = Annotated[float, typer.Option(help="Samples per second and channel.")]
Duration = Annotated[float | None, typer.Option(help="s; else until Ctrl-C.")]
Calibrations = Annotated[
    list[Path] | None,
    typer.Option(help="File of calibrations (TOML): volts become m, N.", metavar="FILE.toml"),
]


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    group = typer.Typer(no_args_is_help=True, help="Rigs: boards of NI, and a virtual one.")
    group.command("serve")(serve)
    group.command("devices")(devices)
    group.command("record")(record)
    group.command("sine")(sine)
    group.command("spikes")(spikes)
    group.command("recover")(recover)
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
    output: Recorded,
    channel: Channels,
    rate: Rate,
    duration: Duration = None,
    loopback: Annotated[
        list[str] | None,
        typer.Option(
            help="The same of an input to which an output is wired.", metavar="NAME=TERMINAL[,RANGE]"
        ),
    ] = None,
    calibration: Calibrations = None,
    rig: RigChoice = None,
    force: Force = False,
) -> None:
    """Record inputs of a rig; the recording says which rig made it.

    A journal beside it has all samples meanwhile: after any death of the program `rig recover` makes the recording.

    Example: vibroimpact rig record --rig virtual:RIG.toml --channel tip=Dev1/ai0,5 --rate 5000 --duration 2 -o tip.nc
    """
    from vibroimpact.hardware.programs.record import record_channels

    record_channels(rig, channel, rate, duration, output, loopback or (), calibration or (), force)


def spikes(
    output: Recorded,
    channel: Channels,
    rate: Rate,
    threshold: Annotated[
        float, typer.Option(help="Beyond it is a pulse, unit of the channel; negative: below it.")
    ],
    duration: Duration = None,
    pulses: Annotated[int | None, typer.Option(help="Pulses after which it ends.")] = None,
    on: Annotated[str, typer.Option(help="Channel that has the pulses; else the first.")] = "",
    presamples: Annotated[int, typer.Option(help="Samples that are kept of before a pulse.")] = 64,
    postsamples: Annotated[int, typer.Option(help="Samples that are kept of after a pulse.")] = 64,
    dead_time: Annotated[
        float,
        typer.Option(
            help="Time from the start of a pulse, s, within which what passes the threshold belongs to it."
        ),
    ] = 0.0,
    hysteresis: Annotated[
        float, typer.Option(help="Part of the threshold below which a pulse is over.")
    ] = 0.5,
    calibration: Calibrations = None,
    rig: RigChoice = None,
    force: Force = False,
) -> None:
    """Record the pulses of a load cell with the samples around them; `vibroimpact spikes` measures them.

    Example: vibroimpact rig spikes --rig local --channel cell=Dev1/ai1,5 --rate 50000 --threshold 0.1 -o hits.nc
    """
    from vibroimpact.hardware.programs.spikes import PulseOptions, record_pulses

    options = PulseOptions(threshold, on, hysteresis, presamples, postsamples, dead_time, pulses)
    record_pulses(rig, channel, rate, duration, options, output, calibration or (), force)


def recover(
    journal: Annotated[
        Path, typer.Argument(help="Journal of a measurement that died.", metavar="REC.journal")
    ],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Recording to write; else REC.nc beside it.")
    ] = None,
    force: Force = False,
) -> None:
    """Make the recording of a measurement that died, from its journal.

    Example: vibroimpact rig recover tip.journal -o tip.nc
    """
    from vibroimpact.hardware.programs.recover import recover_into

    recover_into(journal, output, force)


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


def sine(
    output: Annotated[str, typer.Option(help="Output that drives.", metavar="TERMINAL")],
    frequency: Annotated[float, typer.Option(help="Hz.")],
    amplitude: Annotated[float, typer.Option(help="V.")],
    ramp: Annotated[float, typer.Option(help="Time in which it rises, and falls at the end, s.")] = 0.5,
    duration: Annotated[float | None, typer.Option(help="s, ramps included; else until Ctrl-C.")] = None,
    rate: Annotated[float, typer.Option(help="Samples per second.")] = 10_000.0,
    most_amplitude: Annotated[float, typer.Option(help="Limit of the output, V.")] = 5.0,
    most_slew: Annotated[float, typer.Option(help="Limit of the output, V/s.")] = 2000.0,
    rig: RigChoice = None,
) -> None:
    """Drive an output with a sine until Ctrl-C or for a time; a guardian brings it to rest if this program cannot.

    Example: vibroimpact rig sine --rig grpc://127.0.0.1:31763 --output Dev1/ao0 --frequency 5.3 --amplitude 1
    """
    from vibroimpact.hardware.programs.sine import drive_sine

    drive_sine(
        output,
        frequency,
        amplitude,
        ramp=ramp,
        duration=duration,
        rate=rate,
        most_amplitude=most_amplitude,
        most_slew=most_slew,
        rig=rig,
    )

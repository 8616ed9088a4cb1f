"""The options of `vibroimpact estimate decay`, `impacts`, `bounces` and `response`."""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from vibroimpact.analysis.commands.shared_options import DatasetFile, FigureFile, Force
from vibroimpact.fmus.errors import DatasetError, UsageError

Data = Annotated[Path, typer.Argument(help="Recording, or dataset of runs (.nc).")]
ChannelName = Annotated[
    str | None, typer.Option("--channel", help="Channel to use; not needed where there is one.")
]
WindowStart = Annotated[float | None, typer.Option("--from", help="Start of the window, s.")]
WindowEnd = Annotated[float | None, typer.Option("--to", help="End of the window, s.")]
RunIndex = Annotated[
    int | None, typer.Option("--run", help="run_index of the run, where there are several.", min=0)
]


# Kinds of estimation that version 0.1 did not have: its form never meant them.
_NEW_KINDS = ("bounces",)


class EstimateGroup(TyperGroup):
    """The command `estimate`, which says what its form of version 0.1, `estimate FILE --kind KIND`, is now."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse what follows `estimate`.

        Raises
        ------
        UsageError
            It has the old form; with the command to write.
        """
        if args and args[0] not in (*self.commands, "--help") and _has_old_form(args[0]):
            kind, words = _without_kind(args)
            names = [kind] if kind in self.commands else self._kinds(words)
            commands = [shlex.join(["vibroimpact", "estimate", name, *words]) for name in names]
            raise UsageError(
                f"estimate: expected one of {', '.join(self.commands)}, then the data, got {args[0][:200]} first. "
                f"Write: {', or '.join(commands)}"
            )
        return super().parse_args(ctx, args)

    def _kinds(self, words: Sequence[str]) -> list[str]:
        """Return the kinds of estimation that have all these options; of several that which fits the data."""
        options = {
            name: _options(command) for name, command in self.commands.items() if name not in _NEW_KINDS
        }
        given = {word.partition("=")[0] for word in words if word.startswith("-")}
        fitting = [name for name, known in options.items() if given <= known.keys()] or list(options)
        lengths = {option: count for known in options.values() for option, count in known.items()}
        data = next(_arguments(words, lengths), None)
        if len(fitting) == 1 or data is None:
            return fitting
        from vibroimpact.analysis.commands.estimate_scene import kind_of

        try:
            kind = kind_of(Path(data), one_run="--run" in given)
        except DatasetError:
            return fitting
        return [kind] if kind in fitting else fitting


def _has_old_form(first: str) -> bool:
    """Tell whether the first word is an option or a file; a kind of estimation that is misspelt is neither."""
    return first.startswith("-") or bool(Path(first).suffix) or os.path.exists(first)


def _without_kind(args: Sequence[str]) -> tuple[str, list[str]]:
    """Return the value of `--kind`, empty without, and the other words."""
    kind, words, rest = "", [], iter(args)
    for word in rest:
        name, _, value = word.partition("=")
        if name == "--kind":
            kind = value or next(rest, "")
        else:
            words.append(word)
    return kind, words


def _options(command: Any) -> dict[str, int]:
    """Return the options of a command, each with the number of words that follow it."""
    options = [parameter for parameter in command.params if parameter.param_type_name == "option"]
    return {name: 0 if option.is_flag else option.nargs for option in options for name in option.opts}


def _arguments(words: Sequence[str], lengths: Mapping[str, int]) -> Iterator[str]:
    """Yield the words that are neither options nor their values."""
    rest = iter(words)
    for word in rest:
        if not word.startswith("-"):
            yield word
        for _ in range(lengths.get(word, 0)):
            next(rest, None)


estimate = typer.Typer(
    cls=EstimateGroup,
    no_args_is_help=True,
    help="Estimate damping, frequency, damping law, frequency response, or restitution from a signal.",
)


@estimate.command()
def decay(
    data: Data,
    channel: ChannelName = None,
    start: WindowStart = None,
    stop_time: WindowEnd = None,
    run: RunIndex = None,
    law: Annotated[
        str, typer.Option(help="Damping law to fit: all, none, or a sum such as viscous+coulomb.")
    ] = "all",
    cubic: Annotated[
        bool, typer.Option("--cubic", help="Fit a cubic stiffness with every damping law.")
    ] = False,
    periods: Annotated[
        float | None, typer.Option(help="Periods in a window of the backbone.", min=2.0)
    ] = None,
    output: DatasetFile = None,
    figure: FigureFile = None,
    force: Force = False,
) -> None:
    """Estimate frequency, damping and damping law from a free decay.

    Example: vibroimpact estimate decay pendulum.nc --from 40 --to 80 -o estimates.nc --figure estimates.png
    """
    from vibroimpact.analysis.commands.estimate import Estimation, decay_of

    decay_of(Estimation(data, channel, start, stop_time, run, output, figure, force), law, cubic, periods)


@estimate.command()
def impacts(
    data: Data,
    channel: ChannelName = None,
    start: WindowStart = None,
    stop_time: WindowEnd = None,
    run: RunIndex = None,
    forcing_frequency: Annotated[
        float | None, typer.Option(help="Frequency of the force, Hz; 0: no force oscillates.")
    ] = None,
    angular_frequency: Annotated[float | None, typer.Option(help="The same, rad/s.")] = None,
    amplitude: Annotated[
        float | None, typer.Option(help="Amplitude of the force, N; needs --mass and a natural frequency.")
    ] = None,
    static_deflection: Annotated[
        float | None, typer.Option(help="Amplitude of the force over the stiffness, unit of the channel.")
    ] = None,
    phase: Annotated[float | None, typer.Option(help="Phase of the force at time 0, rad.")] = None,
    stop: Annotated[float | None, typer.Option(help="Position of the stop, unit of the channel.")] = None,
    natural_frequency: Annotated[float | None, typer.Option(help="Undamped natural frequency, Hz.")] = None,
    damping_ratio: Annotated[float | None, typer.Option(help="Damping ratio, where it is known.")] = None,
    mass: Annotated[float | None, typer.Option(help="Mass, kg.")] = None,
    offset: Annotated[
        float | None, typer.Option(help="What the channel reads at rest, where it is known.")
    ] = None,
    clock_drifts: Annotated[
        bool,
        typer.Option(
            "--clock-drifts",
            help="Clocks of force and recording differ: the forcing frequency is fitted, within 0.5 %.",
        ),
    ] = False,
    output: DatasetFile = None,
    figure: FigureFile = None,
    force: Force = False,
) -> None:
    """Estimate restitution, damping, frequency and forcing from motion against a stop.

    Of a simulated run, forcing and stop are taken from its scene.

    Example: vibroimpact estimate impacts run.nc --run 3 -o estimates.nc --figure estimates.png
    """
    from vibroimpact.analysis.commands.estimate import Estimation, impacts_of
    from vibroimpact.analysis.commands.estimate_scene import ImpactOptions

    options = ImpactOptions(
        *(forcing_frequency, angular_frequency, amplitude, static_deflection, phase, stop),
        *(natural_frequency, damping_ratio, mass, offset, clock_drifts),
    )
    impacts_of(Estimation(data, channel, start, stop_time, run, output, figure, force), options)


@estimate.command()
def bounces(
    data: Data,
    channel: ChannelName = None,
    start: WindowStart = None,
    stop_time: WindowEnd = None,
    run: RunIndex = None,
    side: Annotated[
        str | None, typer.Option(help="Side of the stop, upper or lower; else as the signal shows.")
    ] = None,
    output: DatasetFile = None,
    figure: FigureFile = None,
    force: Force = False,
) -> None:
    """Estimate the restitution of a body that bounces under its weight, or under another constant force.

    Where it changes with the speed of impact, r(v) is given in its place.

    Example: vibroimpact estimate bounces ball.nc --channel height -o estimates.nc --figure estimates.png
    """
    from vibroimpact.analysis.commands.estimate import Estimation, bounces_of

    bounces_of(Estimation(data, channel, start, stop_time, run, output, figure, force), side)


@estimate.command()
def response(
    data: Data,
    channel: ChannelName = None,
    start: WindowStart = None,
    stop_time: WindowEnd = None,
    run: RunIndex = None,
    drive: Annotated[str | None, typer.Option(help="Channel that drives, for a frequency response.")] = None,
    form: Annotated[
        str, typer.Option(help="Motion: auto, displacement, velocity, acceleration or transmissibility.")
    ] = "auto",
    band: Annotated[
        tuple[float, float] | None, typer.Option(help="Band of the resonance, two numbers, Hz.")
    ] = None,
    segment: Annotated[int | None, typer.Option(help="Samples in a segment of the spectra.", min=16)] = None,
    window: Annotated[
        str, typer.Option(help="Window of the spectra: bartlett, hann or boxcar.")
    ] = "bartlett",
    estimator: Annotated[str, typer.Option(help="h1 (noisy response) or h2 (noisy drive).")] = "h1",
    output: DatasetFile = None,
    figure: FigureFile = None,
    force: Force = False,
) -> None:
    """Estimate a resonance from a drive and a response, or from a simulated sweep of the frequency.

    Example: vibroimpact estimate response hammer.nc --drive force --channel tip --segment 8192
    """
    from vibroimpact.analysis.commands.estimate import Estimation, response_of

    response_of(
        Estimation(data, channel, start, stop_time, run, output, figure, force),
        *(drive, form, band, segment, window, estimator),
    )

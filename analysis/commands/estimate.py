"""The command `vibroimpact estimate`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vibroimpact.analysis.commands.shared_options import Force
from vibroimpact.fmus.errors import EstimationError, UsageError
from vibroimpact.fmus.terminal import Terminal

if TYPE_CHECKING:
    import xarray as xr

    from vibroimpact.analysis.commands.estimate_scene import ImpactOptions
    from vibroimpact.analysis.decay.free_decay import FreeDecay
    from vibroimpact.analysis.recording import Recording

KINDS = ("auto", "decay", "impacts", "response")


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("estimate")(estimate)


def estimate(
    data: Annotated[Path, typer.Argument(help="Recording, or dataset of runs (.nc).")],
    channel: Annotated[
        str | None, typer.Option(help="Channel to use; not needed where there is one.")
    ] = None,
    kind: Annotated[
        str,
        typer.Option(help="auto, decay (free), impacts (forced, against a stop) or response (resonance)."),
    ] = "auto",
    start: Annotated[float | None, typer.Option("--from", help="Start of the window, s.")] = None,
    stop_time: Annotated[float | None, typer.Option("--to", help="End of the window, s.")] = None,
    run: Annotated[
        int | None, typer.Option(help="run_index of the run, where there are several.", min=0)
    ] = None,
    law: Annotated[
        str, typer.Option(help="Damping law to fit: all, none, or a sum such as viscous+coulomb.")
    ] = "all",
    cubic: Annotated[
        bool, typer.Option("--cubic", help="Fit a cubic stiffness with every damping law.")
    ] = False,
    periods: Annotated[
        float | None, typer.Option(help="Periods in a window of the backbone.", min=2.0)
    ] = None,
    drive: Annotated[str | None, typer.Option(help="Channel that drives, for a frequency response.")] = None,
    form: Annotated[
        str, typer.Option(help="Response: auto, displacement, velocity, acceleration or transmissibility.")
    ] = "auto",
    band: Annotated[
        tuple[float, float] | None, typer.Option(help="Band of the resonance, two numbers, Hz.")
    ] = None,
    segment: Annotated[int | None, typer.Option(help="Samples in a segment of the spectra.", min=16)] = None,
    window: Annotated[
        str, typer.Option(help="Window of the spectra: bartlett, hann or boxcar.")
    ] = "bartlett",
    estimator: Annotated[str, typer.Option(help="h1 (noisy response) or h2 (noisy drive).")] = "h1",
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
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Dataset to write (.nc).")] = None,
    figure: Annotated[Path | None, typer.Option(help="Figure to write: .png, .pdf or .svg.")] = None,
    force: Force = False,
) -> None:
    """Estimate damping, frequency, damping law, frequency response, or restitution from a signal.

    Example: vibroimpact estimate pendulum.nc --from 40 --to 80 -o estimates.nc --figure estimates.png
    """
    from vibroimpact.analysis.commands.estimate_scene import ImpactOptions, chosen_kind, refuse_far_options
    from vibroimpact.analysis.dataset.outputs import refuse_outputs, refuse_overwriting

    if kind not in KINDS:
        raise UsageError(f'--kind: expected one of {", ".join(KINDS)}, got "{kind}".')
    if estimator not in ("h1", "h2"):
        raise UsageError(f'--estimator: expected h1 or h2, got "{estimator}".')
    impacts = ImpactOptions(
        forcing_frequency,
        angular_frequency,
        amplitude,
        static_deflection,
        phase,
        stop,
        natural_frequency,
        damping_ratio,
        mass,
        offset,
        clock_drifts,
    )
    refuse_outputs([data], output, figure)
    same = ("estimates", data.name)
    refuse_overwriting(
        output, force, lambda there: (there.get("results_kind"), there.get("source_file")) == same
    )
    kind = chosen_kind(data, kind, run, drive, impacts)
    refuse_far_options(
        kind,
        impacts,
        {
            "--drive": drive is not None,
            "--band": band is not None,
            "--segment": segment is not None,
            "--form": form != "auto",
            "--window": window != "bartlett",
            "--estimator": estimator != "h1",
        },
        {"--law": law != "all", "--cubic": cubic, "--periods": periods is not None},
    )
    # Piped, a table is as wide as it needs to be.
    console = Terminal(soft_wrap=False, width=None if Terminal().is_terminal else 160)
    try:
        if kind == "decay":
            found = _decay(console, data, channel, run, start, stop_time, law, cubic, periods)
        elif kind == "impacts":
            found = _impacts(console, data, channel, run, start, stop_time, impacts)
        else:
            found = _response(
                console, data, channel, run, drive, start, stop_time, form, band, segment, window, estimator
            )
    except EstimationError as problem:
        raise EstimationError(f"{data}: {problem}") from problem
    _written(console, found, output, figure)


def _decay(
    console: Terminal,
    data: Path,
    channel: str | None,
    run: int | None,
    start: float | None,
    stop: float | None,
    law: str,
    cubic: bool,
    periods: float | None,
) -> xr.Dataset:
    from vibroimpact.analysis.decay.free_decay import estimate_decay
    from vibroimpact.analysis.decay.laws import ALL_LAWS, damping_law
    from vibroimpact.analysis.decay.samples import decay_samples
    from vibroimpact.analysis.decay.tables import print_decay
    from vibroimpact.analysis.recording import open_signals

    laws = () if law == "none" else ALL_LAWS if law == "all" else (damping_law(law),)
    recording = open_signals(data, run)
    samples = decay_samples(_channel(recording, channel), start, stop)
    found: FreeDecay = estimate_decay(samples, laws, cubic=cubic, periods=periods)
    print_decay(console, found)
    return _sourced(found.dataset(), data, recording)


def _impacts(
    console: Terminal,
    data: Path,
    channel: str | None,
    run: int | None,
    start: float | None,
    stop: float | None,
    options: ImpactOptions,
) -> xr.Dataset:
    from vibroimpact.analysis.commands.estimate_scene import cut, forcing_and_known
    from vibroimpact.analysis.estimation.bounces import estimate_bounces
    from vibroimpact.analysis.estimation.impacts import estimate_impacts
    from vibroimpact.analysis.estimation.report import print_impacts
    from vibroimpact.analysis.recording import open_signals

    recording = open_signals(data, run)
    forcing, known = forcing_and_known(data, run, recording, options)
    part = cut(_channel(recording, channel), start, stop)
    found = (
        estimate_bounces(part, side=known.side) if forcing is None else estimate_impacts(part, forcing, known)
    )
    print_impacts(console, found)
    return _sourced(found.dataset().assign_attrs(estimates="impacts"), data, recording)


def _response(
    console: Terminal,
    data: Path,
    channel: str | None,
    run: int | None,
    drive: str | None,
    start: float | None,
    stop: float | None,
    form: str,
    band: tuple[float, float] | None,
    segment: int | None,
    window: str,
    estimator: str,
) -> xr.Dataset:
    from vibroimpact.analysis.decay.frequency_response import frequency_response
    from vibroimpact.analysis.decay.resonance import curve_of, fit_resonance, resolution_remark
    from vibroimpact.analysis.decay.response_estimates import ResponseEstimates
    from vibroimpact.analysis.recording import is_recording, open_signals

    if drive is None and is_recording(data):
        raise UsageError("--kind response: expected the channel that drives, got none. Give --drive.")
    if drive is None:
        return _swept(console, data, band)
    recording = open_signals(data, run)
    others = [name for name in recording.channels if name != drive]
    answer = recording.channel(channel or (others[0] if len(others) == 1 else None))
    response = frequency_response(
        recording.channel(drive), answer, segment=segment, window=window, start=start, stop=stop
    )
    resonance = fit_resonance(curve_of(response, form, band, estimator))
    title = f"Response of {answer.name} to {drive}"
    remarks = (*recording.remarks_counted, *response.remarks, *resolution_remark(response, resonance))
    return _sourced(
        _shown_response(console, ResponseEstimates(resonance, response, title, response.unit, remarks)),
        data,
        recording,
    )


def _swept(console: Terminal, data: Path, band: tuple[float, float] | None) -> xr.Dataset:
    from vibroimpact.analysis.commands.estimate_scene import scene_of
    from vibroimpact.analysis.dataset.reading import read_flat
    from vibroimpact.analysis.decay.resonance import fit_resonance
    from vibroimpact.analysis.decay.response_estimates import ResponseEstimates
    from vibroimpact.analysis.decay.swept_response import swept_response

    attrs = read_flat(data).attrs
    forcing = scene_of(attrs).get("forcing", {})
    amplitude = forcing.get("amplitude")
    known = isinstance(amplitude, int | float) and amplitude > 0
    curve, remarks = swept_response(data, float(amplitude) if known else 1.0, "N" if known else "1", band)
    remarks += (
        () if known else ("the amplitude of the drive is not one number: the modal constant contains it.",)
    )
    unit = "1" if attrs.get("units_system") == "nondimensional" else "m N-1" if known else "m"
    title = "Amplitude of displacement against the forcing frequency"
    dataset = _shown_response(console, ResponseEstimates(fit_resonance(curve), None, title, unit, remarks))
    return dataset.assign_attrs(source_file=data.name)


def _shown_response(console: Terminal, found: Any) -> xr.Dataset:
    from vibroimpact.analysis.decay.tables import print_estimates, print_remarks

    print_estimates(console, found.title, found.estimates())
    print_remarks(console, found.words())
    dataset: xr.Dataset = found.dataset()
    return dataset


def _channel(recording: Recording, name: str | None) -> Any:
    """Return the named channel; in a simulated run the displacement needs no name."""
    if name is None and "displacement" in recording.channels:
        name = "displacement"
    return recording.channel(name)


def _sourced(dataset: xr.Dataset, data: Path, recording: Recording) -> xr.Dataset:
    known = {
        key: recording.attrs[key]
        for key in ("source_sha256", "scene")
        if recording.attrs.get(key) is not None
    }
    return dataset.assign_attrs(source_file=data.name, **known)


def _written(console: Terminal, dataset: xr.Dataset, output: Path | None, figure: Path | None) -> None:
    """Write what was asked for, and say so."""
    from vibroimpact.analysis.dataset.outputs import writing
    from vibroimpact.analysis.dataset.results import write_results

    for path, what in ((output, "Estimates"), (figure, "Figure")):
        if path is None:
            continue
        with writing(path):
            if path is output:
                write_results(dataset, path, kind="estimates")
            else:
                # matplotlib takes half a second to import; estimates alone do not pay for it.
                from vibroimpact.analysis.figures import save
                from vibroimpact.analysis.figures.estimates import draw_estimates

                save(draw_estimates(dataset), path)
        console.print(f"{what} written to {path}.")

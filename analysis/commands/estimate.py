"""What `vibroimpact estimate` does: estimate, print, write and draw."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import xarray as xr

from vibroimpact.analysis.commands.estimate_scene import (
    ImpactOptions,
    cut,
    force_amplitude,
    forcing_and_known,
    side_of_stop,
)
from vibroimpact.analysis.dataset.outputs import refuse_outputs, refuse_overwriting, writing
from vibroimpact.analysis.dataset.reading import read_flat
from vibroimpact.analysis.dataset.results import write_results
from vibroimpact.analysis.dataset.schema import scene_of
from vibroimpact.analysis.decay.estimate import print_estimates, print_remarks
from vibroimpact.analysis.decay.free_decay import estimate_decay, print_decay
from vibroimpact.analysis.decay.frequency_response import frequency_response
from vibroimpact.analysis.decay.laws import ALL_LAWS, damping_law
from vibroimpact.analysis.decay.resonance import ResponseEstimates, curve_of, fit_resonance, resolution_remark
from vibroimpact.analysis.decay.samples import decay_samples
from vibroimpact.analysis.decay.swept_response import swept_response
from vibroimpact.analysis.estimation.estimates import print_impacts
from vibroimpact.analysis.estimation.flight_times import estimate_bounces
from vibroimpact.analysis.estimation.impacts import estimate_impacts
from vibroimpact.analysis.recording import Channel, Recording, is_recording, open_signals
from vibroimpact.fmus.errors import EstimationError, UsageError
from vibroimpact.fmus.terminal import Terminal, wide_terminal


@dataclass(frozen=True, slots=True)
class Estimation:
    """What every estimation is asked for: the options that all of them have, the window in s."""

    data: Path
    channel: str | None
    start: float | None
    stop: float | None
    run: int | None
    output: Path | None
    figure: Path | None
    force: bool


def decay_of(asked: Estimation, law: str, cubic: bool, periods: float | None) -> None:
    """Estimate a free decay: with all damping laws, none, or one."""
    with _estimating(asked) as console:
        laws = () if law == "none" else ALL_LAWS if law == "all" else (damping_law(law),)
        recording = open_signals(asked.data, asked.run)
        samples = decay_samples(_channel(recording, asked.channel), asked.start, asked.stop)
        found = estimate_decay(samples, laws, cubic=cubic, periods=periods)
        print_decay(console, found)
    _write(console, _sourced(found.dataset(), asked.data, recording), asked)


def impacts_of(asked: Estimation, options: ImpactOptions) -> None:
    """Estimate motion against a stop, with or without a force that oscillates."""
    with _estimating(asked) as console:
        recording = open_signals(asked.data, asked.run)
        channel = _channel(recording, asked.channel)
        forcing, known = forcing_and_known(asked.data, asked.run, recording, channel, options)
        part = cut(channel, asked.start, asked.stop)
        found = (
            estimate_bounces(part, side=known.side)
            if forcing is None
            else estimate_impacts(part, forcing, known)
        )
        print_impacts(console, found)
    dataset = found.dataset().assign_attrs(estimates="impacts")
    _write(console, _sourced(dataset, asked.data, recording), asked)


def bounces_of(asked: Estimation, side: str | None) -> None:
    """Estimate the restitution of a body that bounces under a constant force."""
    if side not in (None, "upper", "lower"):
        raise UsageError(f'--side: expected upper or lower, got "{side}".')
    with _estimating(asked) as console:
        recording = open_signals(asked.data, asked.run)
        channel = _channel(recording, asked.channel)
        seen = side or side_of_stop(asked.data, asked.run, recording, channel)
        found = estimate_bounces(cut(channel, asked.start, asked.stop), side=seen)
        print_impacts(console, found)
    dataset = found.dataset().assign_attrs(estimates="bounces")
    _write(console, _sourced(dataset, asked.data, recording), asked)


def response_of(
    asked: Estimation,
    drive: str | None,
    form: str,
    band: tuple[float, float] | None,
    segment: int | None,
    window: str,
    estimator: str,
) -> None:
    """Estimate a resonance from two channels, or from a simulated sweep of the frequency."""
    if estimator not in ("h1", "h2"):
        raise UsageError(f'--estimator: expected h1 or h2, got "{estimator}".')
    with _estimating(asked) as console:
        if drive is None and is_recording(asked.data):
            raise UsageError("--drive: expected the channel that drives, got none. Name it.")
        if drive is None:
            dataset = _swept(console, asked.data, band)
        else:
            recording = open_signals(asked.data, asked.run)
            others = [name for name in recording.channels if name != drive]
            answer = recording.channel(asked.channel or (others[0] if len(others) == 1 else None))
            found = frequency_response(
                recording.channel(drive),
                answer,
                segment=segment,
                window=window,
                start=asked.start,
                stop=asked.stop,
            )
            resonance = fit_resonance(curve_of(found, form, band, estimator))
            title = f"Response of {answer.name} to {drive}"
            remarks = (*recording.remarks_counted, *found.remarks, *resolution_remark(found, resonance))
            estimates = ResponseEstimates(resonance, found, title, found.unit, remarks)
            dataset = _sourced(_shown_response(console, estimates), asked.data, recording)
    _write(console, dataset, asked)


@contextmanager
def _estimating(asked: Estimation) -> Iterator[Terminal]:
    """Refuse files that cannot be written, and begin the message of what has no answer with the name of its data."""
    refuse_outputs([asked.data], asked.output, asked.figure)
    same = ("estimates", asked.data.name)
    refuse_overwriting(
        asked.output, asked.force, lambda there: (there.get("results_kind"), there.get("source_file")) == same
    )
    try:
        yield wide_terminal()
    except EstimationError as problem:
        raise EstimationError(f"{asked.data}: {problem}") from problem


def _swept(console: Terminal, data: Path, band: tuple[float, float] | None) -> xr.Dataset:
    attrs = read_flat(data).attrs
    amplitude = force_amplitude(scene_of(attrs))
    known = amplitude is not None and amplitude > 0.0
    curve, remarks = swept_response(data, amplitude or 1.0 if known else 1.0, "N" if known else "1", band)
    remarks += (
        () if known else ("the amplitude of the drive is not one number: the modal constant contains it.",)
    )
    unit = "1" if attrs.get("units_system") == "nondimensional" else "m N-1" if known else "m"
    title = "Amplitude of displacement against the forcing frequency"
    dataset = _shown_response(console, ResponseEstimates(fit_resonance(curve), None, title, unit, remarks))
    return dataset.assign_attrs(source_file=data.name)


def _shown_response(console: Terminal, found: ResponseEstimates) -> xr.Dataset:
    console.print(found.resonance.verdict, soft_wrap=True)
    print_estimates(console, found.title, found.estimates())
    print_remarks(console, found.words())
    return found.dataset()


def _channel(recording: Recording, name: str | None) -> Channel:
    """Return the named channel; in a simulated run the displacement needs no name."""
    if name is None and "displacement" in recording.channels:
        name = "displacement"
    return recording.channel(name)


def _sourced(dataset: xr.Dataset, data: Path, recording: Recording) -> xr.Dataset:
    known = {key: recording.attrs.get(key) for key in ("source_sha256", "scene")}
    known = {key: value for key, value in known.items() if value is not None}
    return dataset.assign_attrs(source_file=data.name, **known)


def _write(console: Terminal, dataset: xr.Dataset, asked: Estimation) -> None:
    """Write what was asked for, and say so."""
    if asked.output is not None:
        with writing(asked.output):
            write_results(dataset, asked.output, kind="estimates")
        console.print(f"Estimates written to {asked.output}.")
    if asked.figure is not None:
        with writing(asked.figure):
            # matplotlib takes half a second to import; estimates alone do not pay for it.
            from vibroimpact.analysis.figures import save
            from vibroimpact.analysis.figures.measured.estimates import draw_estimates

            save(draw_estimates(dataset), asked.figure)
        console.print(f"Figure written to {asked.figure}.")

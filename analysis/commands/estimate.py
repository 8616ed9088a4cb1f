"""The command `vibroimpact estimate`: estimate, print, write and draw."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import xarray as xr

from vibroimpact.analysis.commands.estimate_scene import (
    cut,
    force_amplitude,
    forcing_and_known,
    refuse_numbers,
    side_of_stop,
)
from vibroimpact.analysis.dataset.outputs import refuse_places, writing
from vibroimpact.analysis.dataset.results import write_results
from vibroimpact.analysis.dataset.schema import scene_of
from vibroimpact.analysis.dataset.stores.runs import read_runs
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
from vibroimpact.analysis.operations.estimate_bounces import EstimateBounces
from vibroimpact.analysis.operations.estimate_decay import EstimateDecay
from vibroimpact.analysis.operations.estimate_impacts import EstimateImpacts
from vibroimpact.analysis.operations.estimate_response import EstimateResponse
from vibroimpact.analysis.recording import Channel, Recording, is_recording, open_signals
from vibroimpact.fmus.errors import EstimationError, UsageError
from vibroimpact.fmus.messages import Spelling, spelled, typed
from vibroimpact.fmus.terminal import Terminal, wide_terminal

Estimation = EstimateDecay | EstimateImpacts | EstimateBounces | EstimateResponse
"""Estimations; all have the fields data, channel, window, run, and output places."""


def decay_of(options: EstimateDecay, spelling: Spelling = typed) -> None:
    """Estimate a free decay: with all damping laws, none, or one."""
    law = options.law
    with _estimating(options, spelling) as console:
        laws = () if law == "none" else ALL_LAWS if law == "all" else (damping_law(law),)
        recording = open_signals(options.data, options.run)
        samples = decay_samples(_channel(recording, options.channel), options.start, options.stop_time)
        found = estimate_decay(samples, laws, cubic=options.cubic, periods=options.periods)
        print_decay(console, found)
    _write(console, _sourced(found.dataset(), options.data, recording), options)


def impacts_of(options: EstimateImpacts, spelling: Spelling = typed) -> None:
    """Estimate motion against a stop, with or without a force that oscillates."""
    refuse_numbers(options)
    with _estimating(options, spelling) as console:
        recording = open_signals(options.data, options.run)
        channel = _channel(recording, options.channel)
        forcing, known = forcing_and_known(options, recording, channel)
        part = cut(channel, options.start, options.stop_time)
        found = (
            estimate_bounces(part, side=known.side)
            if forcing is None
            else estimate_impacts(part, forcing, known)
        )
        print_impacts(console, found)
    _write(console, _sourced(found.dataset(), options.data, recording), options)


def bounces_of(options: EstimateBounces, spelling: Spelling = typed) -> None:
    """Estimate the restitution of a body that bounces under a constant force."""
    side = options.side
    if side not in (None, "upper", "lower"):
        raise UsageError(f'--side: expected upper or lower, got "{side}".')
    with _estimating(options, spelling) as console:
        recording = open_signals(options.data, options.run)
        channel = _channel(recording, options.channel)
        seen = side or side_of_stop(options.data, options.run, recording, channel)
        found = estimate_bounces(cut(channel, options.start, options.stop_time), side=seen)
        print_impacts(console, found)
    _write(console, _sourced(found.dataset(), options.data, recording), options)


def response_of(options: EstimateResponse, spelling: Spelling = typed) -> None:
    """Estimate a resonance from two channels, or from a simulated sweep of the frequency."""
    drive, band, estimator = options.drive, options.band, options.estimator
    if estimator not in ("h1", "h2"):
        raise UsageError(f'--estimator: expected h1 or h2, got "{estimator}".')
    with _estimating(options, spelling) as console:
        if drive is None and is_recording(options.data):
            raise UsageError("--drive: expected the channel that drives, got none. Name it.")
        if drive is None:
            dataset = _swept(console, options.data, band)
        else:
            recording = open_signals(options.data, options.run)
            others = [name for name in recording.channels if name != drive]
            answer = recording.channel(options.channel or (others[0] if len(others) == 1 else None))
            found = frequency_response(
                recording.channel(drive),
                answer,
                segment=options.segment,
                window=options.window,
                start=options.start,
                stop=options.stop_time,
            )
            resonance = fit_resonance(curve_of(found, options.form, band, estimator))
            title = f"Response of {answer.name} to {drive}"
            remarks = (*recording.remarks_counted, *found.remarks, *resolution_remark(found, resonance))
            estimates = ResponseEstimates(resonance, found, title, found.unit, remarks)
            dataset = _sourced(_shown_response(console, estimates), options.data, recording)
    _write(console, dataset, options)


@contextmanager
def _estimating(options: Estimation, spelling: Spelling) -> Iterator[Terminal]:
    """Refuse files that cannot be written; errors of an estimation begin with the name of its data."""
    refuse_places(options, [options.data], results_kind="estimates", source_file=options.data.name)
    try:
        yield wide_terminal(spelling)
    except EstimationError as problem:
        raise problem.named(options.data) from problem


def _swept(console: Terminal, data: Path, band: tuple[float, float] | None) -> xr.Dataset:
    attrs = read_runs(data).attrs
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


def _write(console: Terminal, dataset: xr.Dataset, options: Estimation) -> None:
    """Write the dataset and the figure that the options name, and report each."""
    dataset = dataset.assign_attrs(spelled(dataset.attrs, console.spelling))
    if options.output is not None:
        with writing(options.output):
            write_results(dataset, options.output)
        console.print(f"Estimates written to {options.output}.")
    if options.figure is not None:
        with writing(options.figure):
            # matplotlib takes half a second to import; estimates alone do not pay for it.
            from vibroimpact.analysis.figures import save
            from vibroimpact.analysis.figures.measured.estimates import draw_estimates

            save(draw_estimates(dataset), options.figure)
        console.print(f"Figure written to {options.figure}.")

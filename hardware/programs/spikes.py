"""Record the pulses of a load cell, and no samples between them."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from vibroimpact.analysis.recording import Recording
from vibroimpact.fmus.errors import UsageError
from vibroimpact.hardware.operations.rig_spikes import RecordSpikes
from vibroimpact.hardware.programs.measuring import Describe, Request, measure_into, measured, request_of
from vibroimpact.hardware.rig.acquisition import Facts
from vibroimpact.hardware.rig.measurement import Measurement, PulseRule, measurement_of
from vibroimpact.hardware.rig.opening import Rig

MOST_AROUND = 10**6
"""Most samples before or after a pulse."""


def record_spikes(
    rig: str | Rig | None,
    channels: Sequence[str],
    rate: float,
    threshold: float,
    duration: float | None = None,
    *,
    on: str = "",
    hysteresis: float = 0.5,
    presamples: int = 64,
    postsamples: int = 64,
    dead_time: float = 0.0,
    pulses: int | None = None,
    calibration: Sequence[str | os.PathLike[str]] = (),
    journal: str | os.PathLike[str] | None = None,
) -> Recording:
    """Record the pulses of a channel with the samples around them; samples between them are not kept.

    Parameters
    ----------
    rig, channels, rate, duration, calibration, journal
        As in `record`.
    threshold : float
        In the unit of the channel; negative for pulses below it.
    on : str
        Channel with the pulses; empty: the first. The other channels are kept during its pulses.
    hysteresis : float
        Part of the threshold, below which a pulse is over.
    presamples, postsamples : int
        Samples kept before and after a pulse.
    dead_time : float
        s from the start of a pulse, in which a new crossing of the threshold belongs to it.
    pulses : int or None
        Number of pulses after which it ends.

    Returns
    -------
    Recording
        With the event train `pulses`: instants, and first estimates of peaks and impulses.

    Raises
    ------
    UsageError, RigError
        As in `record`; also if there is no pulse.
    """
    request = request_of(channels, (), calibration, rate, duration)
    options = RecordSpikes(
        output=Path(),  # only the journal is written
        channel=list(channels),
        rate=rate,
        duration=duration,
        threshold=threshold,
        on=on,
        hysteresis=hysteresis,
        presamples=presamples,
        postsamples=postsamples,
        dead_time=dead_time,
        pulses=pulses,
    )
    return measured(rig, request, _describer(request, options), most_pulses=pulses, journal=journal)


def record_pulses(options: RecordSpikes) -> None:
    """Record pulses into a file."""
    request = request_of(options.channel, (), options.calibration or (), options.rate, options.duration)
    describe = _describer(request, options)
    measure_into(options, request, describe, in_pieces=True, most_pulses=options.pulses)


def _describer(request: Request, options: RecordSpikes) -> Describe:
    _refuse_wrong(options, [each.name for each in request.inputs])

    def describe(rig: Rig, facts: Facts) -> Measurement:
        rule = PulseRule(
            channel=options.on or request.inputs[0].name,
            threshold=options.threshold,
            hysteresis=options.hysteresis,
            before=options.presamples,
            after=options.postsamples,
            dead=round(options.dead_time * facts.rate),
        )
        return measurement_of("spikes", rig, facts, request.inputs, request.calibrations, pulses=rule)

    return describe


def _refuse_wrong(options: RecordSpikes, names: Sequence[str]) -> None:
    """Raise UsageError, with all problems at once, if options of pulses are wrong for channels of these names."""
    dead = options.dead_time * options.rate
    rules = (
        ("--threshold", "a finite number, not 0", options.threshold, 0.0 < abs(options.threshold) < np.inf),
        ("--on", f"one of {', '.join(names)}", options.on, options.on in ("", *names)),
        ("--hysteresis", "a part > 0 and <= 1", options.hysteresis, 0.0 < options.hysteresis <= 1.0),
        ("--presamples", _sample_range(), options.presamples, 0 <= options.presamples <= MOST_AROUND),
        ("--postsamples", _sample_range(), options.postsamples, 0 <= options.postsamples <= MOST_AROUND),
        ("--dead-time", f"0 to {MOST_AROUND:g} samples in s", options.dead_time, 0.0 <= dead <= MOST_AROUND),
        ("--pulses", "1 or more", options.pulses, options.pulses is None or options.pulses >= 1),
    )
    problems = [f"{name}: expected {rule}, got {got}." for name, rule, got, holds in rules if not holds]
    if problems:
        raise UsageError("\n".join(problems))


def _sample_range() -> str:
    return f"0 to {MOST_AROUND:g} samples"

"""Record the pulses of a load cell, and nothing between them."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vibroimpact.analysis.recording import Recording
from vibroimpact.fmus.errors import UsageError
from vibroimpact.hardware.programs.measuring import Describe, Wanted, measure_into, measured, wanted_of
from vibroimpact.hardware.rig.acquisition import Facts
from vibroimpact.hardware.rig.measurement import Measurement, PulseRule, measurement_of
from vibroimpact.hardware.rig.opening import Rig

MOST_BESIDE = 10**6
"""Samples before or after a pulse, at most."""


@dataclass(frozen=True, slots=True)
class PulseOptions:
    """What a pulse is, and what is kept of it.

    Attributes
    ----------
    threshold : float
        In the unit of the channel; negative: pulses below it.
    on : str
        The channel; empty: the first.
    hysteresis : float
        Part of the threshold below which a pulse is over.
    presamples, postsamples : int
        Samples of before and after a pulse.
    dead_time : float
        s from its start within which another passage of the threshold belongs to it.
    most : int or None
        Pulses after which it ends.
    """

    threshold: float
    on: str = ""
    hysteresis: float = 0.5
    presamples: int = 64
    postsamples: int = 64
    dead_time: float = 0.0
    most: int | None = None

    def refuse(self, wanted: Wanted) -> None:
        """Refuse what cannot be meant, all of it at once.

        Raises
        ------
        UsageError
        """
        names = [each.name for each in wanted.inputs]
        dead = self.dead_time * wanted.rate
        rules = (
            ("--threshold", "a finite number, not 0", self.threshold, 0.0 < abs(self.threshold) < np.inf),
            ("--on", f"one of {', '.join(names)}", self.on, self.on in ("", *names)),
            ("--hysteresis", "a part > 0 and <= 1", self.hysteresis, 0.0 < self.hysteresis <= 1.0),
            ("--presamples", _beside(), self.presamples, 0 <= self.presamples <= MOST_BESIDE),
            ("--postsamples", _beside(), self.postsamples, 0 <= self.postsamples <= MOST_BESIDE),
            ("--dead-time", f"0 to {MOST_BESIDE:g} samples in s", self.dead_time, 0.0 <= dead <= MOST_BESIDE),
            ("--pulses", "1 or more", self.most, self.most is None or self.most >= 1),
        )
        problems = [f"{name}: expected {rule}, got {got}." for name, rule, got, holds in rules if not holds]
        if problems:
            raise UsageError("\n".join(problems))


def _beside() -> str:
    return f"0 to {MOST_BESIDE:g} samples"


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
    """Record the pulses of a channel with the samples around them; what is between them is not kept.

    Parameters
    ----------
    rig, channels, rate, duration, calibration, journal
        As of `record`.
    threshold : float
        In the unit of the channel; negative: pulses below it.
    on : str
        Channel that has the pulses; empty: the first. The others are kept while it has one.
    hysteresis : float
        Part of the threshold below which a pulse is over.
    presamples, postsamples : int
        Samples that are kept of before and after a pulse.
    dead_time : float
        s from the start of a pulse within which another passage of the threshold belongs to it.
    pulses : int or None
        Pulses after which it ends.

    Returns
    -------
    Recording
        With the event train `pulses`: instants, peaks and impulses at a first look.

    Raises
    ------
    UsageError, RigError
        As of `record`; also where there is no pulse.
    """
    wanted = wanted_of(channels, (), calibration, rate, duration)
    options = PulseOptions(threshold, on, hysteresis, presamples, postsamples, dead_time, pulses)
    return measured(rig, wanted, _describer(wanted, options), most_pulses=pulses, journal=journal)


def record_pulses(
    rig: str | None,
    channels: Sequence[str],
    rate: float,
    duration: float | None,
    options: PulseOptions,
    output: Path,
    calibration: Sequence[Path],
    force: bool,
) -> None:
    """Record pulses into a file."""
    wanted = wanted_of(channels, (), calibration, rate, duration)
    describe = _describer(wanted, options)
    measure_into(output, force, rig, wanted, describe, in_pieces=True, most_pulses=options.most)


def _describer(wanted: Wanted, options: PulseOptions) -> Describe:
    options.refuse(wanted)

    def describe(rig: Rig, facts: Facts) -> Measurement:
        rule = PulseRule(
            channel=options.on or wanted.inputs[0].name,
            threshold=options.threshold,
            hysteresis=options.hysteresis,
            before=options.presamples,
            after=options.postsamples,
            dead=round(options.dead_time * facts.rate),
        )
        return measurement_of("spikes", rig, facts, wanted.inputs, wanted.calibrations, pulses=rule)

    return describe

"""Shared parts of measuring programs: the checked request, the opened rig, the recording at the end."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vibroimpact.analysis.dataset.outputs import refuse_outputs, refuse_overwriting
from vibroimpact.analysis.recording import Recording
from vibroimpact.fmus.errors import RigError, UsageError, VibroimpactError
from vibroimpact.hardware import daqmx
from vibroimpact.hardware.operations.rig_record import Record
from vibroimpact.hardware.operations.rig_spikes import RecordSpikes
from vibroimpact.hardware.programs.keeping import Store, keep_all, recording_in, write_and_show
from vibroimpact.hardware.programs.pulses import PulseFinder
from vibroimpact.hardware.rig.acquisition import Acquisition, Facts
from vibroimpact.hardware.rig.calibration import Calibration, read_calibrations
from vibroimpact.hardware.rig.inputs import Input, inputs_of
from vibroimpact.hardware.rig.journal import ENDING, Journal, refuse_full_disk, refuse_journal
from vibroimpact.hardware.rig.live import shown_live
from vibroimpact.hardware.rig.measurement import FEWEST_SAMPLES, Measurement
from vibroimpact.hardware.rig.opening import Rig, opened_rig, refusal_of
from vibroimpact.hardware.rig.stopping import stopped_by_signals

UNKNOWN_DURATION = 60.0
"""Time, s, for which a disk must have room if a measurement has no duration."""


@dataclass(frozen=True, slots=True)
class Request:
    """The request: inputs, rate and duration."""

    inputs: tuple[Input, ...]
    loopbacks: frozenset[str]
    """Names of inputs that an output is wired to."""
    calibrations: dict[str, Calibration]
    rate: float
    """Hz."""
    duration: float | None
    """s; None: until it is stopped."""

    @property
    def count(self) -> int | None:
        """Samples of each input."""
        return None if self.duration is None else round(self.rate * self.duration)


def request_of(
    channels: Sequence[str],
    loopbacks: Sequence[str],
    calibrations: Sequence[str | os.PathLike[str]],
    rate: float,
    duration: float | None,
) -> Request:
    """Return the requested measurement; UsageError, before anything is opened, if the request is invalid."""
    inputs = inputs_of([*channels, *loopbacks])
    if not inputs:
        raise UsageError(
            "--channel: expected an input or more, got none. For example --channel tip=Dev1/ai0,5."
        )
    if not (np.isfinite(rate) and rate > 0.0):
        raise UsageError(f"--rate: expected samples per second > 0, got {rate:g}.")
    count = np.inf if duration is None else rate * duration
    if duration is not None and not (np.isfinite(count) and round(count) >= FEWEST_SAMPLES):
        raise UsageError(
            f"--rate, --duration: expected {FEWEST_SAMPLES} samples or more, got {rate:g} Hz for {duration:g} s."
        )
    back = frozenset(each.name for each in inputs[len(channels) :])
    return Request(
        tuple(inputs), back, read_calibrations([Path(each) for each in calibrations], inputs), rate, duration
    )


Describe = Callable[[Rig, Facts], Measurement]


def measured(
    rig: str | Rig | None,
    request: Request,
    describe: Describe,
    *,
    most_pulses: int | None = None,
    journal: str | os.PathLike[str] | None = None,
    live: bool = False,
) -> Recording:
    """Measure, and return the recording; its attribute `ended` is the reason if it is shorter than requested.

    The rig is a text for `--rig`, an open rig, or (None) the board of this machine. `describe` returns the
    measurement, once the device has given its actual inputs and rate. A measurement of pulses ends after
    `most_pulses`. All samples go to `journal` meanwhile (None: to memory). The journal stays there: the owner of the
    recording removes it. UsageError, RigError: the rig refuses the request, or fails before there are samples.
    """
    with ExitStack() as stack:
        opened = rig if isinstance(rig, Rig) else stack.enter_context(opened_rig(rig))
        try:
            acquired = stack.enter_context(
                Acquisition(opened, request.inputs, request.rate, count=request.count)
            )
            measurement = describe(opened, acquired.facts)
            _refuse_many(measurement, request)
            header = measurement.model_dump(mode="json")
            file = None if journal is None else stack.enter_context(Journal(Path(journal), header))
            stack.enter_context(stopped_by_signals(acquired.stop))
            return _kept(acquired, measurement, Store(header, file), request, most_pulses, live)
        except (daqmx.DaqError, daqmx.RpcError) as error:
            raise refusal_of(opened.name, error) from None


def _kept(
    acquired: Acquisition,
    measurement: Measurement,
    store: Store,
    request: Request,
    most_pulses: int | None,
    live: bool,
) -> Recording:
    finder = None if measurement.pulses is None else PulseFinder(measurement, most_pulses)
    most = None if finder is None and request.count is not None else measurement.most_samples
    with shown_live(acquired, measurement.inputs, request.duration, live) as progress:
        failure = keep_all(acquired, store, progress, finder, most)
    if failure is not None and not store.kept:
        raise failure
    if finder is not None and not finder.starts:
        raise RigError(finder.none_found)
    return recording_in(store.content(), measurement.rig)


def _refuse_many(measurement: Measurement, request: Request) -> None:
    if measurement.pulses is None and (request.count or 0) > measurement.most_samples:
        raise UsageError(
            f"--rate, --duration: expected at most {measurement.most_samples} samples of each of "
            f"{len(measurement.inputs)} inputs, as a recording takes, got {request.count}."
        )


def measure_into(
    options: Record | RecordSpikes,
    request: Request,
    describe: Describe,
    *,
    in_pieces: bool = False,
    most_pulses: int | None = None,
) -> None:
    """Measure into a file, with a journal beside it; the journal is removed once the file is complete.

    If only pieces are kept (`in_pieces`), their number is unknown: the disk must have room for a minute of samples.
    UsageError before the measurement: the file, its disk, or the measurement is not available. UsageError after it:
    the file could not be written, and the journal is still there. RigError: the measurement ended early, and its
    samples are in the file.
    """
    output = options.output
    refuse_outputs((), output, None)
    refuse_overwriting(output, options.force, lambda there: False)
    journal = output.with_suffix(ENDING)
    refuse_journal(journal)
    seconds = UNKNOWN_DURATION if request.duration is None else request.duration
    if in_pieces:
        seconds = min(seconds, UNKNOWN_DURATION)
    refuse_full_disk(output.parent, 8.0 * len(request.inputs) * request.rate * seconds)
    recording = measured(options.rig, request, describe, most_pulses=most_pulses, journal=journal, live=True)
    with stopped_by_signals(lambda: None):
        try:
            write_and_show(recording, output)
        except VibroimpactError as error:
            raise UsageError(
                f"{error}\nAll that was measured is in {journal}: vibroimpact rig recover {journal} -o FILE.nc"
            ) from None
        journal.unlink()
    if recording.attrs.get("ended"):
        raise RigError(f"{recording.attrs['rig']}: ended early: {recording.attrs['ended']}")

"""A measurement, as in the header of its journal, and its recording."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from vibroimpact.analysis.recording import Channel, Quality, Recording, TimeAxis
from vibroimpact.analysis.recording.files import MOST_VALUES
from vibroimpact.fmus.errors import DatasetError, RigError
from vibroimpact.hardware.rig.acquisition import Block, Facts, Gap
from vibroimpact.hardware.rig.calibration import Calibration
from vibroimpact.hardware.rig.inputs import Input
from vibroimpact.hardware.rig.opening import Rig
from vibroimpact.hardware.rig.quiet import quiet_remark

Floats = NDArray[np.float64]
Flags = NDArray[np.uint8]

_FROZEN = ConfigDict(extra="forbid", frozen=True)
FEWEST_SAMPLES = 2
"""Fewest samples of a recording."""
MOST_FILLED, FILLED_ANYHOW = 10, 1_000_000
"""Rows per kept sample, plus a constant, up to which lost samples are rows of NaN; above, only gaps' ends are."""


class MeasuredInput(BaseModel):
    """An input of a measurement: its request, and range and step (V) of its converter."""

    model_config = _FROZEN

    name: str = Field(pattern=r"^[a-z][a-z0-9_]{0,99}$")
    terminal: str
    highest: FiniteFloat
    low: FiniteFloat
    high: FiniteFloat
    step: FiniteFloat = Field(gt=0.0)
    role: Literal["measured", "loopback"] = "measured"
    calibration: Calibration | None = None


class PulseRule(BaseModel):
    """Rule for keeping samples, for a measurement of pulses alone.

    Attributes
    ----------
    channel : str
    threshold : float
        In the unit of the channel; negative for pulses below it.
    hysteresis : float
        Part of the threshold, below which a pulse is over.
    before, after : int
        Samples kept before and after a pulse.
    dead : int
        Samples after its start, in which a new crossing of the threshold belongs to the same pulse.
    """

    model_config = _FROZEN

    channel: str
    threshold: FiniteFloat
    hysteresis: FiniteFloat = Field(gt=0.0, le=1.0)
    before: int = Field(ge=0)
    after: int = Field(ge=0)
    dead: int = Field(ge=0)


class Measurement(BaseModel):
    """A measurement on a rig.

    Attributes
    ----------
    program : {"record", "spikes"}
    rig, device, product : str
    rate, skew : float
        As in `Facts`.
    inputs : tuple of MeasuredInput
    pulses : PulseRule or None
        None: all samples are kept.
    """

    model_config = _FROZEN

    program: Literal["record", "spikes"]
    rig: str
    device: str
    product: str
    rate: FiniteFloat = Field(gt=0.0)
    skew: FiniteFloat = Field(ge=0.0)
    inputs: tuple[MeasuredInput, ...] = Field(min_length=1)
    pulses: PulseRule | None = None

    @property
    def source(self) -> str:
        """Device and product, as text."""
        return f"{self.device}, {self.product}"

    @property
    def most_samples(self) -> int:
        """Most samples of each input in a recording's file: values, flags of an eighth of their size, instants."""
        inputs = len(self.inputs)
        return int(MOST_VALUES / (1.125 * inputs + (inputs if self.skew else 1)))

    def place_of(self, name: str) -> int:
        """Return the index of a channel among the inputs."""
        return [each.name for each in self.inputs].index(name)


def measurement_of(
    program: Literal["record", "spikes"],
    rig: Rig,
    facts: Facts,
    inputs: Sequence[Input],
    calibrations: Mapping[str, Calibration],
    loopbacks: Iterable[str] = (),
    pulses: PulseRule | None = None,
) -> Measurement:
    """Return the description of a measurement that is about to begin."""
    back = set(loopbacks)
    measured = tuple(
        MeasuredInput(
            name=each.name,
            terminal=each.terminal,
            highest=each.highest,
            low=low,
            high=high,
            step=step,
            role="loopback" if each.name in back else "measured",
            calibration=calibrations.get(each.name),
        )
        for each, (low, high, step) in zip(inputs, facts.steps, strict=True)
    )
    return Measurement(
        program=program,
        rig=rig.name,
        device=facts.device,
        product=facts.product,
        rate=facts.rate,
        skew=facts.skew,
        inputs=measured,
        pulses=pulses,
    )


def measurement_in(header: Mapping[str, Any], source: str) -> Measurement:
    """Return the measurement in the header of a journal.

    Raises
    ------
    DatasetError
        The header describes no measurement.
    """
    try:
        return Measurement.model_validate_json(json.dumps(dict(header)))
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"])) or "header"
        raise DatasetError(
            f"{source}: {where}: expected the header of a journal of this version, got another: {first['msg']}."
        ) from None


def recording_of(
    measurement: Measurement,
    blocks: Sequence[Block],
    gaps: Sequence[Gap],
    started_at: str,
    remarks: Iterable[str] = (),
) -> Recording:
    """Return the recording of kept samples.

    Parameters
    ----------
    measurement : Measurement
    blocks : sequence of Block
        In order.
    gaps : sequence of Gap
        Lost samples; other missing samples were not requested.
    started_at : str
        UTC.
    remarks : iterable of str
        Further remarks for the reader.

    Raises
    ------
    RigError
        There are fewer than two samples.
    """
    count = sum(block.volts.shape[1] for block in blocks)
    if count < FEWEST_SAMPLES:
        raise RigError(
            f"{measurement.rig}: expected {FEWEST_SAMPLES} samples or more, got {count}. Nothing is written."
        )
    end = max(blocks[-1].end, *(gap.end for gap in gaps), 0)
    few = end <= min(measurement.most_samples, MOST_FILLED * count + FILLED_ANYHOW)
    filled = measurement.pulses is None and few
    numbers = np.arange(end) if filled else rows_of(blocks, gaps)
    volts = np.full((len(measurement.inputs), len(numbers)), np.nan)
    for block in blocks:
        place = int(np.searchsorted(numbers, block.first))
        volts[:, place : place + block.volts.shape[1]] = block.volts
    channels = _channels(measurement, numbers, volts, started_at)
    quiet = [] if measurement.pulses is not None else _quiet(measurement, volts)
    all_remarks = [*_clipped(channels), *quiet, *_lost(measurement, gaps, filled), *remarks]
    return Recording(channels, attrs=_attributes(measurement, gaps, started_at, all_remarks))


def rows_of(blocks: Sequence[Block], gaps: Sequence[Gap]) -> NDArray[np.int64]:
    """Return the numbers of the available samples, and of the first and the last sample of each gap."""
    ends = [np.array([gap.first, gap.end - 1]) for gap in gaps if gap.samples]
    rows = [np.arange(block.first, block.end) for block in blocks]
    return np.unique(np.concatenate([*rows, *ends])).astype(np.int64)


def _channels(
    measurement: Measurement, numbers: NDArray[np.int64], volts: Floats, started_at: str
) -> dict[str, Channel]:
    whole = len(numbers) == 1 + int(numbers[-1] - numbers[0])
    pieces = "" if whole else ", in pieces"
    channels: dict[str, Channel] = {}
    axis: TimeAxis | None = None
    for place, each in enumerate(measurement.inputs):
        if axis is None or measurement.skew:
            axis = TimeAxis(
                numbers / measurement.rate + place * measurement.skew,
                1.0 / measurement.rate if whole else None,
                source=f"sample clock of {measurement.source}, {measurement.rate:.10g} Hz{pieces}",
                trigger=started_at,
            )
        notes = {"role": each.role, "terminal": each.terminal, "range": each.highest}
        quality, values, unit = quality_of(each, volts[place]), volts[place], "V"
        if each.calibration is not None:
            values, unit = each.calibration.to_units(values, axis.time), each.calibration.cf_unit
            notes |= each.calibration.attributes()
        channels[each.name] = Channel(each.name, values, unit, axis, quality, each.terminal, notes)
    return channels


def quality_of(measured: MeasuredInput, volts: Floats) -> Flags:
    """Return the flags of samples: clipped at the first and the last step of the converter, missing for NaN."""
    clipped = clips(measured, volts)
    flags: Flags = np.where(clipped, np.uint8(Quality.clipped), np.uint8(0))
    flags[np.isnan(volts)] = np.uint8(Quality.missing)
    return flags


def clips(measured: MeasuredInput, volts: Floats) -> NDArray[np.bool_]:
    """Return a mask of the samples at an end of the range."""
    found: NDArray[np.bool_] = (volts <= measured.low + 0.5 * measured.step) | (
        volts >= measured.high - 1.5 * measured.step
    )
    return found


def _clipped(channels: Mapping[str, Channel]) -> list[str]:
    counts = {
        name: int((channel.quality & np.uint8(Quality.clipped) > 0).sum())
        for name, channel in channels.items()
    }
    return [f"{name}: {_samples(count)} clipped" for name, count in counts.items() if count]


def _quiet(measurement: Measurement, volts: Floats) -> list[str]:
    """Return a remark for each channel without a signal above its noise."""
    lines = (
        quiet_remark(each.name, row, each.step, each.role == "loopback")
        for each, row in zip(measurement.inputs, volts, strict=True)
    )
    return [line for line in lines if line]


def _samples(count: int) -> str:
    return "1 sample is" if count == 1 else f"{count} samples are"


def _lost(measurement: Measurement, gaps: Sequence[Gap], filled: bool) -> list[str]:
    """Return a remark for each reason of lost samples."""
    lines = []
    for reason in dict.fromkeys(gap.reason for gap in gaps):
        some = [gap for gap in gaps if gap.reason == reason]
        longest = max(some, key=lambda gap: gap.samples)
        many = "1 gap" if len(some) == 1 else f"{len(some)} gaps, the longest"
        doubt = max(gap.doubt for gap in some)
        known = (
            f"lengths by the clock of the computer, within {1e3 * doubt:.0f} ms each" if doubt else "exact"
        )
        lines.append(
            f"{_samples(sum(gap.samples for gap in some))} missing ({reason}) in {many} of "
            f"{longest.samples / measurement.rate:.6g} s at {longest.first / measurement.rate:.6g} s, {known}: "
            + ("they are there as NaN" if filled else "NaN stands at their ends")
        )
    return lines


def _attributes(
    measurement: Measurement, gaps: Sequence[Gap], started_at: str, remarks: Sequence[str]
) -> dict[str, Any]:
    attrs: dict[str, Any] = {
        "source_file": f"{measurement.rig} ({measurement.source})",
        "source_format": "NI-DAQmx",
        "rig": measurement.rig,
        "device": measurement.source,
        "recorded_at": started_at,
        "sample_rate": measurement.rate,
        "remarks": "\n".join(remarks),
    }
    if gaps:
        attrs["gaps"] = json.dumps([asdict(gap) for gap in gaps])
    if measurement.pulses is not None:
        attrs["pulse_rule"] = measurement.pulses.model_dump_json()
    return attrs

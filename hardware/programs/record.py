"""Record inputs of a rig."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.outputs import refuse_outputs, refuse_overwriting, writing
from vibroimpact.analysis.recording import Channel, Quality, Recording, TimeAxis, write_recording
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.terminal import say
from vibroimpact.hardware import daqmx
from vibroimpact.hardware.rig.inputs import Input, inputs_of
from vibroimpact.hardware.rig.opening import Rig, opened_rig

MOST_VALUES = 10**8
BLOCK = 2**18
"""Values of one read, of all channels."""


def record_channels(
    choice: str | None, channels: Sequence[str], rate: float, duration: float, output: Path, force: bool
) -> None:
    """Record inputs of a rig."""
    wanted, count = inputs_of(channels), rate * duration
    if not (np.isfinite(count) and rate > 0.0 and 2 <= count <= MOST_VALUES / len(wanted)):
        raise UsageError(
            f"--rate, --duration: expected 2 samples or more, {MOST_VALUES:g} at most in all, got {rate:g} Hz for "
            f"{duration:g} s."
        )
    refuse_outputs((), output, None)
    refuse_overwriting(output, force, lambda there: False)
    with opened_rig(choice) as rig:
        recording = _recorded(rig, wanted, rate, round(count))
    with writing(output):
        write_recording(recording, output)
    for remark in recording.remarks:
        say(remark)
    say(f"Recording written to {output}.")


def _recorded(rig: Rig, wanted: Sequence[Input], rate: float, count: int) -> Recording:
    constants = daqmx.constants
    with daqmx.nidaqmx.Task(grpc_options=rig.options()) as task:
        for each in wanted:
            task.ai_channels.add_ai_voltage_chan(
                each.terminal, each.name, min_val=-each.highest, max_val=each.highest
            )
        task.timing.cfg_samp_clk_timing(
            rate, sample_mode=constants.AcquisitionType.CONTINUOUS, samps_per_chan=max(2, round(rate))
        )
        block = max(2, min(BLOCK // len(wanted), round(rate)))
        began = datetime.now(UTC)
        task.start()
        values = _samples(task, len(wanted), count, block)
        task.stop()
        device = task.devices[0]
        at_once = device.ai_simultaneous_sampling_supported
        late = 0.0 if at_once else 1.0 / task.timing.ai_conv_rate
        true_rate = task.timing.samp_clk_rate
        steps = [
            (c.ai_rng_low, c.ai_rng_high, (c.ai_rng_high - c.ai_rng_low) / 2.0**c.ai_resolution)
            for c in task.ai_channels
        ]
        product = device.product_type
        attrs = {"rig": rig.name, "device": f"{device.name}, {product}", "recorded_at": began.isoformat()}
    found, remarks = {}, []
    for place, each in enumerate(wanted):
        axis = TimeAxis(
            np.arange(count) / true_rate + place * late,
            1.0 / true_rate,
            source=f"sample clock of {attrs['device']}",
            trigger=str(attrs["recorded_at"]),
        )
        quality = _quality(values[place], *steps[place])
        if quality.any():
            remarks.append(f"{each.name}: {int((quality > 0).sum())} samples are clipped")
        notes = {"role": "measured", "terminal": each.terminal, "range": each.highest}
        found[each.name] = Channel(each.name, values[place], "V", axis, quality, each.terminal, notes)
    return Recording(
        found,
        attrs={
            "source_file": f"{rig.name} ({attrs['device']})",
            "source_format": "NI-DAQmx",
            **attrs,
            "remarks": "\n".join(remarks),
        },
    )


def _samples(task: Any, channels: int, count: int, block: int) -> NDArray[np.float64]:
    """Read so many samples of each channel, block by block."""
    values = np.empty((channels, count))
    for begin in range(0, count, block):
        size = min(block, count - begin)
        values[:, begin : begin + size] = np.reshape(task.read(size, timeout=60.0), (channels, size))
    return values


def _quality(values: NDArray[np.float64], low: float, high: float, step: float) -> NDArray[np.uint8]:
    """Return the flags of samples: clipped at the first and the last step of the converter."""
    clipped = (values <= low + 0.5 * step) | (values >= high - 1.5 * step)
    flags: NDArray[np.uint8] = np.where(clipped, np.uint8(Quality.clipped), np.uint8(0))
    return flags

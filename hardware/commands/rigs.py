"""What `vibroimpact rig` does: serve a virtual rig, list devices, record channels."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.outputs import refuse_outputs, refuse_overwriting, writing
from vibroimpact.analysis.recording import Channel, Quality, Recording, TimeAxis, write_recording
from vibroimpact.fmus.errors import RigError, UsageError
from vibroimpact.fmus.terminal import say
from vibroimpact.hardware import daqmx
from vibroimpact.hardware.recordings.naming import channel_name
from vibroimpact.hardware.virtual_rig.serving import served
from vibroimpact.hardware.virtual_rig.settings import read_rig

THREE_WAYS = (
    "--rig virtual:RIG.toml starts a virtual rig, --rig grpc://host:port uses one that is served or NI's gRPC device "
    "server, --rig local uses the board of this machine, whose driver is NI-DAQmx"
)
ASKED_WRONGLY = (
    daqmx.DAQmxErrors.INVALID_DEVICE_ID,
    daqmx.DAQmxErrors.PHYSICAL_CHAN_DOES_NOT_EXIST,
    daqmx.DAQmxErrors.INVALID_ATTRIBUTE_VALUE,
    daqmx.DAQmxErrors.CHAN_ALREADY_IN_TASK,
)
"""What a rig says of a device, a channel, a range or a rate that it does not have, and of a channel given twice."""
MOST_CHANNELS = 8
MOST_VALUES = 10**8
BLOCK = 2**18
"""Values of one read, of all channels."""


@dataclass(frozen=True, slots=True)
class Rig:
    """A rig that is open.

    Attributes
    ----------
    name : str
        As `--rig` says it.
    channel : grpc.Channel or None
        None: the driver of this machine.
    """

    name: str
    channel: Any

    def options(self) -> Any:
        """Return what a task of NI's client needs to be made on this rig."""
        if self.channel is None:
            return None
        return daqmx.nidaqmx.GrpcSessionOptions(self.channel, "")

    def system(self) -> Any:
        """Return the system of NI's client."""
        options = self.options()
        return daqmx.System.local() if options is None else daqmx.System.remote(options)


@contextmanager
def opened_rig(choice: str | None) -> Iterator[Rig]:
    """Open a rig for as long as the block lasts; what its client refuses becomes one error.

    Raises
    ------
    UsageError
        There is no such rig, no driver, or what is asked for is not there.
    RigError
        The rig refuses another call.
    """
    try:
        with _connected(choice) as rig:
            yield rig
    except daqmx.DaqNotFoundError:
        raise UsageError(
            f"rig: expected the driver NI-DAQmx on this machine, got none. {THREE_WAYS}."
        ) from None
    except daqmx.RpcError as error:
        raise RigError(f"{choice}: expected a rig that answers, got none: {_one_line(error)}.") from None
    except daqmx.DaqError as error:
        kind = UsageError if error.error_code in ASKED_WRONGLY else RigError
        raise kind(f"{choice or 'local'}: {_one_line(error)}") from None


@contextmanager
def _connected(choice: str | None) -> Iterator[Rig]:
    kind, _, rest = (choice or "local").partition(":")
    if choice in (None, "local"):
        yield Rig("local", None)
    elif kind == "virtual" and rest:
        with served(read_rig(Path(rest))) as server, daqmx.open_channel(server.address) as channel:
            yield Rig(f"virtual:{Path(rest).name}", channel)
    elif kind == "grpc" and rest.startswith("//") and rest[2:].rpartition(":")[2].isdigit():
        with daqmx.open_channel(rest[2:]) as channel:
            yield Rig(str(choice), channel)
    else:
        raise UsageError(f"--rig: expected a rig, got {str(choice)[:60]!r}. {THREE_WAYS}.")


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split()).rstrip(".")


def serve_rig(file: Path, port: int, speed: float | None, lockstep: bool) -> None:
    """Serve a virtual rig until Ctrl-C."""
    settings = read_rig(file)
    if speed is not None and not 0.0 < speed <= 1000.0:
        raise UsageError(f"--speed: expected a number > 0 and <= 1000, got {speed:g}.")
    with served(settings, port) as server:
        server.board.set_pace(lockstep=lockstep, speed=speed)
        pace = "in lockstep" if lockstep else f"{server.board.speed:g} s of the rig in a second"
        say(
            f"{settings.rig.name}, {server.board.profile.product}, at grpc://{server.address}, {pace}. Ctrl-C ends it."
        )
        server.wait()


def list_devices(choice: str | None) -> None:
    """Print the devices of a rig."""
    with opened_rig(choice) as rig:
        found = list(rig.system().devices)
        for device in found:
            inputs, outputs = device.ai_physical_chans.channel_names, device.ao_physical_chans.channel_names
            say(f"{device.name}  {device.product_type}  on {rig.name}")
            if inputs:
                at_once = (
                    "all at once" if device.ai_simultaneous_sampling_supported else "one after the other"
                )
                say(f"  inputs {_span(inputs)}, {device.ai_max_multi_chan_rate:g} samples/s, {at_once}")
                say(f"  ranges {_ranges(device.ai_voltage_rngs)}")
            if outputs:
                say(
                    f"  outputs {_span(outputs)}, {device.ao_max_rate:g} samples/s, {_ranges(device.ao_voltage_rngs)}"
                )
        if not found:
            say(f"{rig.name} has no devices.", err=True)


def _span(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{names[0]} to {names[-1]}"


def _ranges(edges: Sequence[float]) -> str:
    return ", ".join(f"{low:g} to {high:g} V" for low, high in zip(edges[::2], edges[1::2], strict=True))


@dataclass(frozen=True, slots=True)
class _Wanted:
    name: str
    terminal: str
    highest: float


def _wanted(texts: Sequence[str]) -> list[_Wanted]:
    found: list[_Wanted] = []
    for text in texts:
        name, _, rest = text.partition("=")
        terminal, _, highest = rest.partition(",")
        try:
            limit = float(highest) if highest else 5.0
        except ValueError:
            limit = 0.0
        good = name == channel_name(name, {each.name for each in found}) and 0.0 < limit < np.inf
        if not good or not terminal.strip():
            raise UsageError(
                f"--channel: expected NAME=TERMINAL[,RANGE], a new name of letters, got {text[:60]!r}. "
                "For example tip=Dev1/ai0,5."
            )
        found.append(_Wanted(name, terminal.strip(), limit))
    if len(found) > MOST_CHANNELS:
        raise UsageError(f"--channel: expected at most {MOST_CHANNELS}, got {len(found)}.")
    return found


def record_channels(
    choice: str | None, channels: Sequence[str], rate: float, duration: float, output: Path, force: bool
) -> None:
    """Record inputs of a rig."""
    wanted, count = _wanted(channels), rate * duration
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


def _recorded(rig: Rig, wanted: Sequence[_Wanted], rate: float, count: int) -> Recording:
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

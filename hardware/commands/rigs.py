"""The commands `vibroimpact rig serve` and `vibroimpact rig devices`."""

from __future__ import annotations

from collections.abc import Sequence

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.terminal import say
from vibroimpact.hardware.operations.rig_devices import ListDevices
from vibroimpact.hardware.operations.rig_serve import ServeRig
from vibroimpact.hardware.rig.opening import opened_rig
from vibroimpact.hardware.virtual_rig.serving import served
from vibroimpact.hardware.virtual_rig.settings import read_rig


def serve_rig(options: ServeRig) -> None:
    """Serve a virtual rig until Ctrl-C."""
    settings, speed = read_rig(options.file), options.speed
    if speed is not None and not 0.0 < speed <= 1000.0:
        raise UsageError(f"--speed: expected a number > 0 and <= 1000, got {speed:g}.")
    with served(settings, options.port) as server:
        server.board.set_pace(lockstep=options.lockstep, speed=speed)
        pace = "in lockstep" if options.lockstep else f"{server.board.pace.speed:g} s of the rig in a second"
        say(
            f"{settings.rig.name}, {server.board.profile.product}, at grpc://{server.address}, {pace}. Ctrl-C ends it."
        )
        server.wait()


def list_devices(options: ListDevices) -> None:
    """Print the devices of a rig."""
    with opened_rig(options.rig) as rig:
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

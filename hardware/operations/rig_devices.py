"""Operation `rig devices`: the devices of a rig, their channels and ranges."""

from __future__ import annotations

from vibroimpact.fmus.operations import Operation, operation
from vibroimpact.hardware.operations.arguments import RigChoice


@operation("hardware.commands.rigs:list_devices")
class ListDevices(Operation):
    """List the devices of a rig with their channels and ranges.

    Example: vibroimpact rig devices --rig virtual:examples/rig/oscillator.toml
    """

    rig: RigChoice = None

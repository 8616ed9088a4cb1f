"""The rig of a program: the board of this machine, a served rig, or a virtual one of its own."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vibroimpact.fmus.errors import RigError, UsageError, VibroimpactError
from vibroimpact.hardware import daqmx
from vibroimpact.hardware.virtual_rig.serving import served
from vibroimpact.hardware.virtual_rig.settings import read_rig

THREE_WAYS = (
    "--rig virtual:RIG.toml starts a virtual rig, --rig grpc://host:port uses one that is served or NI's gRPC device "
    "server, --rig local uses the board of this machine, whose driver is NI-DAQmx"
)
USAGE_ERRORS = (
    daqmx.DAQmxErrors.INVALID_DEVICE_ID,
    daqmx.DAQmxErrors.PHYSICAL_CHAN_DOES_NOT_EXIST,
    daqmx.DAQmxErrors.INVALID_ATTRIBUTE_VALUE,
    daqmx.DAQmxErrors.CHAN_ALREADY_IN_TASK,
)
"""Errors of a rig for a missing device, channel, range or rate, and for a channel given twice."""


HELD = (
    ". A program that died leaves its task on the device: end the program that holds it, or reset the device "
    "(nidaqmx.system.Device.reset_device, NI MAX)"
)
"""Hint for an input or output that another task holds."""


@dataclass(frozen=True, slots=True)
class Rig:
    """An open rig.

    Attributes
    ----------
    name : str
        As in `--rig`.
    channel : grpc.Channel or None
        None: the driver of this machine.
    address : str
        `host:port` of its server, for other processes; empty: the driver of this machine.
    """

    name: str
    channel: Any
    address: str = ""

    def options(self, session: str = "") -> Any:
        """Return the options for a task of NI's client on this rig; another program can attach to a named session."""
        if self.channel is None:
            return None
        return daqmx.nidaqmx.GrpcSessionOptions(self.channel, session)

    def system(self) -> Any:
        """Return the system of NI's client."""
        options = self.options()
        return daqmx.System.local() if options is None else daqmx.System.remote(options)


@contextmanager
def opened_rig(choice: str | None) -> Iterator[Rig]:
    """Open a rig for the duration of the block; a refusal of its client becomes one error.

    Raises
    ------
    UsageError
        There is no such rig, no driver, or the requested part does not exist.
    RigError
        The rig refuses another call.
    """
    try:
        with _connected(choice) as rig:
            yield rig
    except (daqmx.DaqNotFoundError, daqmx.RpcError, daqmx.DaqError) as error:
        raise refusal_of(choice, error) from None


def refusal_of(choice: str | None, error: Exception) -> VibroimpactError:
    """Return the error for a refusal of a rig, in one line."""
    if isinstance(error, VibroimpactError):
        return error
    if isinstance(error, daqmx.DaqNotFoundError):
        return UsageError(f"rig: expected the driver NI-DAQmx on this machine, got none. {THREE_WAYS}.")
    if isinstance(error, daqmx.DaqError):
        kind = UsageError if error.error_code in USAGE_ERRORS else RigError
        held = error.error_code == daqmx.DAQmxErrors.PAL_RESOURCE_RESERVED
        return kind(f"{choice or 'local'}: {_one_line(error)}{HELD if held else ''}")
    return RigError(f"{choice}: expected a rig that answers, got none: {_one_line(error)}.")


@contextmanager
def _connected(choice: str | None) -> Iterator[Rig]:
    kind, _, rest = (choice or "local").partition(":")
    if choice in (None, "local"):
        yield Rig("local", None)
    elif kind == "virtual" and rest:
        with served(read_rig(Path(rest))) as server, daqmx.open_channel(server.address) as channel:
            yield Rig(f"virtual:{Path(rest).name}", channel, server.address)
    elif kind == "grpc" and rest.startswith("//") and rest[2:].rpartition(":")[2].isdigit():
        with daqmx.open_channel(rest[2:]) as channel:
            yield Rig(str(choice), channel, rest[2:])
    else:
        raise UsageError(f"--rig: expected a rig, got {str(choice)[:60]!r}. {THREE_WAYS}.")


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split()).rstrip(".")

"""The task of the inputs on a server, which outlives a program that was killed.

A server keeps a task, and with it the inputs, until it is cleared. The task of an acquisition therefore has a name, by
which the next program finds it. If nobody reads from it any more, its program is dead, and it is cleared.
"""

from __future__ import annotations

import time
from typing import Any

from vibroimpact.fmus.errors import RigError
from vibroimpact.hardware import daqmx
from vibroimpact.hardware.rig.opening import Rig

LOOK_SECONDS = 2.0
"""Time, s, in which a living program reads from its task."""
_LOOKS = 20


def input_task(rig: Rig, device: str) -> Any:
    """Return a new task for inputs of a device; RigError if another program is reading them."""
    if rig.channel is None:  # the driver frees the tasks of a dead program
        return daqmx.nidaqmx.Task()
    name = f"vibroimpact-inputs-{device}"
    try:
        return _task(rig, name, "INITIALIZE_SERVER_SESSION")
    except daqmx.DaqError as error:
        if error.error_code != daqmx.DAQmxErrors.DUPLICATE_TASK:
            raise
    left = _task(rig, name, "ATTACH_TO_SERVER_SESSION")
    if _is_read(left):
        raise RigError(
            f"{rig.name}: expected inputs that are free, got those of {device}, which are being read."
        )
    left.close()
    return _task(rig, name, "INITIALIZE_SERVER_SESSION")


def _task(rig: Rig, name: str, behaviour: str) -> Any:
    kinds = daqmx.nidaqmx.grpc_session_options.SessionInitializationBehavior
    options = daqmx.nidaqmx.GrpcSessionOptions(
        rig.channel, name, initialization_behavior=getattr(kinds, behaviour)
    )
    return daqmx.nidaqmx.Task(name, grpc_options=options)


def _is_read(task: Any) -> bool:
    """Whether a program reads from a task; waiting inputs are armed just before their trigger comes."""
    try:
        position = task.in_stream.curr_read_pos
        for _ in range(_LOOKS):
            time.sleep(LOOK_SECONDS / _LOOKS)
            if task.in_stream.curr_read_pos != position:
                return True
        return False
    except daqmx.DaqError:  # it has failed meanwhile, as a task without a reader does
        return False

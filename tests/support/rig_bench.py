"""A client of NI on a virtual rig that is served in this process."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from vibroimpact.hardware.daqmx import DaqError, constants, nidaqmx, open_channel
from vibroimpact.hardware.virtual_rig.control import RigControl
from vibroimpact.hardware.virtual_rig.serving import RigServer, served
from vibroimpact.hardware.virtual_rig.settings import read_rig

CONTINUOUS = constants.AcquisitionType.CONTINUOUS
BITS_16 = 10.0 / 2**15


class Bench:
    """A client on a rig."""

    def __init__(self, server: RigServer, channel: Any) -> None:
        self.server, self.channel = server, channel
        self.control = RigControl(channel)

    def options(self, name: str = "", **others: Any) -> Any:
        return nidaqmx.GrpcSessionOptions(self.channel, name, **others)

    def task(self, name: str = "") -> Any:
        return nidaqmx.Task(name, grpc_options=self.options(name))

    def inputs(self, terminals: str = "Dev1/ai0", rate: float | None = None, **timing: Any) -> Any:
        task = self.task()
        task.ai_channels.add_ai_voltage_chan(terminals, min_val=-10, max_val=10)
        if rate is not None:
            task.timing.cfg_samp_clk_timing(rate, **timing)
        return task

    def outputs(self, terminals: str = "Dev1/ao0", rate: float | None = None, **timing: Any) -> Any:
        task = self.task()
        task.ao_channels.add_ao_voltage_chan(terminals, min_val=-10, max_val=10)
        if rate is not None:
            task.timing.cfg_samp_clk_timing(rate, **timing)
        return task

    def wait_until(self, holds: Callable[[], bool]) -> None:
        """Wait until something holds; a rig that goes on by itself gets there."""
        end = time.monotonic() + 10.0
        while not holds():
            assert time.monotonic() < end
            time.sleep(0.01)

    def clear(self) -> None:
        """Forget all tasks; outputs go to 0."""
        for task in list(self.server.board.tasks.values()):
            self.server.board.remove(task)
        self.server.board.analog.held[:] = 0.0


@contextmanager
def opened_bench(file: Path, *, lockstep: bool = True) -> Iterator[Bench]:
    """Serve a rig file for as long as the block lasts."""
    with served(read_rig(file)) as server, open_channel(server.address) as channel:
        bench = Bench(server, channel)
        bench.control.pace(lockstep=lockstep)
        yield bench


def refused(code: int) -> Any:
    """Expect an error of NI's."""
    return pytest.raises(DaqError, match=rf"Status Code: {code}\b")

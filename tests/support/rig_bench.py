"""A client of NI on a virtual rig that this process serves."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from vibroimpact.hardware.daqmx import DaqError, System, constants, nidaqmx, open_channel
from vibroimpact.hardware.rig.opening import Rig, opened_rig
from vibroimpact.hardware.virtual_rig.control import RigControl
from vibroimpact.hardware.virtual_rig.serving import RigServer, served
from vibroimpact.hardware.virtual_rig.settings import read_rig

CONTINUOUS = constants.AcquisitionType.CONTINUOUS
BITS_16 = 10.0 / 2**15


class Bench:
    """A client on a virtual rig.

    Attributes
    ----------
    device : str
        The tests name it `Dev1`; `named` gives its own name.
    loop : str
        An input wired to the first output.
    tolerance : float
        Largest difference between a voltage and its reading, V.
    """

    device, loop, tolerance = "Dev1", "Dev1/ai2", BITS_16

    def __init__(self, server: RigServer, channel: Any) -> None:
        self.server, self.channel, self.address = server, channel, server.address
        self._control = RigControl(channel)

    @property
    def control(self) -> RigControl:
        """The control service."""
        return self._control

    def named(self, text: str) -> str:
        """Return channels and terminals with the device's own name."""
        return text.replace("Dev1", self.device)

    def options(self, name: str = "", **others: Any) -> Any:
        return nidaqmx.GrpcSessionOptions(self.channel, name, **others)

    def system(self) -> Any:
        return System.remote(self.options())

    def task(self, name: str = "") -> Any:
        return nidaqmx.Task(name, grpc_options=self.options(name))

    def inputs(self, terminals: str = "Dev1/ai0", rate: float | None = None, **timing: Any) -> Any:
        task = self.task()
        task.ai_channels.add_ai_voltage_chan(self.named(terminals), min_val=-10, max_val=10)
        return self._timed(task, rate, timing)

    def outputs(self, terminals: str = "Dev1/ao0", rate: float | None = None, **timing: Any) -> Any:
        task = self.task()
        task.ao_channels.add_ao_voltage_chan(self.named(terminals), min_val=-10, max_val=10)
        return self._timed(task, rate, timing)

    def _timed(self, task: Any, rate: float | None, timing: dict[str, Any]) -> Any:
        if rate is not None:
            task.timing.cfg_samp_clk_timing(
                rate, **(timing | {"source": self.named(timing.get("source", ""))})
            )
        return task

    def as_it_waits(self) -> None:
        """Let time advance only while a call waits for it."""
        self.control.pace(lockstep=True)

    def as_in_life(self) -> None:
        """Let time advance by itself."""
        self.control.pace(lockstep=False)

    def pass_time(self, seconds: float) -> None:
        """Let time advance while the program does nothing."""
        self.control.advance(seconds)

    def output(self, number: int) -> float:
        """Return the current voltage of an output."""
        return float(self.control.truth()["outputs"][number])

    def wait_until(self, holds: Callable[[], bool]) -> None:
        """Wait until a condition holds; a rig whose time advances by itself gets there."""
        end = time.monotonic() + 10.0
        while not holds():
            assert time.monotonic() < end
            time.sleep(0.01)

    def clear(self) -> None:
        """Remove all tasks; outputs go to 0."""
        for task in list(self.server.board.tasks.values()):
            self.server.board.remove(task)
        self.server.board.analog.held[:] = 0.0


class RealBench(Bench):
    """A client on a board: tests that need the plant or the control service are skipped."""

    tolerance = 0.02  # noise and calibration

    def __init__(self, rig: Rig, device: str) -> None:
        self._rig, self.device, self.channel, self._address = rig, device, rig.channel, rig.address
        self.loop = f"{device}/_ao0_vs_aognd"

    @property
    def control(self) -> RigControl:
        """Skip the test: a board has no control service."""
        pytest.skip("needs the control service of a virtual rig")

    @property
    def address(self) -> str:  # type: ignore[override]
        """Return the address of the server; skip the test without a server."""
        return self._address or pytest.skip("needs a rig behind gRPC")

    def options(self, name: str = "", **others: Any) -> Any:
        """Return the options of a task; None stands for the driver of this machine."""
        return super().options(name, **others) if self.channel is not None else None

    def system(self) -> Any:
        """Return the system of NI's client."""
        return self._rig.system()

    def as_it_waits(self) -> None:
        """Do nothing: a board does not wait."""

    def as_in_life(self) -> None:
        """Do nothing: a board always runs in real time."""

    def pass_time(self, seconds: float) -> None:
        """Wait for a shorter time: the test only has to see that nothing happens."""
        time.sleep(min(seconds, 0.05))

    def output(self, number: int) -> float:
        """Return the voltage of an output, measured inside the device."""
        with self.inputs(f"Dev1/_ao{number}_vs_aognd") as task:
            return float(task.read())

    def clear(self) -> None:
        """Set the first output to 0."""
        with self.outputs() as task:
            task.write(0.0)


@contextmanager
def opened_real_bench(choice: str) -> Iterator[Bench]:
    """Open `Dev1`, the board of this machine, or `grpc://host:port/Dev1`, for the duration of the block."""
    address, _, device = choice.rpartition("/")
    with opened_rig(address or "local") as rig:
        yield RealBench(rig, device)


@contextmanager
def opened_bench(file: Path, *, lockstep: bool = True) -> Iterator[Bench]:
    """Serve a rig file for the duration of the block."""
    with served(read_rig(file)) as server, open_channel(server.address) as channel:
        bench = Bench(server, channel)
        bench.control.pace(lockstep=lockstep)
        yield bench


def refused(code: int) -> Any:
    """Expect an error with a code of NI's."""
    return pytest.raises(DaqError, match=rf"Status Code: {code}\b")

"""An observer of an output: an input that is wired to the output and starts with it."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import TracebackType

import numpy as np
import psutil
from harness import warm
from numpy.typing import NDArray

from support.command_line import ENTRY
from support.rig_bench import Bench
from vibroimpact.hardware.rig.acquisition import Acquisition
from vibroimpact.hardware.rig.inputs import Input
from vibroimpact.hardware.rig.opening import Rig
from vibroimpact.hardware.virtual_rig.control import RigControl

LOOP = Input("loop", "Dev1/ai2", 10.0)
"""Input that is wired to Dev1/ao0 in examples/rig/oscillator.toml."""
STEP = 20.0 / 2**16
"""Resolution of an output and of an input, V: rounding changes a jump by up to two of them."""


class Observer:
    """Records the output, from a trigger or at once, until its block ends.

    Attributes
    ----------
    began : float
        Time of the rig at the start, s; with a trigger, when it was armed.
    volts : ndarray of float, shape (sample,)
        Voltages, once the observer has ended.
    """

    began: float
    volts: NDArray[np.float64]

    def __init__(self, rig: Rig, rate: float, trigger: str = "") -> None:
        self._control = RigControl(rig.channel)
        self._acquired = Acquisition(rig, [LOOP], rate, trigger=trigger)
        self._blocks: list[NDArray[np.float64]] = []
        self._rate = rate
        self._thread = threading.Thread(target=self._collect)

    def _collect(self) -> None:
        self._blocks += [block.volts[0] for block in self._acquired.blocks()]

    def __enter__(self) -> Observer:
        self._acquired.__enter__()
        self.began = float(self._control.state()["time"])
        self._acquired.start()
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._acquired.stop()
        self._thread.join()
        self._acquired.__exit__(kind, error, trace)
        assert self._acquired.gaps == []
        self.volts = np.concatenate([np.empty(0), *self._blocks])

    @property
    def steepest(self) -> float:
        """Largest slope of the output, V/s, without the share of rounding."""
        return float((np.abs(np.diff(self.volts)).max() - 2.0 * STEP) * self._rate)


SINE = ("--output", "Dev1/ao0", "--frequency", "5.3", "--amplitude", "2", "--ramp", "0.2")
RATE = 10_000.0
STEEPEST = 2.0 * (2.0 * np.pi * 5.3 + 0.5 * np.pi / 0.05)
"""Largest slope of that sine with its ramps plus the fall from 2 V in 50 ms, V/s: far below the default limit."""
SECONDS = 30.0
"""Longest wait for an immediate event, s, on a machine with other work."""


class Driven:
    """The program `vibroimpact rig sine` on a rig served by this process, its guardian, and an observer.

    Attributes
    ----------
    program : subprocess.Popen or warm.Copy
    guardian : psutil.Process
    seen : Observer
    """

    def __init__(self, bench: Bench, seen: Observer, program: warm.Program) -> None:
        self.bench, self.seen, self.program = bench, seen, program
        assert program.stdout is not None
        self.said = program.stdout.readline()
        assert "Ctrl-C brings it to rest" in self.said, program.communicate()
        (self.guardian,) = psutil.Process(program.pid).children()

    def now(self) -> float:
        """Return the time of the rig, s."""
        return float(self.bench.control.state()["time"])

    def drive(self, seconds: float) -> float:
        """Let the program drive for `seconds` of the rig's time; return the time of the rig then, s."""
        end = self.now() + seconds
        while (now := self.now()) < end:
            time.sleep(0.002)
        return now

    def ended(self) -> tuple[int, str, str]:
        """Wait until program and guardian have ended; return exit code, output and error output."""
        out, err = self.program.communicate(timeout=SECONDS)
        self.guardian.wait(SECONDS)
        return self.program.returncode, out, err

    def problem_at_rest(self) -> str | None:
        """Return the problem of the end state: the output, or remaining tasks."""
        truth, tasks = self.bench.control.truth(), self.bench.control.state()["tasks"]
        if truth["outputs"][0] != 0.0:
            return f"the output is at {truth['outputs'][0]} V"
        if [name for name in tasks if name.startswith("vibroimpact-output")]:
            return f"tasks remain: {tasks}"
        return None

    def at_zero_after(self, since: float) -> float:
        """Return the time of the rig from an instant to the last sample away from 0, s."""
        moving = np.flatnonzero(np.abs(self.seen.volts) > 1.5 * STEP)
        return self.seen.began + moving[-1] / RATE - since if moving.size else 0.0


@contextmanager
def driven(bench: Bench, *more: str) -> Iterator[Driven]:
    """Start the program; end it and its guardian at the end of the block."""
    rig = Rig("bench", bench.channel, bench.server.address)
    where = f"grpc://{bench.server.address}"
    program = warm.start(ENTRY, "rig", "sine", "--rig", where, *SINE, *more)
    guardian: psutil.Process | None = None
    try:
        with Observer(rig, RATE) as seen:
            running = Driven(bench, seen, program)
            guardian = running.guardian
            yield running
    finally:
        program.kill()
        program.communicate()
        if guardian is not None and guardian.is_running():
            guardian.kill()

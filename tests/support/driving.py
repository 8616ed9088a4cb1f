"""An observer of an output: an input that is wired to it, started with it."""

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
"""Wired to Dev1/ao0 in examples/rig/oscillator.toml."""
STEP = 20.0 / 2**16
"""V, of an output and of an input: what rounding adds to a jump, twice."""


class Observer:
    """Records what is put out, from a trigger or at once until it is left.

    Attributes
    ----------
    began : float
        Time of the rig when it started, s; with a trigger, when it was armed.
    volts : ndarray of float, shape (sample,)
        When it has ended.
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
        """The largest jump, V/s, without what rounding adds."""
        return float((np.abs(np.diff(self.volts)).max() - 2.0 * STEP) * self._rate)


SINE = ("--output", "Dev1/ao0", "--frequency", "5.3", "--amplitude", "2", "--ramp", "0.2")
RATE = 10_000.0
STEEPEST = 2.0 * (2.0 * np.pi * 5.3 + 0.5 * np.pi / 0.05)
"""Of that sine with its ramps, and of the fall from 2 V in 50 ms, V/s: far below the default limit."""
SECONDS = 30.0
"""For what should happen at once, on a machine that does other things too."""


class Driven:
    """The program `vibroimpact rig sine` on a rig that is served here, its guardian, and an observer.

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
        """Let the program drive for a time of the rig; return what that is then."""
        end = self.now() + seconds
        while (now := self.now()) < end:
            time.sleep(0.002)
        return now

    def ended(self) -> tuple[int, str, str]:
        """Wait until program and guardian have ended; return exit code and what they said."""
        out, err = self.program.communicate(timeout=SECONDS)
        self.guardian.wait(SECONDS)
        return self.program.returncode, out, err

    def problem_at_rest(self) -> str | None:
        """Return what is wrong with the end: the output, or tasks that remain."""
        truth, tasks = self.bench.control.truth(), self.bench.control.state()["tasks"]
        if truth["outputs"][0] != 0.0:
            return f"the output is at {truth['outputs'][0]} V"
        if [name for name in tasks if name.startswith("vibroimpact-output")]:
            return f"tasks remain: {tasks}"
        return None

    def at_zero_after(self, since: float) -> float:
        """Return the time of the rig from an instant to the last sample that was not 0, s."""
        moving = np.flatnonzero(np.abs(self.seen.volts) > 1.5 * STEP)
        return self.seen.began + moving[-1] / RATE - since if moving.size else 0.0


@contextmanager
def driven(bench: Bench, *more: str) -> Iterator[Driven]:
    """Let the program drive; what is left of it at the end of the block is ended."""
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

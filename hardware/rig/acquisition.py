"""Acquire inputs without an end: one thread reads, and a bounded queue keeps the samples for the program.

No sample is lost silently. If the program takes too slowly, the queue is full and blocks are left out, by exactly
known numbers of samples. If the thread itself reads too late, the device has overwritten samples and its task is over.
The task is then started anew, and the clock of the computer gives the length of the gap. An acquisition on a trigger
is not started anew, since its trigger does not come again: it ends with the samples so far.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.errors import RigError, UsageError
from vibroimpact.hardware import daqmx
from vibroimpact.hardware.rig.inputs import Input
from vibroimpact.hardware.rig.lateness import Lateness
from vibroimpact.hardware.rig.opening import Rig
from vibroimpact.hardware.rig.sessions import input_task

Floats = NDArray[np.float64]

SHORTEST_BLOCK, LONGEST_BLOCK = 0.05, 1.0
"""Duration of the samples of one read, s; only a rig faster than real time, or a slow program, has long blocks."""
BLOCK_VALUES = 2**18
"""Most values of one read, of all inputs: 2 MiB."""
BUFFER_SECONDS, BUFFER_VALUES = 10.0, 2**24
"""Size of the device's buffer for a late thread: seconds, and most values of all inputs."""
QUEUE_BLOCKS = 64
READ_TIMEOUT = 0.5
"""Time of a read, s, after which it returns with the available samples, so that the stop flag is seen."""
SILENCE = 60.0
"""Time of a call, s, after which the rig counts as dead."""
_END_SECONDS = 5.0


@dataclass(frozen=True, slots=True)
class Block:
    """Samples of one read.

    Attributes
    ----------
    first : int
        Number of the first sample on the clock of the device; samples are lost if it is not the end of the previous
        block.
    volts : ndarray of float, shape (channel, sample)
    """

    first: int
    volts: Floats

    @property
    def end(self) -> int:
        """Number of the sample after the last."""
        return self.first + int(self.volts.shape[1])


@dataclass(frozen=True, slots=True)
class Gap:
    """Lost samples.

    Attributes
    ----------
    first, samples : int
    doubt : float
        Possible error of the length, s; 0: it is exact.
    reason : str
    """

    first: int
    samples: int
    doubt: float
    reason: str

    @property
    def end(self) -> int:
        """Number of the first sample after it."""
        return self.first + self.samples


@dataclass(frozen=True, slots=True)
class Facts:
    """The device's data on an acquisition.

    Attributes
    ----------
    rate : float
        Actual rate of the device, Hz.
    skew : float
        Time from the sample of an input to the sample of the next input, s.
    device, product : str
    steps : tuple of (float, float, float)
        Ends of the range and step of the converter of each input, V.
    started_at : str
        UTC; for an acquisition on a trigger, the start of the wait. Empty before.
    """

    rate: float
    skew: float
    device: str
    product: str
    steps: tuple[tuple[float, float, float], ...]
    started_at: str = ""


class Acquisition:
    """Inputs of a rig that are sampled together; a context manager.

    Parameters
    ----------
    rig : Rig
    inputs : sequence of Input
    rate : float
        Hz.
    count : int or None
        Samples of each input; None: until it is stopped.
    trigger : str
        Terminal that starts it, such as `/Dev1/ao/StartTrigger`; empty: immediate start.

    Attributes
    ----------
    rig : Rig
    facts : Facts
        Available after `__enter__`.
    gaps : list of Gap
        The last gap may grow until a later block has come.
    lateness : Lateness

    Raises
    ------
    UsageError
        There is no input, or rate or count is invalid.
    DaqError, RpcError
        The rig refuses an input, the rate or the trigger; `opened_rig` makes one line of it.

    Examples
    --------
    >>> with opened_rig("local") as rig, Acquisition(rig, inputs, 5000.0, count=10_000) as acquired:  # doctest: +SKIP
    ...     acquired.start()
    ...     for block in acquired.blocks():
    ...         print(block.first, block.volts.max())
    """

    facts: Facts

    def __init__(
        self, rig: Rig, inputs: Sequence[Input], rate: float, *, count: int | None = None, trigger: str = ""
    ) -> None:
        if not inputs:
            raise UsageError("--channel: expected an input or more, got none.")
        if not (np.isfinite(rate) and rate > 0.0):
            raise UsageError(f"--rate: expected a number > 0, got {rate:g}.")
        if count is not None and count < 1:
            raise UsageError(f"samples: expected 1 or more, got {count}.")
        self.rig, self._inputs, self._requested_rate = rig, tuple(inputs), rate
        self._count, self._trigger = count, trigger
        self.gaps: list[Gap] = []
        self._waiting: deque[Block] = deque()
        self._changed = threading.Condition()
        self._stopping = threading.Event()
        self._over = False
        self._failure: BaseException | None = None
        self._next = 0
        self._called = 0.0
        self._thread = threading.Thread(target=self._run, name="rig inputs", daemon=True)

    def __enter__(self) -> Acquisition:
        """Make the task."""
        self._task = input_task(self.rig, self._inputs[0].terminal.strip("/").partition("/")[0])
        try:
            self._configure()
        except BaseException:
            self._task.close()
            raise
        self.lateness = Lateness(self.facts.rate)
        return self

    def _configure(self) -> None:
        constants, task = daqmx.constants, self._task
        for each in self._inputs:
            task.ai_channels.add_ai_voltage_chan(
                each.terminal, each.name, min_val=-each.highest, max_val=each.highest
            )
        most = min(BUFFER_SECONDS * self._requested_rate, BUFFER_VALUES / len(self._inputs))
        task.timing.cfg_samp_clk_timing(
            self._requested_rate,
            sample_mode=constants.AcquisitionType.CONTINUOUS,
            samps_per_chan=max(2, round(most)),
        )
        if self._trigger:
            task.triggers.start_trigger.cfg_dig_edge_start_trig(self._trigger)
        device = task.devices[0]
        at_once = device.ai_simultaneous_sampling_supported
        ranges = [(each.ai_rng_low, each.ai_rng_high, each.ai_resolution) for each in task.ai_channels]
        self.facts = Facts(
            rate=task.timing.samp_clk_rate,
            skew=0.0 if at_once else 1.0 / task.timing.ai_conv_rate,
            device=device.name,
            product=device.product_type,
            steps=tuple((low, high, (high - low) / 2.0**bits) for low, high, bits in ranges),
        )
        self._buffer = int(task.in_stream.input_buf_size)
        self._reader = daqmx.stream_readers.AnalogMultiChannelReader(task.in_stream)
        self._reader.verify_array_shape = False

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the task; a dead rig is left alone after 5 s."""
        self.stop()
        with self._changed:
            self._waiting.clear()
            self._changed.notify_all()
        if self._thread.ident is not None:
            self._thread.join(_END_SECONDS)
        if not self._thread.is_alive():
            with suppress(daqmx.DaqError, daqmx.RpcError):  # the failure was raised before
                self._task.close()

    def start(self) -> None:
        """Start to acquire, or to wait for the trigger, and to read."""
        self.facts = replace(self.facts, started_at=datetime.now(UTC).isoformat(timespec="milliseconds"))
        self.lateness.begin(time.monotonic())
        self._task.start()
        self._thread.start()

    def stop(self) -> None:
        """Set the stop flag: the acquisition ends after the present read. A signal handler may call it."""
        self._stopping.set()

    @property
    def queue_fill(self) -> float:
        """Fill level of the queue, 0 to 1."""
        return len(self._waiting) / QUEUE_BLOCKS

    def blocks(self) -> Iterator[Block]:
        """Yield the blocks, until all samples have come, it is stopped, or it fails.

        Raises
        ------
        DaqError, RpcError
            The failure, after all blocks that were read before.
        RigError
            The rig is dead.
        """
        while True:
            with self._changed:
                while not self._waiting and not self._over:
                    self._refuse_silence()
                    self._changed.wait(0.1)
                if not self._waiting:
                    break
                block = self._waiting.popleft()
                self._changed.notify_all()
            yield block
        if self._failure is not None:
            raise self._failure

    def _refuse_silence(self) -> None:
        if self._called and time.monotonic() - self._called > SILENCE:
            raise RigError(f"{self.rig.name}: expected an answer within {SILENCE:g} s, got none.")

    # ---- in the reader thread ----

    def _run(self) -> None:
        try:
            self._read_all()
        except BaseException as error:  # raised again where the blocks are taken
            self._failure = error
        with self._changed:
            self._over, self._called = True, 0.0
            self._changed.notify_all()

    def _read_all(self) -> None:
        rate, inputs = self.facts.rate, len(self._inputs)
        most = max(1, BLOCK_VALUES // inputs)
        shortest = min(max(1, round(SHORTEST_BLOCK * rate)), most)
        longest = min(max(1, round(LONGEST_BLOCK * rate)), most, max(1, self._buffer // 4))
        size = shortest
        while not self._stopping.is_set() and self._left(size) > 0:
            began = time.monotonic()
            volts = self._read(self._left(size))
            if volts.shape[1]:
                now = time.monotonic()
                self.lateness.arrived(self._next + volts.shape[1], now)
                self._keep(Block(self._next, volts))
                lasted = volts.shape[1] / rate
                # a backlog is read in longer blocks: a call costs as much as thousands of samples
                size = min(2 * size, longest) if now - began < 0.2 * lasted else max(size // 2, shortest)

    def _left(self, size: int) -> int:
        return size if self._count is None else min(size, self._count - self._next)

    def _read(self, count: int) -> Floats:
        """Return the samples that come within the time of a read, at most `count`, shape (channel, sample)."""
        volts = np.empty((len(self._inputs), count))
        self._called = time.monotonic()
        try:
            timeout = READ_TIMEOUT + min(count / self.facts.rate, READ_TIMEOUT)
            self._reader.read_many_sample(volts, count, timeout)
        except daqmx.DaqError as error:
            if error.error_code == daqmx.DAQmxErrors.SAMPLES_NO_LONGER_AVAILABLE and not self._trigger:
                self._restart()
                return volts[:, :0]
            if error.error_code != daqmx.DAQmxErrors.SAMPLES_NOT_YET_AVAILABLE:
                raise
            return volts[:, : int(getattr(error, "samps_per_chan_read", 0) or 0)]
        return volts

    def _restart(self) -> None:
        """Start the task again after samples were overwritten, and find its position by the clock of the computer."""
        with suppress(daqmx.DaqError):  # the task repeats its failure
            self._task.stop()
        before = time.monotonic()
        self._task.start()
        after = time.monotonic()
        first, doubt = self.lateness.sample_at(0.5 * (before + after))
        first = max(first, self._next + 1)
        if self._count is not None:
            first = min(first, self._count)
        self._lost(first, after - before + doubt, "read too late, started anew")

    def _keep(self, block: Block) -> None:
        """Put a block into the queue; if the queue is full, wait as long as the device keeps the next samples."""
        while True:
            with self._changed:
                if len(self._waiting) < QUEUE_BLOCKS:
                    self._waiting.append(block)
                    self._next = block.end
                    self._changed.notify_all()
                    return
                self._changed.wait(0.05)
            self._called = time.monotonic()
            if self._task.in_stream.avail_samp_per_chan > self._buffer // 2:
                self._lost(block.end, 0.0, "the program takes too slowly, its queue is full")
                return

    def _lost(self, first: int, doubt: float, reason: str) -> None:
        """Continue with a later sample; the samples before it are a gap, or extend the last gap."""
        last = self.gaps[-1] if self.gaps else None
        if last is not None and last.end == self._next and last.reason == reason and not doubt:
            self.gaps[-1] = replace(last, samples=first - last.first)
        else:
            self.gaps.append(Gap(self._next, first - self._next, doubt, reason))
        self._next = first

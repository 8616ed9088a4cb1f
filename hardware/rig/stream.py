"""Samples into an output task: in pieces, each checked, none regenerated."""

from __future__ import annotations

import time
from contextlib import suppress
from typing import Any

from vibroimpact.fmus.errors import RigError
from vibroimpact.hardware import daqmx
from vibroimpact.hardware.rig.limits import Fall, Floats, Limits
from vibroimpact.hardware.rig.memory import SharedSamples

BUFFER_SECONDS = 0.3
"""Duration of the samples in a full buffer, s: the delay from a stop to the terminal."""
PIECES = 8
"""Parts in which a buffer is written."""
WRITE_TIMEOUT = 0.25
"""Time of a write, s, after which it returns with its written samples, so that the writer shows that it lives."""
SILENCE = 15.0
"""Time without a moving sample, s, after which an output counts as stuck; a rig faster than real time waits 5 s."""

_TRIES = 5

STARVED = daqmx.DAQmxErrors.GEN_STOPPED_TO_PREVENT_REGEN_OF_OLD_SAMPLES
_NO_ROOM = daqmx.DAQmxErrors.SAMPLES_CAN_NOT_YET_BE_WRITTEN


def buffer_length(rate: float) -> int:
    """Return the samples of a buffer."""
    return max(PIECES * 2, round(BUFFER_SECONDS * rate))


def add_output(task: Any, terminal: str, rate: float, limits: Limits) -> None:
    """Make a task without samples an output task that regenerates nothing."""
    constants = daqmx.constants
    task.ao_channels.add_ao_voltage_chan(terminal, min_val=-limits.amplitude, max_val=limits.amplitude)
    length = buffer_length(rate)
    task.timing.cfg_samp_clk_timing(
        rate, sample_mode=constants.AcquisitionType.CONTINUOUS, samps_per_chan=length
    )
    task.out_stream.regen_mode = constants.RegenerationMode.DONT_ALLOW_REGENERATION
    task.out_stream.output_buf_size = length


class OutputStream:
    """The samples of an output task, by number, at a rate in Hz.

    The memory receives each sample before it is sent. `written` samples are in the task already. `last` is the last of
    them, or the held voltage, V. `generated` samples are out, by the device's count.
    """

    def __init__(
        self,
        task: Any,
        rate: float,
        limits: Limits,
        memory: SharedSamples,
        written: int = 0,
        last: float = 0.0,
    ) -> None:
        self.task, self.rate, self._limits, self._memory = task, rate, limits, memory
        self.written, self.generated = written, 0
        self._last, self._abandoned = last, False
        self._writer = daqmx.stream_writers.AnalogSingleChannelWriter(task.out_stream, auto_start=False)
        self._writer.verify_array_shape = False
        self.piece = max(1, buffer_length(rate) // PIECES)

    def send(self, volts: Floats) -> None:
        """Send samples, shape (sample,); return when the buffer has them.

        UsageError: samples are beyond the limits, and none is sent. DaqError, RpcError: the rig refuses them;
        `written` counts the accepted ones. RigError: no sample moved for 15 s.
        """
        self._limits.check(volts, self._last, self.rate, self.written)
        self._memory.announce(self.written, volts)
        done, moved = 0, time.monotonic()
        while done < volts.size:
            count = self._write(volts[done:])
            done += count
            if count:
                self._last, moved = float(volts[done - 1]), time.monotonic()
            elif time.monotonic() - moved > SILENCE:
                raise RigError(f"output: expected room for samples within {SILENCE:g} s, got none.")
        self._ask()

    def abandon(self) -> None:
        """Send no more samples: another process drives."""
        self._abandoned = True

    def _write(self, volts: Floats) -> int:
        if self._abandoned:
            raise RigError("output: it was left to the guardian")
        try:
            count = int(self._writer.write_many_sample(volts, WRITE_TIMEOUT))
        except daqmx.DaqError as error:
            count = int(getattr(error, "samps_per_chan_written", 0) or 0)
            if error.error_code != _NO_ROOM:
                self.written += count
                raise
        self.written += count
        self._memory.progress(self.written)
        return count

    def _ask(self) -> None:
        self.generated = int(self.task.out_stream.total_samp_per_chan_generated)
        self._memory.progress(self.written, self.generated)

    def start(self) -> None:
        """Start the task; its buffer has samples."""
        self._memory.driving = 1
        self.task.start()

    def stop(self) -> None:
        """Stop the task, whose output holds the last sample that was out; a starved task repeats its error."""
        with suppress(daqmx.DaqError):
            self.task.stop()

    def held(self) -> float:
        """Return the voltage that the output of an ended task holds, V: the last sample that was out."""
        with suppress(daqmx.DaqError):
            self._ask()
            return self._memory.sample(min(self.generated, self.written) - 1)
        return self._memory.sample(self.written - 1)

    def finish(self, fall: Fall, *, start: bool = False) -> None:
        """Send a fall, then zeros until its end is out, and stop; `start`: the task does not run yet.

        Errors are as in `send`.
        """
        begin = self.written
        if start:
            self.send(fall.volts(0, buffer_length(self.rate)))
            self.start()
        while self.generated < begin + fall.samples:
            self.send(fall.volts(self.written - begin, self.piece))
        self.stop()
        self._memory.driving = 0


def bring_to_rest(task: Any, rate: float, limits: Limits, memory: SharedSamples, held: float) -> None:
    """Bring the output of an idle task from its held voltage to 0.

    DaqError, RpcError, RigError: the rig refuses it, or this machine is too slow for it again and again.
    """
    for left in reversed(range(_TRIES)):
        stream = OutputStream(task, rate, limits, memory, 0, held)
        try:
            stream.finish(limits.fall(held, rate), start=True)
            return
        except daqmx.DaqError as error:
            if error.error_code != STARVED or not left:
                raise
            held = stream.held()
            stream.stop()

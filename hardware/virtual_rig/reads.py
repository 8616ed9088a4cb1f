"""Reads of a virtual rig: volts, codes of the converter, raw bytes."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.hardware.daqmx import METHODS, DAQmxErrors, message_class
from vibroimpact.hardware.virtual_rig.answers import BY_SCAN, Answers
from vibroimpact.hardware.virtual_rig.plant import Floats
from vibroimpact.hardware.virtual_rig.refusal import Refusal
from vibroimpact.hardware.virtual_rig.tasks import INPUT, State, Task
from vibroimpact.hardware.virtual_rig.waveforms import put_waveforms

_MOST_AT_ONCE = 2**24
"""Maximum samples of one read, of all channels: 128 MiB of doubles."""
_ALL_THERE_IS = -1


class Reads(Answers):
    """Answers the calls that read."""

    def _read(self, request: Any, size: int) -> tuple[NDArray[np.int16], Floats, int, int]:
        """Return the codes of samples, shape (channel, sample), V per step, their number and the status."""
        task = self._task(request)
        if task.kind != INPUT:
            raise Refusal(DAQmxErrors.READ_NO_INPUT_CHANS_IN_TASK, task.name)
        timeout = self._timeout(request.timeout)
        if request.num_samps_per_chan < _ALL_THERE_IS:
            raise Refusal(
                DAQmxErrors.INVALID_NUMBER_SAMPLES_TO_READ, f"{request.num_samps_per_chan} samples", read=0
            )
        with self._board.changed:
            channels = len(task.channels)
            if task.clock is None:
                count = max(request.num_samps_per_chan, 1)
                self._refuse_size(count * channels, size)
                self._board.reserve(task)
                try:
                    codes = self._board.read_now(task, count)
                finally:
                    if not task.kept and task.state is State.reserved:
                        task.stop()
                return codes, task.steps, count, 0
            if task.state is not State.running:
                self._board.start(task)
                task.implicit = True
            self._board.catch_up()
            task.seek()
            count = request.num_samps_per_chan
            if count < 0:
                count = max(task.available if task.needed is None else task.needed - task.position, 0)
            self._refuse_size(count * channels, size)
            codes, status = self._buffered(task, count, timeout)
            steps = task.steps
            if task.implicit and task.needed is not None and task.position >= task.needed:
                self._board.stop(task)
        return codes, steps, codes.shape[1], status

    def _buffered(self, task: Task, count: int, timeout: float) -> tuple[NDArray[np.int16], int]:
        if task.needed is not None and count > task.needed - task.position:
            count = task.needed - task.position  # a read of the rest of a finite task is no error
            if count <= 0:
                raise Refusal(DAQmxErrors.SAMPLES_WILL_NEVER_BE_AVAILABLE, task.name, read=0)
        pieces: list[NDArray[np.int16]] = [task.take(0)]
        left, end = count, np.inf if timeout < 0 else time.monotonic() + timeout
        while left:
            # a read may exceed the buffer, which it empties as it fills
            piece = min(left, max(task.length // 2, 1))
            there = self._wait_for_samples(
                task, piece, timeout if timeout < 0 else max(end - time.monotonic(), 0.0)
            )
            if task.failure is not None:
                raise task.failure.after(read=count - left)
            if task.state is not State.running:
                raise Refusal(
                    DAQmxErrors.CANNOT_PERFORM_OP_WHEN_TASK_NOT_RUNNING, task.name, read=count - left
                )
            task.refuse_overwritten()
            pieces.append(task.take(max(min(left, task.available), 0)))
            left -= pieces[-1].shape[1]
            if not there:
                break
        status = int(DAQmxErrors.SAMPLES_NOT_YET_AVAILABLE.value) if left else 0
        return np.concatenate(pieces, axis=1), status

    def _wait_for_samples(self, task: Task, count: int, timeout: float) -> bool:
        return self._wait_for(
            lambda: task.available >= count or task.failure is not None or task.state is not State.running,
            lambda: self._tick_of(task, task.position + count - 1),
            timeout,
        )

    @staticmethod
    def _refuse_size(samples: int, size: int) -> None:
        if samples > min(size, _MOST_AT_ONCE):
            raise Refusal(DAQmxErrors.READ_BUFFER_TOO_SMALL, f"{samples} samples into {size}", read=0)

    @staticmethod
    def _laid_out(values: NDArray[Any], request: Any) -> NDArray[Any]:
        """Return samples in the requested order; by channel, each is padded to the requested length."""
        if (request.fill_mode_raw or request.fill_mode) == BY_SCAN:
            return np.ascontiguousarray(values.T).ravel()
        requested = max(request.num_samps_per_chan, values.shape[1])
        padded = np.zeros((len(values), requested), dtype=values.dtype)
        padded[:, : values.shape[1]] = values
        return padded.ravel()

    def do_read_analog_f64(self, request: Any, response: Any) -> bytes:
        """Read volts; the numbers are put into the message as raw bytes, for speed."""
        codes, steps, count, status = self._read(request, request.array_size_in_samps)
        response.status, response.samps_per_chan_read = status, count
        data = self._laid_out(codes * steps, request).tobytes()
        whole: bytes = response.SerializeToString() + b"\x12" + _varint(len(data)) + data
        return whole

    def do_read_analog_scalar_f64(self, request: Any, response: Any) -> None:
        """Read a sample of one channel."""
        task = self._task(request)
        if len(task.channels) > 1:
            raise Refusal(DAQmxErrors.ONE_CHAN_READ_FOR_MULTI_CHAN_TASK, task.name)
        one = message_class(METHODS["ReadAnalogF64"].input_type)(
            num_samps_per_chan=1, timeout=request.timeout
        )
        one.task.CopyFrom(request.task)
        codes, steps, count, status = self._read(one, 1)
        if status:
            raise Refusal(DAQmxErrors.SAMPLES_NOT_YET_AVAILABLE, read=count)
        response.value = float(codes[0, 0] * steps[0, 0])

    def do_read_binary_i16(self, request: Any, response: Any) -> None:
        """Read the codes of the converter."""
        self._read_codes(np.int16, request, response)

    def do_read_binary_u16(self, request: Any, response: Any) -> None:
        """Read the codes of the converter, their 16 bits taken as unsigned numbers."""
        self._read_codes(np.uint16, request, response)

    def do_read_binary_i32(self, request: Any, response: Any) -> None:
        """Read the codes of the converter as 32-bit numbers."""
        self._read_codes(np.int32, request, response)

    def do_read_binary_u32(self, request: Any, response: Any) -> None:
        """Read the codes of the converter as unsigned 32-bit numbers."""
        self._read_codes(np.uint32, request, response)

    def _read_codes(self, kind: type[np.integer[Any]], request: Any, response: Any) -> None:
        codes, _, count, status = self._read(request, request.array_size_in_samps)
        response.status, response.samps_per_chan_read = status, count
        response.read_array.extend(self._laid_out(codes.astype(kind), request).tolist())

    def do_read_raw(self, request: Any, response: Any) -> None:
        """Read the codes of the converter as bytes, scan by scan."""
        codes, _, count, status = self._read(request, request.array_size_in_bytes // 2)
        response.status, response.samps_read, response.num_bytes_per_samp = status, count, 2
        data = np.ascontiguousarray(codes.T).tobytes()
        rest = request.array_size_in_bytes - len(data)
        # the rest of an array, too small for a scan, is cleared
        response.read_array = data + bytes(rest if 0 < rest < 2 * len(codes) else 0)

    def do_read_analog_waveforms(self, request: Any, response: Any) -> None:
        """Read volts with their time and the names of their channels."""
        task = self._task(request)
        mode = request.waveform_attribute_mode_raw or request.waveform_attribute_mode
        with self._board.changed:
            codes, steps, count, status = self._read(request, _MOST_AT_ONCE)
            response.status, response.samps_per_chan_read = status, count
            put_waveforms(response, task, codes * steps, mode, self._board.served_at)


def _varint(number: int) -> bytes:
    """Return a length encoded as a protocol buffer varint.

    >>> _varint(300)
    b'\\xac\\x02'
    """
    parts = bytearray()
    while number > 127:
        parts.append(number & 127 | 128)
        number >>= 7
    return bytes([*parts, number])

"""Writes to a virtual rig: volts, codes of the converter, raw bytes."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from vibroimpact.hardware.daqmx import DAQmxErrors
from vibroimpact.hardware.virtual_rig.answers import BY_SCAN, Answers
from vibroimpact.hardware.virtual_rig.plant import Floats
from vibroimpact.hardware.virtual_rig.refusal import Refusal
from vibroimpact.hardware.virtual_rig.tasks import OUTPUT, State, Task


class Writes(Answers):
    """Answers the calls that write."""

    def do_write_analog_f64(self, request: Any, response: Any) -> None:
        """Write volts."""
        self._write_all(request, np.array(request.write_array, dtype=np.float64), response)

    def do_write_binary_i16(self, request: Any, response: Any) -> None:
        """Write codes of the converter."""
        self._write_all(request, self._volts(request.write_array), response)

    do_write_binary_u16 = do_write_binary_i32 = do_write_binary_u32 = do_write_binary_i16

    def do_write_raw(self, request: Any, response: Any) -> None:
        """Write codes of the converter as bytes, scan by scan; an incomplete scan is left out."""
        task = self._task(request)
        channels, given = max(len(task.channels), 1), len(request.write_array) // 2
        count = min(request.num_samps, given // channels) if request.num_samps > 0 else given // channels
        codes = np.frombuffer(request.write_array, dtype=np.int16, count=count * channels)
        self._refuse_number(task, codes.size, count)
        samples = self._volts(codes).reshape(count, channels).T
        response.samps_per_chan_written = self._write(task, samples, request.auto_start, request.timeout)

    def _volts(self, codes: Any) -> Floats:
        return np.array(codes, dtype=np.float64) * self._step

    @property
    def _step(self) -> float:
        profile = self._board.profile
        return profile.output_range / 2.0 ** (profile.bits - 1)

    def _write_all(self, request: Any, values: Floats, response: Any) -> None:
        task, count, channels = (
            self._task(request),
            request.num_samps_per_chan,
            len(self._task(request).channels),
        )
        self._refuse_number(task, values.size, count)
        by_scan = (request.data_layout_raw or request.data_layout) == BY_SCAN
        samples = values.reshape(count, channels).T if by_scan else values.reshape(channels, count)
        response.samps_per_chan_written = self._write(task, samples, request.auto_start, request.timeout)

    @staticmethod
    def _refuse_number(task: Task, size: int, count: int) -> None:
        if task.kind != OUTPUT:
            raise Refusal(DAQmxErrors.WRITE_NO_OUTPUT_CHANS_IN_TASK, task.name)
        if count < 1 or size != count * len(task.channels):
            raise Refusal(DAQmxErrors.WRITE_NUM_CHANS_MISMATCH, f"{size} values", written=0)

    def do_write_analog_waveforms(self, request: Any, response: Any) -> None:
        """Write volts of waveforms, one for each channel."""
        task, waves = self._task(request), [each.y_data for each in request.waveforms]
        if len({len(each) for each in waves}) > 1:
            raise Refusal(DAQmxErrors.WRITE_NUM_CHANS_MISMATCH, "waveforms of several lengths", written=0)
        samples = np.array(waves, dtype=np.float64)
        self._refuse_number(task, samples.size, samples.size // max(len(waves), 1))
        response.samps_per_chan_written = self._write(task, samples, request.auto_start, request.timeout)

    def do_write_analog_scalar_f64(self, request: Any, response: Any) -> None:
        """Write a value of one channel."""
        task = self._task(request)
        self._refuse_number(task, 1, 1)
        self._write(task, np.array([[request.value]]), request.auto_start, request.timeout)

    def _write(self, task: Task, samples: Floats, auto_start: bool, timeout: float) -> int:
        patience = self._timeout(timeout)
        low = np.array([[channel.low] for channel in task.channels])
        high = np.array([[channel.high] for channel in task.channels])
        if not ((low <= samples) & (samples <= high)).all():
            raise Refusal(DAQmxErrors.INVALID_AO_DATA_WRITE, task.name, written=0)
        rounded = np.rint(samples / self._step) * self._step
        with self._board.changed:
            if task.clock is None:
                return self._write_now(task, rounded, auto_start)
            return self._write_buffer(task, rounded, auto_start, patience)

    def _write_now(self, task: Task, samples: Floats, auto_start: bool) -> int:
        """Put out the values one after the other."""
        if task.state is not State.running:
            if not auto_start:
                raise Refusal(
                    DAQmxErrors.CANNOT_WRITE_WHEN_AUTO_START_FALSE_AND_TASK_NOT_RUNNING, task.name, written=0
                )
            self._board.start(task)
        self._board.put_now(task, samples)
        return int(samples.shape[1])

    def _write_buffer(self, task: Task, samples: Floats, auto_start: bool, timeout: float) -> int:
        """Write in pieces, as space becomes free."""
        if task.length == 0:
            task.refuse_large_buffer(task.requested_buffer or samples.shape[1])
            task.buffer = np.zeros((len(task.channels), task.requested_buffer or samples.shape[1]))
        written, whole = 0, samples.shape[1]
        end = np.inf if timeout < 0 else time.monotonic() + timeout
        while written < whole:
            self._board.catch_up()
            if task.failure is not None:
                raise task.failure.after(written=written)
            piece = samples[:, written : written + task.room]
            if piece.size:
                task.write(piece)
                written += piece.shape[1]
                continue
            if task.state is not State.running and auto_start:
                self._board.start(task)
            left = timeout if timeout < 0 else max(end - time.monotonic(), 0.0)
            if not self._wait_for_room(task, whole - written, left):
                raise Refusal(DAQmxErrors.SAMPLES_CAN_NOT_YET_BE_WRITTEN, task.name, written=written)
        if task.state is not State.running and auto_start:
            self._board.start(task)
        self._board.changed.notify_all()
        return written

    def _wait_for_room(self, task: Task, count: int, timeout: float) -> bool:
        needed = task.position - task.length + min(count, max(task.length // 2, 1)) - 1
        return task.ticking and self._wait_for(
            lambda: task.room > 0 or task.failure is not None, lambda: self._tick_of(task, needed), timeout
        )

"""The calls of NI's service that the virtual rig answers, by the names that they have in the protocol."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.hardware.daqmx import METHODS, DAQmxErrors, constants, message_class
from vibroimpact.hardware.virtual_rig import attributes
from vibroimpact.hardware.virtual_rig.board import Board
from vibroimpact.hardware.virtual_rig.plant import Floats
from vibroimpact.hardware.virtual_rig.refusal import Refusal, text_of
from vibroimpact.hardware.virtual_rig.tasks import INPUT, OUTPUT, Channel, Clock, EventStream, State, Task
from vibroimpact.hardware.virtual_rig.waveforms import put_waveforms

_ATTRIBUTE = re.compile(
    r"(Get|Set|Reset)(SystemInfo|Device|Task|Chan|TimingEx|Timing|Trig|Read|Write|Buffer)Attribute(\w*)"
)
_TERMINALS = re.compile(
    r"/?(?P<device>[\w-]+)/(?P<word>ai|ao)(?P<first>\d{1,3})(?::(?:.*\D)?(?P<last>\d{1,3}))?", re.I
)
_ATTACH = 2
_CREATE = 1
_BY_SCAN = 1
_MOST_AT_ONCE = 2**24
"""Samples of one read, of all channels: 128 MiB of doubles."""

Call = Callable[[Any, Any], bytes | None]


class Calls:
    """Answers the calls of NI's service on a board; each takes the request and fills in the response.

    Parameters
    ----------
    board : Board
    """

    def __init__(self, board: Board) -> None:
        self._board = board
        self._unnamed = 0

    def answer(self, method: str) -> Call | None:
        """Return what answers a method; None where it is not modelled."""
        found = _ATTRIBUTE.fullmatch(method)
        if found is not None:
            verb, group, kind = found.groups()
            return lambda request, response: self._attribute(verb, group, kind, request, response)
        name = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", method).lower()
        return getattr(self, f"do_{name}", None)

    # ---- sessions ----

    def _task(self, request: Any) -> Task:
        name = request.task.name
        if name not in self._board.tasks:
            raise Refusal(DAQmxErrors.INVALID_TASK, repr(name[:60]))
        return self._board.tasks[name]

    def do_create_task(self, request: Any, response: Any) -> None:
        """Make a task, or attach to one that is there."""
        name, behaviour = request.session_name, request.initialization_behavior
        with self._board.changed:
            there = bool(name) and name in self._board.tasks
            if there and behaviour == _CREATE:
                raise Refusal(DAQmxErrors.DUPLICATE_TASK, name)
            if not there and behaviour == _ATTACH:
                raise Refusal(DAQmxErrors.INVALID_TASK, name)
            if not there:
                if not name:
                    name = f"_unnamedTask<{self._unnamed}>"
                    self._unnamed += 1
                self._board.tasks[name] = Task(name, self._board.name, self._board.profile)
            response.task.name = name
            response.new_session_initialized = not there

    def do_clear_task(self, request: Any, response: Any) -> None:
        """Forget a task."""
        self._board.remove(self._task(request))

    def do_start_task(self, request: Any, response: Any) -> None:
        """Start a task."""
        task = self._task(request)
        task.implicit = False
        self._board.start(task)

    def do_stop_task(self, request: Any, response: Any) -> None:
        """Stop a task."""
        self._board.stop(self._task(request))

    def do_task_control(self, request: Any, response: Any) -> None:
        """Start, stop, reserve or give back a task."""
        task, mode = self._task(request), constants.TaskMode(request.action_raw or request.action)
        with self._board.changed:
            if mode is constants.TaskMode.TASK_START:
                self._board.start(task)
            elif mode in (constants.TaskMode.TASK_STOP, constants.TaskMode.TASK_ABORT):
                task.kept = task.kept and mode is constants.TaskMode.TASK_STOP
                self._board.stop(task)
            elif mode in (constants.TaskMode.TASK_RESERVE, constants.TaskMode.TASK_COMMIT):
                self._board.reserve(task)
                task.kept = True
            elif mode is constants.TaskMode.TASK_UNRESERVE:
                task.kept = False
                self._board.stop(task)
            else:
                task.refuse_empty()

    def do_is_task_done(self, request: Any, response: Any) -> None:
        """Say whether a task is done."""
        task = self._task(request)
        with self._board.changed:
            self._board.catch_up()
            if task.failure is not None:
                raise task.failure
            response.is_task_done = task.done or task.state is not State.running

    def do_wait_until_task_done(self, request: Any, response: Any) -> None:
        """Wait until a task is done."""
        task = self._task(request)

        def is_over() -> bool:
            return task.done or task.state is not State.running

        def wanted() -> int:
            return self._board.plant.now if task.needed is None else self._tick_of(task, task.needed - 1)

        if not self._board.wait_for(is_over, wanted, request.time_to_wait):
            raise Refusal(DAQmxErrors.WAIT_UNTIL_DONE_DOES_NOT_INDICATE_DONE, task.name)
        if task.failure is not None:
            raise task.failure

    def _tick_of(self, task: Task, number: int) -> int:
        """Return the tick at which all channels have a sample; now, where nobody knows."""
        if task.start is None:
            return self._board.plant.now
        return int(task.edge(number)) + task.skew * (len(task.channels) - 1)

    # ---- channels, clock, trigger ----

    def _expanded(self, text: str, word: str, count: int) -> list[int]:
        """Return the numbers of the channels in a list such as `Dev1/ai0, Dev1/ai2:4`."""
        numbers: list[int] = []
        for part in (each.strip() for each in text.split(",")):
            found = _TERMINALS.fullmatch(part)
            if found is None or found["word"].lower() != word:
                raise Refusal(DAQmxErrors.PHYSICAL_CHAN_DOES_NOT_EXIST, repr(part[:60]))
            if found["device"].lower() != self._board.name.lower():
                raise Refusal(DAQmxErrors.INVALID_DEVICE_ID, found["device"])
            first = int(found["first"])
            last = first if found["last"] is None else int(found["last"])
            numbers += range(first, last + 1) if first <= last else range(first, last - 1, -1)
            if max(first, last) >= count:
                raise Refusal(DAQmxErrors.PHYSICAL_CHAN_DOES_NOT_EXIST, part)
        return numbers

    def _add(self, request: Any, kind: int, count: int, device_range: float | None) -> None:
        task = self._task(request)
        word = "ai" if kind == INPUT else "ao"
        numbers = self._expanded(request.physical_channel, word, count)
        low, high = request.min_val, request.max_val
        if (
            request.custom_scale_name
            or (request.units_raw or request.units) != constants.VoltageUnits.VOLTS.value
        ):
            raise Refusal(DAQmxErrors.ATTRIBUTE_NOT_SUPPORTED_IN_TASK_CONTEXT, "units other than V")
        if not low < high or device_range is None:
            raise Refusal(DAQmxErrors.INVALID_ATTRIBUTE_VALUE, f"a range of {low:g} to {high:g} V")
        given = [name.strip() for name in request.name_to_assign_to_channel.split(",") if name.strip()]
        if given and len(given) != len(numbers):
            raise Refusal(
                DAQmxErrors.INVALID_ATTRIBUTE_VALUE, f"{len(given)} names for {len(numbers)} channels"
            )
        names = given or [f"{self._board.name}/{word}{number}" for number in numbers]
        with self._board.changed:
            for name, number in zip(names, numbers, strict=True):
                task.add(kind, Channel(name, number, low, high, device_range))

    def do_create_ai_voltage_chan(self, request: Any, response: Any) -> None:
        """Add inputs."""
        profile = self._board.profile
        chosen = profile.input_range(request.min_val, request.max_val)
        self._add(request, INPUT, profile.inputs, chosen)

    def do_create_ao_voltage_chan(self, request: Any, response: Any) -> None:
        """Add outputs."""
        profile = self._board.profile
        widest = profile.output_range
        fits = -widest <= request.min_val and request.max_val <= widest
        self._add(request, OUTPUT, profile.outputs, widest if fits else None)

    def do_cfg_samp_clk_timing(self, request: Any, response: Any) -> None:
        """Give a task a sample clock."""
        task, source = self._task(request), request.source
        if source.lower() == "onboardclock":
            source = ""
        own = [f"{self._board.name}/{word}/SampleClock".lower() for word in ("ai", "ao")]
        if source and source.strip("/").lower() not in own:
            raise Refusal(
                DAQmxErrors.ATTRIBUTE_NOT_SUPPORTED_IN_TASK_CONTEXT, f"a clock from {source[:60]!r}"
            )
        with self._board.changed:
            mode = request.sample_mode_raw or request.sample_mode
            edge = request.active_edge_raw or request.active_edge
            task.set_clock(Clock(request.rate, mode, request.samps_per_chan, source, edge))

    def do_cfg_input_buffer(self, request: Any, response: Any) -> None:
        """Set the size of an input buffer."""
        self._set_buffer(request, INPUT)

    def do_cfg_output_buffer(self, request: Any, response: Any) -> None:
        """Set the size of an output buffer."""
        self._set_buffer(request, OUTPUT)

    def _set_buffer(self, request: Any, kind: int) -> None:
        task = self._task(request)
        with self._board.changed:
            task.refuse_running()
            if task.kind not in (0, kind):
                raise Refusal(DAQmxErrors.INCONSISTENT_CHANNEL_DIRECTIONS, task.name)
            task.set_buffer(request.num_samps_per_chan)

    def do_cfg_dig_edge_start_trig(self, request: Any, response: Any) -> None:
        """Let a task wait for an edge."""
        task = self._task(request)
        with self._board.changed:
            task.refuse_running()
            task.refuse_empty()
            terminal = request.trigger_source.strip("/").lower()
            known = [f"{self._board.name}/{word}".lower() for word in ("ai/starttrigger", "ao/starttrigger")]
            known += [f"{self._board.name}/pfi{number}".lower() for number in range(16)]
            if terminal not in known:
                raise Refusal(
                    DAQmxErrors.INVALID_ATTRIBUTE_VALUE, f"a trigger from {request.trigger_source[:60]!r}"
                )
            task.trigger = request.trigger_source
            task.trigger_edge = request.trigger_edge_raw or request.trigger_edge

    def do_disable_start_trig(self, request: Any, response: Any) -> None:
        """Let a task wait for no edge."""
        task = self._task(request)
        task.refuse_running()
        task.trigger = ""

    # ---- reads ----

    def _read(self, request: Any, size: int) -> tuple[NDArray[np.int16], Floats, int, int]:
        """Return codes of samples, shape (channel, sample), V of a step of them, their number, the status."""
        task = self._task(request)
        if task.kind != INPUT:
            raise Refusal(DAQmxErrors.READ_NO_INPUT_CHANS_IN_TASK, task.name)
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
            count = request.num_samps_per_chan
            if count < 0:
                count = task.available if task.needed is None else task.needed - task.position
            self._refuse_size(count * channels, size)
            codes, status = self._buffered(task, count, request.timeout)
            steps = task.steps
            if task.implicit and task.needed is not None and task.position >= task.needed:
                self._board.stop(task)
        return codes, steps, codes.shape[1], status

    def _buffered(self, task: Task, count: int, timeout: float) -> tuple[NDArray[np.int16], int]:
        if task.needed is not None and count > task.needed - task.position:
            raise Refusal(DAQmxErrors.SAMPLES_WILL_NEVER_BE_AVAILABLE, task.name, read=0)

        pieces: list[NDArray[np.int16]] = [task.take(0)]
        left, end = count, np.inf if timeout < 0 else time.monotonic() + timeout
        while left:
            # a read may be larger than the buffer, which it empties as it fills
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
            pieces.append(task.take(min(left, task.available)))
            left -= pieces[-1].shape[1]
            if not there:
                break
        status = int(DAQmxErrors.SAMPLES_NOT_YET_AVAILABLE.value) if left else 0
        return np.concatenate(pieces, axis=1), status

    def _wait_for_samples(self, task: Task, count: int, timeout: float) -> bool:
        return self._board.wait_for(
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
        """Return samples in the order that was asked for; by channel each has the room that it asked for."""
        if (request.fill_mode_raw or request.fill_mode) == _BY_SCAN:
            return np.ascontiguousarray(values.T).ravel()
        asked = max(request.num_samps_per_chan, values.shape[1])
        padded = np.zeros((len(values), asked), dtype=values.dtype)
        padded[:, : values.shape[1]] = values
        return padded.ravel()

    def do_read_analog_f64(self, request: Any, response: Any) -> bytes:
        """Read volts; the numbers go onto the wire as they are, which is what makes it fast."""
        codes, steps, count, status = self._read(request, request.array_size_in_samps)
        response.status, response.samps_per_chan_read = status, count
        data = self._laid_out(codes * steps, request).tobytes()
        whole: bytes = response.SerializeToString() + b"\x12" + _varint(len(data)) + data
        return whole

    def do_read_analog_scalar_f64(self, request: Any, response: Any) -> None:
        """Read a sample of one channel."""
        task = self._task(request)
        if len(task.channels) > 1:
            raise Refusal(DAQmxErrors.READ_BUFFER_TOO_SMALL, f"{len(task.channels)} channels into one number")
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
        codes, _, count, status = self._read(request, request.array_size_in_samps)
        response.status, response.samps_per_chan_read = status, count
        response.read_array.extend(self._laid_out(codes, request).tolist())

    def do_read_raw(self, request: Any, response: Any) -> None:
        """Read the codes of the converter as bytes, scan by scan."""
        codes, _, count, status = self._read(request, request.array_size_in_bytes // 2)
        response.status, response.samps_read, response.num_bytes_per_samp = status, count, 2
        response.read_array = np.ascontiguousarray(codes.T).tobytes()

    def do_read_analog_waveforms(self, request: Any, response: Any) -> None:
        """Read volts with their time and the names of their channels."""
        task = self._task(request)
        mode = request.waveform_attribute_mode_raw or request.waveform_attribute_mode
        with self._board.changed:
            codes, steps, count, status = self._read(request, _MOST_AT_ONCE)
            response.status, response.samps_per_chan_read = status, count
            put_waveforms(response, task, codes * steps, mode, self._board.served_at)

    # ---- writes ----

    def do_write_analog_f64(self, request: Any, response: Any) -> None:
        """Write volts."""
        task, count = self._task(request), request.num_samps_per_chan
        values = np.array(request.write_array, dtype=np.float64)
        channels = len(task.channels)
        if task.kind == OUTPUT and (count < 1 or values.size != count * channels):
            raise Refusal(DAQmxErrors.WRITE_NUM_CHANS_MISMATCH, f"{values.size} values", written=0)
        by_scan = (request.data_layout_raw or request.data_layout) == _BY_SCAN
        samples = values.reshape(count, channels).T if by_scan else values.reshape(channels, count)
        response.samps_per_chan_written = self._write(task, samples, request.auto_start, request.timeout)

    def do_write_analog_waveforms(self, request: Any, response: Any) -> None:
        """Write volts of waveforms, one for each channel."""
        task, waves = self._task(request), [each.y_data for each in request.waveforms]
        lengths = {len(each) for each in waves}
        if task.kind == OUTPUT and (len(waves) != len(task.channels) or len(lengths) != 1 or 0 in lengths):
            raise Refusal(DAQmxErrors.WRITE_NUM_CHANS_MISMATCH, f"{len(waves)} waveforms", written=0)
        samples = np.array(waves, dtype=np.float64)
        response.samps_per_chan_written = self._write(task, samples, request.auto_start, request.timeout)

    def do_write_analog_scalar_f64(self, request: Any, response: Any) -> None:
        """Write a value of one channel."""
        task = self._task(request)
        if task.kind == OUTPUT and len(task.channels) != 1:
            raise Refusal(DAQmxErrors.WRITE_NUM_CHANS_MISMATCH, f"1 value for {len(task.channels)} channels")
        self._write(task, np.array([[request.value]]), request.auto_start, request.timeout)

    def _write(self, task: Task, samples: Floats, auto_start: bool, timeout: float) -> int:
        if task.kind != OUTPUT:
            raise Refusal(DAQmxErrors.WRITE_NO_OUTPUT_CHANS_IN_TASK, task.name)
        low = np.array([[channel.low] for channel in task.channels])
        high = np.array([[channel.high] for channel in task.channels])
        if not ((low <= samples) & (samples <= high)).all():
            raise Refusal(DAQmxErrors.INVALID_AO_DATA_WRITE, task.name, written=0)
        step = self._board.profile.output_range / 2.0 ** (self._board.profile.bits - 1)
        rounded = np.rint(samples / step) * step
        with self._board.changed:
            if task.clock is None:
                return self._write_now(task, rounded, auto_start)
            return self._write_buffer(task, rounded, auto_start, timeout)

    def _write_now(self, task: Task, samples: Floats, auto_start: bool) -> int:
        if samples.shape[1] != 1:
            raise Refusal(DAQmxErrors.ANALOG_MULTI_SAMP_WRITE_NOT_SUPPORTED, task.name, written=0)
        if task.state is not State.running:
            if not auto_start:
                raise Refusal(
                    DAQmxErrors.CANNOT_WRITE_WHEN_AUTO_START_FALSE_AND_TASK_NOT_RUNNING, task.name, written=0
                )
            self._board.start(task)
        self._board.put_now(task, samples[:, 0])
        return 1

    def _write_buffer(self, task: Task, samples: Floats, auto_start: bool, timeout: float) -> int:
        """Write piece by piece, as there is room."""
        if task.length == 0:
            task.buffer = np.zeros((len(task.channels), task.asked_buffer or samples.shape[1]))
        written, whole = 0, samples.shape[1]
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
            if not self._wait_for_room(task, whole - written, timeout):
                raise Refusal(DAQmxErrors.SAMPLES_CAN_NOT_YET_BE_WRITTEN, task.name, written=written)
        if task.state is not State.running and auto_start:
            self._board.start(task)
        self._board.changed.notify_all()
        return written

    def _wait_for_room(self, task: Task, count: int, timeout: float) -> bool:
        needed = task.position - task.length + min(count, max(task.length // 2, 1)) - 1
        return task.ticking and self._board.wait_for(
            lambda: task.room > 0 or task.failure is not None, lambda: self._tick_of(task, needed), timeout
        )

    # ---- events ----

    def listen(self, method: str, request: Any) -> tuple[EventStream, Callable[[int], Any]]:
        """Register a listener; return its stream, and what makes a message of what it hears."""
        task = self._task(request)
        make = message_class(METHODS[method].output_type)
        with self._board.changed:
            task.refuse_running()
            if method == "RegisterDoneEvent":
                if task.ended is not None:
                    raise Refusal(DAQmxErrors.EVERY_N_SAMPS_EVENT_ALREADY_REGISTERED, task.name)
                task.ended = EventStream()
                return task.ended, lambda status: make(status=status)
            if task.clock is None:
                raise Refusal(
                    DAQmxErrors.EVERY_N_SAMPLES_EVENT_NOT_SUPPORTED_FOR_NON_BUFFERED_TASKS, task.name
                )
            kind = request.every_n_samples_event_type_raw or request.every_n_samples_event_type
            if kind != (1 if task.kind == INPUT else 2):
                raise Refusal(DAQmxErrors.INVALID_ATTRIBUTE_VALUE, "an event of the other direction")
            if request.n_samples < 1:
                raise Refusal(DAQmxErrors.INVALID_ATTRIBUTE_VALUE, "an event every 0 samples")
            if task.every is not None:
                raise Refusal(DAQmxErrors.EVERY_N_SAMPS_EVENT_ALREADY_REGISTERED, task.name)
            task.every = EventStream(every=request.n_samples)
            return task.every, lambda count: make(every_n_samples_event_type_raw=kind, n_samples=count)

    def do_unregister_every_n_samples_event(self, request: Any, response: Any) -> None:
        """End a listener."""
        task = self._task(request)
        if task.every is not None:
            task.every.heard.put(None)
            task.every = None

    def do_unregister_done_event(self, request: Any, response: Any) -> None:
        """End a listener."""
        task = self._task(request)
        if task.ended is not None:
            task.ended.heard.put(None)
            task.ended = None

    # ---- the device ----

    def _refuse_other_device(self, name: str) -> None:
        if name.strip("/").lower() != self._board.name.lower():
            raise Refusal(DAQmxErrors.INVALID_DEVICE_ID, repr(name[:60]))

    def do_reset_device(self, request: Any, response: Any) -> None:
        """End all tasks; outputs go to 0."""
        self._refuse_other_device(request.device_name)
        with self._board.changed:
            for task in list(self._board.tasks.values()):
                task.kept = False
                self._board.stop(task)
            self._board.analog.held[:] = 0.0

    def do_self_test_device(self, request: Any, response: Any) -> None:
        """Say that the device is there."""
        self._refuse_other_device(request.device_name)

    def do_get_error_string(self, request: Any, response: Any) -> None:
        """Say what a code means."""
        response.error_string = text_of(request.error_code)

    def _attribute(self, verb: str, group: str, kind: str, request: Any, response: Any) -> None:
        number = request.attribute_raw or request.attribute
        group = group.removesuffix("Ex")
        with self._board.changed:
            if verb == "Get":
                _put(response, self._value(group, request, number), kind)
                return
            if group not in attributes.OF_TASKS:
                raise Refusal(
                    DAQmxErrors.ATTRIBUTE_NOT_SUPPORTED_IN_TASK_CONTEXT,
                    f"a change of attribute 0x{number:04X} of {group.lower()}",
                )
            if verb == "Set":
                value = request.value_raw or request.value if kind == "Int32" else request.value
                attributes.change(group, self._task(request), number, value)
            else:
                attributes.reset(group, self._task(request), number)

    def _value(self, group: str, request: Any, number: int) -> Any:
        self._board.catch_up()
        if group == "SystemInfo":
            return attributes.of_system(self._board, number)
        if group == "Device":
            self._refuse_other_device(request.device_name)
            return attributes.of_device(self._board, number)
        if group == "Chan":
            return attributes.of_channel(self._task(request), request.channel, number)
        return attributes.of_task(group, self._task(request), number)


def _put(response: Any, value: Any, kind: str) -> None:
    if kind == "Int32":
        response.value_raw = value
    elif kind == "Int32Array":
        response.value_raw.extend(value)
    elif kind.endswith("Array"):
        response.value.extend(value)
    else:
        response.value = value


def _varint(number: int) -> bytes:
    """Return a length as protocol buffers write it.

    >>> _varint(300)
    b'\\xac\\x02'
    """
    parts = bytearray()
    while number > 127:
        parts.append(number & 127 | 128)
        number >>= 7
    return bytes([*parts, number])


def messages_of(stream: EventStream, make: Callable[[int], Any]) -> Iterator[Any]:
    """Yield the messages of a stream until it ends."""
    while (heard := stream.heard.get()) is not None:
        yield make(heard)

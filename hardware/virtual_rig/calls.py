"""The calls of NI's service that the virtual rig answers, by their names in the protocol."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from vibroimpact.hardware.daqmx import DAQmxErrors, constants
from vibroimpact.hardware.virtual_rig import attributes, changes
from vibroimpact.hardware.virtual_rig.board import Board
from vibroimpact.hardware.virtual_rig.checks import verify
from vibroimpact.hardware.virtual_rig.listening import Listening
from vibroimpact.hardware.virtual_rig.names import expanded, given_names, terminal
from vibroimpact.hardware.virtual_rig.reads import Reads
from vibroimpact.hardware.virtual_rig.refusal import Refusal, text_of
from vibroimpact.hardware.virtual_rig.tasks import INPUT, OUTPUT, Channel, Clock, Task
from vibroimpact.hardware.virtual_rig.writes import Writes

_GROUPS = "SystemInfo|Device|PhysicalChan|Persisted\\w+?|Task|Chan|TimingEx|Timing|Trig|Read|Write|Buffer"
_ATTRIBUTE = re.compile(rf"(Get|Set|Reset)({_GROUPS})Attribute(\w*)")
_CHANNEL = re.compile(
    r"/?(?P<device>[\w-]+)/(?:(?P<word>ai|ao)(?P<number>\d{1,3})|_ao(?P<output>\d)_vs_aognd)", re.I
)
_ATTACH = 2
_CREATE = 1
_KINDS: dict[str, Any] = {
    "Bool": bool,
    "Double": (float, int),
    "Int32": int,
    "UInt32": int,
    "UInt64": int,
    "String": str,
}
_HIGHEST = {"Int32": 2**31, "UInt32": 2**32, "UInt64": 2**64}
_NOTHING_SAVED = {
    "PersistedTask": DAQmxErrors.TASK_NOT_IN_DATA_NEIGHBORHOOD,
    "PersistedChan": DAQmxErrors.INVALID_GLOBAL_CHAN,
    "PersistedScale": DAQmxErrors.CUSTOM_SCALE_DOES_NOT_EXIST,
}

Call = Callable[[Any, Any], bytes | None]


class Calls(Reads, Writes, Listening):
    """Answers the calls of NI's service on a board; each takes the request and fills in the response."""

    def __init__(self, board: Board) -> None:
        super().__init__(board)
        self._unnamed = 0

    def answer(self, method: str) -> Call | None:
        """Return the function that answers a method; None for a method that is not modelled."""
        found = _ATTRIBUTE.fullmatch(method)
        if found is not None:
            verb, group, kind = found.groups()
            return lambda request, response: self._attribute(verb, group, kind, request, response)
        name = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", method).lower()
        return getattr(self, f"do_{name}", None)

    # ---- sessions ----

    def do_create_task(self, request: Any, response: Any) -> None:
        """Make a task, or attach to an existing one."""
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
        """Delete a task."""
        self._board.remove(self._task(request))

    def do_start_task(self, request: Any, response: Any) -> None:
        """Start a task."""
        task = self._task(request)
        task.implicit = False
        self._board.start(task)

    def do_stop_task(self, request: Any, response: Any) -> None:
        """Stop a task."""
        response.status = self._board.stop(self._task(request))

    def do_task_control(self, request: Any, response: Any) -> None:
        """Start, stop, reserve or release a task."""
        task, action = self._task(request), request.action_raw or request.action
        modes = constants.TaskMode
        with self._board.changed:
            if action == modes.TASK_START.value:
                self._board.start(task)
            elif action in (modes.TASK_STOP.value, modes.TASK_ABORT.value):
                task.kept = task.kept and action == modes.TASK_STOP.value
                response.status = self._board.stop(task)
            elif action in (modes.TASK_RESERVE.value, modes.TASK_COMMIT.value):
                self._board.reserve(task)
                task.kept = True
            elif action == modes.TASK_UNRESERVE.value:
                task.kept = False
                self._board.stop(task)
            elif action == modes.TASK_VERIFY.value:
                verify(task)
            else:
                raise Refusal(DAQmxErrors.INVALID_ATTRIBUTE_VALUE, f"action {action} of a task")

    def do_is_task_done(self, request: Any, response: Any) -> None:
        """Return whether a task is done."""
        task = self._task(request)
        with self._board.changed:
            self._board.catch_up()
            if task.failure is not None:
                raise task.failure
            response.is_task_done = task.is_over

    def do_wait_until_task_done(self, request: Any, response: Any) -> None:
        """Wait until a task is done."""
        task = self._task(request)

        def last_edge() -> int:
            return self._board.plant.now if task.needed is None else self._tick_of(task, task.needed - 1)

        if not self._wait_for(lambda: task.is_over, last_edge, self._timeout(request.time_to_wait)):
            raise Refusal(DAQmxErrors.WAIT_UNTIL_DONE_DOES_NOT_INDICATE_DONE, task.name)
        if task.failure is not None:
            raise task.failure

    # ---- channels, clock, trigger ----

    def _physical(self, text: str, word: str) -> list[tuple[str, int, int | None]]:
        """Return name, number and measured output of each channel in a list such as `Dev1/ai0, Dev1/ai2:4`."""
        profile, found = self._board.profile, []
        for name in expanded(text):
            parts = _CHANNEL.fullmatch(name)
            if parts is None:
                raise Refusal(DAQmxErrors.PHYSICAL_CHAN_DOES_NOT_EXIST, repr(name[:60]))
            if parts["device"].lower() != self._board.name.lower():
                raise Refusal(DAQmxErrors.INVALID_DEVICE_ID, parts["device"])
            number, inside = int(parts["number"] or parts["output"]), parts["output"] is not None
            count = profile.inputs if word == "ai" and not inside else profile.outputs
            right = word == "ai" and profile.sees_outputs if inside else parts["word"].lower() == word
            if not right or number >= count:
                raise Refusal(DAQmxErrors.PHYSICAL_CHAN_DOES_NOT_EXIST, name)
            terminal_name = f"_ao{number}_vs_aognd" if inside else f"{word}{number}"
            output = number if inside else None
            found.append((f"{self._board.name}/{terminal_name}", -1 - number if inside else number, output))
        if not found:
            raise Refusal(DAQmxErrors.PHYSICAL_CHAN_DOES_NOT_EXIST, repr(text[:60]))
        return found

    def _add(self, request: Any, kind: int, device_range: float, wiring: int) -> None:
        task, low, high = self._task(request), request.min_val, request.max_val
        physical = self._physical(request.physical_channel, "ai" if kind == INPUT else "ao")
        units = request.units_raw or request.units
        if request.custom_scale_name or units != constants.VoltageUnits.VOLTS.value:
            raise Refusal(DAQmxErrors.ATTRIBUTE_NOT_SUPPORTED_IN_TASK_CONTEXT, "units other than V")
        named = request.name_to_assign_to_channel
        names = given_names(named, len(physical)) if named.strip() else [name for name, _, _ in physical]
        channels = [
            Channel(name, number, low, high, device_range, wiring, output)
            for name, (_, number, output) in zip(names, physical, strict=True)
        ]
        with self._board.changed:
            task.add(kind, channels)

    def do_create_ai_voltage_chan(self, request: Any, response: Any) -> None:
        """Add inputs."""
        self._physical(request.physical_channel, "ai")
        chosen = changes.input_range(self._board, request.min_val, request.max_val)
        self._add(
            request, INPUT, chosen, changes.wiring(request.terminal_config_raw or request.terminal_config)
        )

    def do_create_ao_voltage_chan(self, request: Any, response: Any) -> None:
        """Add outputs."""
        self._physical(request.physical_channel, "ao")
        changes.refuse_output_range(self._board, request.min_val, request.max_val)
        widest = self._board.profile.output_range
        self._add(request, OUTPUT, widest, constants.TerminalConfiguration.RSE.value)

    def do_cfg_samp_clk_timing(self, request: Any, response: Any) -> None:
        """Give a task a sample clock."""
        task = self._task(request)
        with self._board.changed:
            mode = request.sample_mode_raw or request.sample_mode
            edge = request.active_edge_raw or request.active_edge
            source = terminal(task.device, request.source)
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
            if task.kind not in (0, kind):
                raise Refusal(DAQmxErrors.INCONSISTENT_CHANNEL_DIRECTIONS, task.name)
            task.set_buffer(request.num_samps_per_chan)

    def do_cfg_dig_edge_start_trig(self, request: Any, response: Any) -> None:
        """Set a digital edge as start trigger."""
        task = self._task(request)
        with self._board.changed:
            task.refuse_running()
            task.refuse_empty()
            task.trigger = terminal(task.device, request.trigger_source)
            task.trigger_edge = request.trigger_edge_raw or request.trigger_edge
            if not task.trigger:
                raise Refusal(DAQmxErrors.INVALID_ATTRIBUTE_VALUE, "a trigger from no terminal")

    def do_disable_start_trig(self, request: Any, response: Any) -> None:
        """Remove the start trigger."""
        task = self._task(request)
        task.refuse_running()
        task.trigger = ""

    # ---- the device ----

    def _refuse_other_device(self, name: str) -> None:
        if name.strip("/").lower() != self._board.name.lower():
            raise Refusal(DAQmxErrors.INVALID_DEVICE_ID, repr(name[:60]))

    def do_reset_device(self, request: Any, response: Any) -> None:
        """End all tasks; outputs go to 0."""
        self._refuse_other_device(request.device_name)
        self._board.reset()

    def do_self_test_device(self, request: Any, response: Any) -> None:
        """Confirm that the device is there."""
        self._refuse_other_device(request.device_name)

    def do_get_error_string(self, request: Any, response: Any) -> None:
        """Return the text of a code; an unknown code has none, as the client then reports."""
        text = text_of(request.error_code)
        response.error_string = text and f"{text}."

    def do_load_task(self, request: Any, response: Any) -> None:
        """Refuse to load a task: no task is saved."""
        raise Refusal(DAQmxErrors.TASK_NOT_IN_DATA_NEIGHBORHOOD, repr(request.session_name[:60]))

    def do_add_global_chans_to_task(self, request: Any, response: Any) -> None:
        """Refuse to add saved channels: no channel is saved."""
        raise Refusal(DAQmxErrors.INVALID_GLOBAL_CHAN, repr(request.channel_names[:60]))

    def _attribute(self, verb: str, group: str, kind: str, request: Any, response: Any) -> None:
        number = request.attribute_raw or request.attribute
        if group == "TimingEx" and request.device_names:
            raise Refusal(
                DAQmxErrors.M_STUDIO_OPERATION_DOES_NOT_SUPPORT_DEVICE_CONTEXT, request.device_names[:60]
            )
        group = group.removesuffix("Ex")
        with self._board.changed:
            if verb == "Get":
                _put(response, self._value(group, request, number), kind)
                return
            value = None
            if verb == "Set":
                value = request.value_raw or request.value if kind == "Int32" else request.value
                if not isinstance(value, _KINDS.get(kind, ())):
                    raise Refusal(DAQmxErrors.SPECIFIED_ATTR_NOT_VALID, f"0x{number:04X} as {kind}")
            self._change(verb, group, request, number, value)

    def _change(self, verb: str, group: str, request: Any, number: int, value: Any) -> None:
        if group == "Chan" and verb == "Set":
            changes.change_channel(self._board, self._task(request), request.channel, number, value)
        elif group not in attributes.OF_TASKS:
            raise Refusal(
                DAQmxErrors.ATTRIBUTE_NOT_SUPPORTED_IN_TASK_CONTEXT,
                f"a change of attribute 0x{number:04X} of {group.lower()}",
            )
        elif verb == "Set":
            changes.change(group, self._task(request), number, value)
        else:
            changes.reset(group, self._task(request), number)

    def _value(self, group: str, request: Any, number: int) -> Any:
        self._board.catch_up()
        if group.startswith("Persisted"):
            raise Refusal(_NOTHING_SAVED[group], "nothing is saved")
        if group == "SystemInfo":
            return attributes.of_system(self._board, number)
        if group == "Device":
            self._refuse_other_device(request.device_name)
            return attributes.of_device(self._board, number)
        if group == "PhysicalChan":
            return attributes.of_physical_channel(self._board, request.physical_channel, number)
        if group == "Chan":
            return attributes.of_channel(self._task(request), request.channel, number)
        return attributes.of_task(group, self._task(request), number)


def _put(response: Any, value: Any, kind: str) -> None:
    listed, one = kind.endswith("Array"), kind.removesuffix("Array")
    each = value if isinstance(value, list) else [value]
    if listed != isinstance(value, list) or not all(_is_of(one, v) for v in each):
        raise Refusal(DAQmxErrors.SPECIFIED_ATTR_NOT_VALID, f"an attribute as {kind}")
    if kind == "Int32":
        response.value_raw = value
    elif kind == "Int32Array":
        response.value_raw.extend(value)
    elif listed:
        response.value.extend(value)
    else:
        response.value = value


def _is_of(kind: str, value: Any) -> bool:
    """Return whether a value goes into a message of the given kind of the protocol."""
    return isinstance(value, _KINDS.get(kind, ())) and (kind not in _HIGHEST or value < _HIGHEST[kind])

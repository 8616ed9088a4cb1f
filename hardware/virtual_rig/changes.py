"""Attributes that a program can change, by NI's numbers; all others are refused."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from vibroimpact.hardware.daqmx import DAQmxErrors, constants
from vibroimpact.hardware.virtual_rig.attributes import (
    DIGITAL_EDGE,
    DO_NOT_OVERWRITE,
    NO_TRIGGER,
    ON_DEMAND,
    OVERWRITE,
    SAMPLE_CLOCK,
    channels_of,
    unknown,
)
from vibroimpact.hardware.virtual_rig.board import Board
from vibroimpact.hardware.virtual_rig.names import terminal
from vibroimpact.hardware.virtual_rig.refusal import Refusal
from vibroimpact.hardware.virtual_rig.tasks import (
    ALLOW_REGENERATION,
    FROM_FIRST,
    FROM_NEWEST,
    FROM_POSITION,
    INPUT,
    OUTPUT,
    UNSET_CLOCK,
    Channel,
    Task,
)

_CLOCK_FIELDS = {0x1344: "rate", 0x1300: "mode", 0x1310: "samples", 0x1852: "source", 0x1301: "edge"}


_WHILE_RUNNING = {("Read", 0x190A), ("Read", 0x190B)}
"""Attributes that may change while a task runs: the origin and offset of a read."""


def change(group: str, task: Task, number: int, value: Any) -> None:
    """Change an attribute of a task."""
    if (group, number) not in _WHILE_RUNNING:
        task.refuse_running()
    default = _DEFAULTS.get((group, number))
    if default is not None and type(value) is not type(default):
        raise Refusal(DAQmxErrors.SPECIFIED_ATTR_NOT_VALID, f"0x{number:04X} as {type(value).__name__}")
    if group == "Timing" and number in _CLOCK_FIELDS:
        task.refuse_empty()
        requested: Any = terminal(task.device, value) if number == 0x1852 else value
        fields: dict[str, Any] = {_CLOCK_FIELDS[number]: requested}
        task.timing = replace(task.timing, **fields)
    elif group == "Timing" and number == 0x1347 and value in (ON_DEMAND, SAMPLE_CLOCK):
        task.refuse_empty()
        task.clocked = value == SAMPLE_CLOCK
    elif group == "Trig" and number in (0x1393, 0x1404, 0x1407):
        _change_trigger(task, number, value)
    elif group == "Read" and task.kind == INPUT:
        _change_read(task, number, value)
    elif group == "Write" and number == 0x1453 and task.kind == OUTPUT:
        task.regeneration = value
    elif group == "Buffer" and number == _BUFFER_OF.get(task.kind):
        task.set_buffer(value)
    else:
        raise unknown(group, number)


_BUFFER_OF = {INPUT: 0x186C, OUTPUT: 0x186D}


def _change_trigger(task: Task, number: int, value: Any) -> None:
    if number == 0x1393 and value == NO_TRIGGER:
        task.trigger = ""
    elif number == 0x1407:
        task.trigger = terminal(task.device, value)
    elif number == 0x1404:
        task.trigger_edge = value
    elif not (value == DIGITAL_EDGE and task.trigger):
        raise unknown("trigger", number)


def _change_read(task: Task, number: int, value: Any) -> None:
    if number == 0x190A and value in (FROM_FIRST, FROM_POSITION, FROM_NEWEST):
        task.relative = value
    elif number == 0x190B:
        task.offset = value
    elif number == 0x1211 and value in (OVERWRITE, DO_NOT_OVERWRITE):
        task.overwrites = value == OVERWRITE
    else:
        raise unknown("read", number)


_DEFAULTS: dict[tuple[str, int], Any] = {
    ("Write", 0x1453): ALLOW_REGENERATION,
    ("Buffer", 0x186C): None,
    ("Buffer", 0x186D): None,
    ("Read", 0x190A): FROM_POSITION,
    ("Read", 0x190B): 0,
    ("Read", 0x1211): DO_NOT_OVERWRITE,
    ("Trig", 0x1393): NO_TRIGGER,
    ("Trig", 0x1404): constants.Edge.RISING.value,
    ("Trig", 0x1407): "",
    ("Timing", 0x1347): ON_DEMAND,
    **{("Timing", number): getattr(UNSET_CLOCK, name) for number, name in _CLOCK_FIELDS.items()},
}


def reset(group: str, task: Task, number: int) -> None:
    """Reset an attribute of a task to its default."""
    if (group, number) not in _DEFAULTS:
        raise unknown(group, number)
    change(group, task, number, _DEFAULTS[group, number])


def change_channel(board: Board, task: Task, names: str, number: int, value: Any) -> None:
    """Change an attribute of channels: the device range, the expected voltages, the terminal configuration."""
    task.refuse_running()
    changes = _OF_INPUTS if task.kind == INPUT else _OF_OUTPUTS
    if number not in changes:
        raise unknown("channel", number)
    kind, change_one = changes[number]
    if type(value) is not kind:
        raise Refusal(DAQmxErrors.SPECIFIED_ATTR_NOT_VALID, f"0x{number:04X} as {type(value).__name__}")
    for channel in channels_of(task, names):
        change_one(board, channel, value)


def _expect_input(board: Board, channel: Channel, low: float, high: float) -> None:
    channel.device_range = input_range(board, low, high)
    channel.low, channel.high = low, high


def _expect_output(board: Board, channel: Channel, low: float, high: float) -> None:
    refuse_output_range(board, low, high)
    channel.low, channel.high = low, high


def _range_ends_at(board: Board, channel: Channel, edge: float) -> None:
    channel.device_range = _one_of(board.profile.ranges, edge)


def _output_ends_at(board: Board, channel: Channel, edge: float) -> None:
    _one_of((board.profile.output_range,), edge)


def _wire(board: Board, channel: Channel, requested: int) -> None:
    channel.wiring = wiring(requested)


def _count_in_bits(board: Board, channel: Channel, unit: int) -> None:
    if unit != constants.ResolutionType.BITS.value:
        raise Refusal(DAQmxErrors.INVALID_ATTRIBUTE_VALUE, f"a resolution in unit {unit}")


_Change = tuple[type, Callable[[Board, Channel, Any], None]]
_OF_INPUTS: dict[int, _Change] = {
    0x1815: (float, _range_ends_at),
    0x1816: (float, lambda board, channel, edge: _range_ends_at(board, channel, -edge)),
    0x17DD: (float, lambda board, channel, high: _expect_input(board, channel, channel.low, high)),
    0x17DE: (float, lambda board, channel, low: _expect_input(board, channel, low, channel.high)),
    0x1097: (int, _wire),
    0x1764: (int, _count_in_bits),
}
_OF_OUTPUTS: dict[int, _Change] = {
    0x182E: (float, _output_ends_at),
    0x182D: (float, lambda board, channel, edge: _output_ends_at(board, channel, -edge)),
    0x1186: (float, lambda board, channel, high: _expect_output(board, channel, channel.low, high)),
    0x1187: (float, lambda board, channel, low: _expect_output(board, channel, low, channel.high)),
    0x182B: (int, _count_in_bits),
}


def _one_of(ranges: tuple[float, ...], edge: float) -> float:
    if edge not in ranges:
        raise Refusal(DAQmxErrors.INVALID_ATTRIBUTE_VALUE, f"a range that ends at {edge:g} V")
    return edge


def input_range(board: Board, low: float, high: float) -> float:
    """Return the device range for inputs from `low` to `high`, V."""
    chosen = board.profile.input_range(low, high)
    if not low < high or chosen is None:
        raise Refusal(DAQmxErrors.INVALID_ATTRIBUTE_VALUE, f"a range of {low:g} to {high:g} V")
    return chosen


def refuse_output_range(board: Board, low: float, high: float) -> None:
    """Raise Refusal for voltages outside the output range of the device."""
    widest = board.profile.output_range
    if not -widest <= low < high <= widest:
        raise Refusal(DAQmxErrors.INVALID_ATTRIBUTE_VALUE, f"a range of {low:g} to {high:g} V")


def wiring(requested: int) -> int:
    """Return a terminal configuration; the plant is the same for all of them."""
    modes = constants.TerminalConfiguration
    if requested == modes.DEFAULT.value:
        requested = modes.DIFF.value
    if requested in (modes.DIFF.value, modes.RSE.value, modes.NRSE.value):
        return requested
    raise Refusal(DAQmxErrors.INVALID_ATTRIBUTE_VALUE, f"terminal configuration {requested}")

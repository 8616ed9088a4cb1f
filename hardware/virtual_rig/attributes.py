"""Attributes that the virtual rig models, by NI's numbers; all others are refused."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from vibroimpact.hardware.daqmx import DAQmxErrors, constants
from vibroimpact.hardware.virtual_rig.board import Board
from vibroimpact.hardware.virtual_rig.checks import verify
from vibroimpact.hardware.virtual_rig.names import expanded
from vibroimpact.hardware.virtual_rig.refusal import Refusal
from vibroimpact.hardware.virtual_rig.tasks import (
    FINITE,
    INPUT,
    Channel,
    Task,
)

VERSION = (24, 5, 0)
"""Version of the modelled driver."""

_VOLTAGE = constants.UsageTypeAI.VOLTAGE.value
_VOLTS = constants.VoltageUnits.VOLTS.value
ON_DEMAND = constants.SampleTimingType.ON_DEMAND.value
SAMPLE_CLOCK = constants.SampleTimingType.SAMPLE_CLOCK.value
DIGITAL_EDGE = constants.TriggerType.DIGITAL_EDGE.value
NO_TRIGGER = constants.TriggerType.NONE.value
_BITS = constants.ResolutionType.BITS.value
OVERWRITE = constants.OverwriteMode.OVERWRITE_UNREAD_SAMPLES.value
DO_NOT_OVERWRITE = constants.OverwriteMode.DO_NOT_OVERWRITE_UNREAD_SAMPLES.value
_PHYSICAL_CHANNEL = 0x18F5
# bits of the terminal configurations of an input or output
_RSE, _NRSE, _DIFFERENTIAL = 1, 2, 4


def terminals(board: Board, word: str) -> str:
    """Return the names of the inputs (`ai`) or outputs (`ao`) of the device, as NI lists them."""
    count = board.profile.inputs if word == "ai" else board.profile.outputs
    return ", ".join(f"{board.name}/{word}{number}" for number in range(count))


def _pairs(ranges: tuple[float, ...]) -> list[float]:
    return [edge for each in ranges for edge in (-each, each)]


SYSTEM: dict[int, Callable[[Board], Any]] = {
    0x1272: lambda board: VERSION[0],
    0x1923: lambda board: VERSION[1],
    0x2F22: lambda board: VERSION[2],
    0x193B: lambda board: board.name,
    # saved channels, scales and tasks: none
    0x1265: lambda board: "",
    0x1266: lambda board: "",
    0x1267: lambda board: "",
}
DEVICE: dict[int, Callable[[Board], Any]] = {
    0x0631: lambda board: board.profile.product,
    0x29A9: lambda board: board.profile.category,
    0x22CA: lambda board: True,  # is simulated
    0x231E: lambda board: terminals(board, "ai"),
    0x231F: lambda board: terminals(board, "ao"),
    # digital lines, ports and counters: none
    **{number: lambda board: "" for number in (0x2320, 0x2321, 0x2322, 0x2323, 0x2324, 0x2325)},
    0x298C: lambda board: board.profile.highest_rate(1),
    0x298D: lambda board: board.profile.conversion_rate,
    0x298F: lambda board: board.profile.simultaneous,
    0x2990: lambda board: _pairs(board.profile.ranges),
    0x2997: lambda board: board.profile.output_rate,
    0x299B: lambda board: _pairs((board.profile.output_range,)),
    0x2996: lambda board: True,  # outputs have a sample clock
    0x2984: lambda board: False,  # analog triggers
    0x2985: lambda board: True,  # digital triggers
    0x2FD2: lambda board: [_VOLTAGE],
    0x2FD3: lambda board: [_VOLTAGE],
}
TASK: dict[int, Callable[[Task], Any]] = {
    0x1276: lambda task: task.name,
    0x1273: lambda task: _names(task),
    0x2181: lambda task: len(task.channels),
}
TIMING: dict[int, Callable[[Task], Any]] = {
    0x1347: lambda task: SAMPLE_CLOCK if task.clocked else ON_DEMAND,
    0x1344: lambda task: task.clock_rate if task.clocked else task.timing.rate,
    0x1300: lambda task: task.timing.mode,
    0x1310: lambda task: task.timing.samples,
    0x1852: lambda task: task.timing.source or f"/{task.device}/{_word(task)}/SampleClockTimebase",
    0x1301: lambda task: task.timing.edge,
    0x22C8: lambda task: task.highest_rate,
    0x1848: lambda task: task.profile.conversion_rate,
}
TRIGGER: dict[int, Callable[[Task], Any]] = {
    0x1393: lambda task: DIGITAL_EDGE if task.trigger else NO_TRIGGER,
    0x1407: lambda task: task.trigger,
    0x1404: lambda task: task.trigger_edge,
}
READ: dict[int, Callable[[Task], Any]] = {
    0x1223: lambda task: task.available,
    0x31E8: lambda task: default_count(task),
    0x217B: lambda task: len(task.channels),
    0x1823: lambda task: _names(task),
    0x1221: lambda task: task.position,
    0x192A: lambda task: task.count,
    0x1215: lambda task: False,  # read available samples, not all of a finite task
    0x190A: lambda task: task.relative,
    0x190B: lambda task: task.offset,
    0x1211: lambda task: OVERWRITE if task.overwrites else DO_NOT_OVERWRITE,
    0x217A: lambda task: task.profile.bits // 8 + bool(task.profile.bits % 8),
}
WRITE: dict[int, Callable[[Task], Any]] = {
    0x1453: lambda task: task.regeneration,
    0x217E: lambda task: len(task.channels),
    0x1458: lambda task: task.position,
    0x1460: lambda task: task.room,
    0x192B: lambda task: task.count,
}
BUFFER: dict[int, Callable[[Task], Any]] = {
    0x186C: lambda task: task.default_buffer() if task.kind == INPUT and task.clock else 0,
    0x186D: lambda task: task.requested_buffer or task.length,
    0x230A: lambda task: 0,  # onboard samples: none, all are in the buffer
    0x230B: lambda task: 0,
}
ANY_CHANNEL: dict[int, Callable[[Task, Channel], Any]] = {
    0x187F: lambda task, channel: task.kind,
    _PHYSICAL_CHANNEL: lambda task, channel: physical_name(task, channel),
    0x1926: lambda task, channel: "",
}
PHYSICAL: dict[tuple[str, int], Callable[[Board], Any]] = {
    ("ai", 0x2342): lambda board: _RSE | _NRSE | _DIFFERENTIAL,
    ("ai", 0x2FD7): lambda board: [_VOLTAGE],
    ("ao", 0x29A3): lambda board: _RSE,
    ("ao", 0x2FD9): lambda board: [_VOLTAGE],
}
INPUT_CHANNEL: dict[int, Callable[[Task, Channel], Any]] = {
    0x0695: lambda task, channel: _VOLTAGE,
    0x1094: lambda task, channel: _VOLTS,
    # the requested range, widened to a range of the device
    0x17DD: lambda task, channel: channel.device_range,
    0x17DE: lambda task, channel: -channel.device_range,
    0x1097: lambda task, channel: channel.wiring,
    0x1815: lambda task, channel: channel.device_range,
    0x1816: lambda task, channel: -channel.device_range,
    0x1764: lambda task, channel: _BITS,
    0x1765: lambda task, channel: float(task.profile.bits),
    0x22DA: lambda task, channel: 16,  # bits of a raw sample
    0x1930: lambda task, channel: [0.0, channel.device_range / 2.0 ** (task.profile.bits - 1)],
    0x17E0: lambda task, channel: "",
}
OUTPUT_CHANNEL: dict[int, Callable[[Task, Channel], Any]] = {
    0x1108: lambda task, channel: _VOLTAGE,
    0x1184: lambda task, channel: _VOLTS,
    0x1186: lambda task, channel: channel.high,
    0x1187: lambda task, channel: channel.low,
    0x182E: lambda task, channel: channel.device_range,
    0x182D: lambda task, channel: -channel.device_range,
    0x182B: lambda task, channel: _BITS,
    0x182C: lambda task, channel: float(task.profile.bits),
}
OF_TASKS = {"Task": TASK, "Timing": TIMING, "Trig": TRIGGER, "Read": READ, "Write": WRITE, "Buffer": BUFFER}


def physical_name(task: Task, channel: Channel) -> str:
    """Return the name of the input or output of a channel."""
    if channel.output is not None:
        return f"{task.device}/_ao{channel.output}_vs_aognd"
    return f"{task.device}/{_word(task)}{channel.number}"


def _word(task: Task) -> str:
    return "ai" if task.kind == INPUT else "ao"


def _names(task: Task) -> str:
    return ", ".join(channel.name for channel in task.channels)


def default_count(task: Task) -> int:
    """Return the number of samples per channel of a read that does not give one."""
    if task.clock is None:
        return 1
    return task.clock.samples if task.clock.mode == FINITE else task.available


def unknown(group: str, number: int) -> Refusal:
    """Return the refusal of an attribute that is not modelled."""
    return Refusal(
        DAQmxErrors.ATTRIBUTE_NOT_SUPPORTED_IN_TASK_CONTEXT, f"attribute 0x{number:04X} of {group.lower()}"
    )


def of_device(board: Board, number: int) -> Any:
    """Return an attribute of the device."""
    if number not in DEVICE:
        raise unknown("device", number)
    return DEVICE[number](board)


def of_system(board: Board, number: int) -> Any:
    """Return an attribute of the system."""
    if number not in SYSTEM:
        raise unknown("system", number)
    return SYSTEM[number](board)


def of_physical_channel(board: Board, name: str, number: int) -> Any:
    """Return an attribute of an input or output of the device."""
    word = next(
        (w for w in ("ai", "ao") if name.strip().lower() in terminals(board, w).lower().split(", ")), ""
    )
    if not word:
        raise Refusal(DAQmxErrors.PHYSICAL_CHAN_DOES_NOT_EXIST, repr(name[:60]))
    if (word, number) not in PHYSICAL:
        raise unknown("physical channel", number)
    return PHYSICAL[word, number](board)


def of_task(group: str, task: Task, number: int) -> Any:
    """Return an attribute of a task: its timing, trigger, reads, writes or buffers."""
    if group == "Task" and number == 0x230E:
        return task.device if task.channels else ""
    if number not in OF_TASKS[group]:
        raise unknown(group, number)
    if group == "Timing":
        verify(task)
    return OF_TASKS[group][number](task)


def channels_of(task: Task, names: str) -> list[Channel]:
    """Return the channels named in a list; all channels for an empty list."""
    requested = expanded(names)
    known = {channel.name.lower(): channel for channel in task.channels}
    unknown_names = [name for name in requested if name.lower() not in known]
    if unknown_names or not task.channels:
        raise Refusal(DAQmxErrors.CHAN_NOT_IN_TASK, ", ".join(unknown_names)[:60])
    return [known[name.lower()] for name in requested] or task.channels


def of_channel(task: Task, names: str, number: int) -> Any:
    """Return an attribute of a channel; of several named channels, or of all, the value must be the same."""
    table = ANY_CHANNEL | (INPUT_CHANNEL if task.kind == INPUT else OUTPUT_CHANNEL)
    chosen = channels_of(task, names)
    if number not in table:
        raise unknown("channel", number)
    values = [table[number](task, channel) for channel in chosen]
    if number == _PHYSICAL_CHANNEL:
        return ", ".join(values)
    if any(value != values[0] for value in values):
        raise Refusal(DAQmxErrors.ATTRIBUTE_INCONSISTENT_ACROSS_CHANNELS_ON_DEVICE, f"0x{number:04X}")
    return values[0]

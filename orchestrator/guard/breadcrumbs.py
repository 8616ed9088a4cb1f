"""Notes that outlive a process: the FMI call under way, its time, and the last log lines.

They lie in a file that two processes map. When an FMU takes its process down, or hangs, the other process reads the
last call. A call is noted in one of two ways. A note before every call is exact; in Python it takes a quarter of the
time of an impact, in C it is a store. Looking at the frames of the running thread now and then shows a hanging call,
at no cost.
"""

from __future__ import annotations

import ctypes
import math
import mmap
import struct
from pathlib import Path
from types import FrameType
from typing import Any

from vibroimpact.orchestrator.fmi.instance import Instance, Wrapper
from vibroimpact.orchestrator.fmi.library import Function
from vibroimpact.orchestrator.fmi.log import NO_LINES, RING_SIZE, LogTail
from vibroimpact.orchestrator.fmi.variables import VariableGroup
from vibroimpact.orchestrator.importer.adaptive.chosen_loop import ChosenLoop
from vibroimpact.orchestrator.importer.plain_loop import PlainLoop
from vibroimpact.orchestrator.importer.wiring import CallList

MOST_COMPONENTS = 32
MOST_CALLS = 4096
NAME_LENGTH = 96
#: Noted function of a component while its FMU is being loaded.
LOADING = "loading"
#: FMI's functions, by the methods of an instance that call them.
METHODS = {
    "step": "DoStep",
    "_awaited": "DoStep",
    "_instantiate": "Instantiate",
    "enter_initialization": "EnterInitializationMode",
    "exit_initialization": "ExitInitializationMode",
    "reset": "Reset",
    "terminate": "Terminate",
    "free": "FreeInstance",
    "save": "GetFMUState",
    "restore": "SetFMUState",
    "set_clocks": "SetClock",
    "has_ticked": "GetClock",
    "clock_interval": "GetIntervalDecimal",
    "clock_shift": "GetShiftDecimal",
    "directional_derivative": "GetDirectionalDerivative",
}


class _Notes(ctypes.Structure):
    _fields_ = [
        ("call", ctypes.c_int64),  # 1-based; 0: none yet
        ("time", ctypes.c_double),
        ("calls", ctypes.c_int64),
        ("components", ctypes.c_int64),
        ("names", (ctypes.c_char * NAME_LENGTH) * MOST_CALLS),
        ("owners", ctypes.c_int32 * MOST_CALLS),
    ]


#: The first two fields without a call.
_NO_CALL = struct.pack("=qd", 0, math.nan)
SIZE = ctypes.sizeof(_Notes) + MOST_COMPONENTS * RING_SIZE


class Breadcrumbs:
    """The notes of one process, mapped from a file that `create` has made."""

    def __init__(self, path: Path) -> None:
        with path.open("r+b") as file:
            self._memory = mmap.mmap(file.fileno(), SIZE)
        self._notes = _Notes.from_buffer(self._memory)
        self._known: dict[str, int] = {}
        self._numbers: dict[tuple[str, str], int] = {}
        self._tails: dict[int, LogTail] = {}

    @staticmethod
    def create(path: Path) -> None:
        """Make an empty file of notes, of `SIZE` bytes."""
        path.write_bytes(bytes(SIZE))

    # ---- written by the process that runs FMUs ----

    def log(self, component: str) -> LogTail:
        """Return a log tail for a component that both processes see: one tail for all its instances.

        It is called just before the component's FMU is loaded, which is noted.
        """
        index = self._known.setdefault(component, len(self._known))
        self._notes.components = len(self._known)
        self._notes.call = self._register(component, LOADING)
        return self._tail(index)

    def _tail(self, index: int) -> LogTail:
        place = min(index, MOST_COMPONENTS - 1)
        if place not in self._tails:
            start = ctypes.sizeof(_Notes) + place * RING_SIZE
            self._tails[place] = LogTail(memoryview(self._memory)[start : start + RING_SIZE])
        return self._tails[place]

    def wrap(self, component: str) -> Wrapper:
        """Return the wrapper of a component's functions: each call is noted before it is made."""

        return _ComponentNotes(self, component)

    def noted(self, component: str, name: str, function: Function) -> Function:
        """Return a component's function that notes each call before it is made."""
        noting = self._noting_step if name.endswith("DoStep") else self._noting
        return noting(self.number_of(component, name), function)

    def address_of(self, field: str) -> int:
        """Return the address of the note `call` or `time`, for C code that makes calls itself."""
        return ctypes.addressof(self._notes) + int(getattr(_Notes, field).offset)

    def number_of(self, component: str, name: str) -> int:
        """Return the number that stands for a component's function in the notes."""
        return self._register(component, name)

    def _register(self, component: str, name: str) -> int:
        notes = self._notes
        known = self._numbers.get((component, name))
        if known is not None:
            return known
        index = min(int(notes.calls), MOST_CALLS - 1)
        notes.names[index].value = f"{component}\n{name}".encode()[: NAME_LENGTH - 1]
        notes.owners[index] = self._known.get(component, 0)
        notes.calls = self._numbers[component, name] = index + 1
        return index + 1

    def _noting(self, number: int, function: Function) -> Function:
        notes = self._notes

        def noted(*arguments: Any) -> Any:
            notes.call = number
            return function(*arguments)

        return noted

    def _noting_step(self, number: int, function: Function) -> Function:
        notes = self._notes

        def noted(instance: Any, time: Any, *rest: Any) -> Any:
            notes.call = number
            notes.time = time.value
            return function(instance, time, *rest)

        return noted

    def begin(self) -> None:
        """Forget the previous point: its last call, its time and its log lines.

        The process that runs points calls this before each point; the other process may call it while the first one
        waits.
        """
        # bytes, not fields: this runs once a point on cold memory, where ctypes takes five times as long
        self._memory[: len(_NO_CALL)] = _NO_CALL
        for place in range(min(int(self._notes.components), MOST_COMPONENTS)):
            start = ctypes.sizeof(_Notes) + place * RING_SIZE
            self._memory[start : start + len(NO_LINES)] = NO_LINES

    def note_frame(self, frame: FrameType | None) -> None:
        """Note the FMI call of a thread from its frames; without one the notes stay as they are."""
        while frame is not None:
            found = _call_in(frame)
            if found is not None:
                instance, function, time = found
                number = self._register(instance.name, instance.prefix + function)
                self._notes.time = time
                self._notes.call = number
                return
            frame = frame.f_back

    # ---- read by the other process ----

    def last_call(self) -> tuple[str, str, float]:
        """Return instance, function and time (s) of the last noted call; empty names without one."""
        index = int(self._notes.call) - 1
        if index < 0:
            return "", "", math.nan
        instance, _, function = self._notes.names[index].value.decode("utf-8", "replace").partition("\n")
        return instance, function, float(self._notes.time)

    def last_lines(self) -> tuple[str, ...]:
        """Return the last log lines of the component of the last call."""
        index = int(self._notes.call) - 1
        return self._tail(self._notes.owners[index]).take() if index >= 0 else ()


class _ComponentNotes:
    """Wraps the functions of one component: each call is noted before it is made, by C code as well (`CallNotes`)."""

    def __init__(self, notes: Breadcrumbs, component: str) -> None:
        self._notes, self._component = notes, component
        self.call_address, self.time_address = notes.address_of("call"), notes.address_of("time")

    def __call__(self, name: str, function: Function) -> Function:
        return self._notes.noted(self._component, name, function)

    def number_of(self, name: str) -> int:
        """Return the number that stands for a function in the notes."""
        return self._notes.number_of(self._component, name)


def _time_of(instance: Instance, function: str) -> float:
    """Return the time of a call, s; NaN for instantiation, before any run."""
    if function == METHODS["_instantiate"]:
        return math.nan
    return instance.step_start if function == METHODS["step"] else instance.time


def _call_in(frame: FrameType) -> tuple[Instance, str, float] | None:
    """Return instance, function and time (s) of the FMI call in a frame, or None."""
    owner, method = frame.f_locals.get("self"), frame.f_code.co_name
    if isinstance(owner, PlainLoop) and method == "advance":
        return owner.call_under_way()
    if isinstance(owner, ChosenLoop) and method == "try_step":
        return owner.plain.call_under_way()
    found = _python_call_in(frame, owner, method)
    return None if found is None else (*found, _time_of(*found))


def _python_call_in(frame: FrameType, owner: object, method: str) -> tuple[Instance, str] | None:
    if isinstance(owner, Instance) and method in METHODS:
        return owner, METHODS[method]
    if isinstance(owner, VariableGroup) and method in ("get", "set", "try_get", "try_set"):
        instance = owner.instance
        return (instance, method[-3:].capitalize() + owner.name) if isinstance(instance, Instance) else None
    if isinstance(owner, CallList):
        found = owner.find(frame.f_locals.get("call"))
        return (found.instance, found.function) if found is not None else None
    return None

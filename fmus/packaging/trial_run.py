"""One run of a component's library, as an export describes it, with a report of its results.

It runs in a separate process: a library that ends its process ends no other.
"""

from __future__ import annotations

import math
from ctypes import CDLL, CFUNCTYPE, byref, c_bool, c_char_p, c_double, c_int, c_size_t, c_uint32, c_void_p
from itertools import pairwise
from typing import Any

OK, WARNING = 0, 1
#: Name of the instance; its messages begin with it.
INSTANCE = "trial"
Log = CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)


class LibraryError(Exception):
    """A call failed; the text is the library's message."""


class Instance:
    """An instance of FMI 3.0 for co-simulation, of `library`, `token`, `resources` (a folder) and `event_mode`."""

    def __init__(self, facts: dict[str, Any]) -> None:
        self.messages: list[tuple[int, str]] = []
        self._library = CDLL(facts["library"])
        self._log = Log(
            lambda _, level, __, text: self.messages.append((level, text.decode(errors="replace")))
        )
        self._event_mode = bool(facts["event_mode"])
        function = self._library.fmi3InstantiateCoSimulation
        function.restype = c_void_p
        head = (c_char_p(INSTANCE.encode()), c_char_p(facts["token"].encode()))
        # an absolute path with a separator at its end; log messages go into the answer
        resources = c_char_p(facts["resources"].encode() + b"/")
        flags = (c_bool(False), c_bool(True), c_bool(self._event_mode), c_bool(True))
        found = function(*head, resources, *flags, None, c_size_t(0), None, self._log, None)
        if not found:
            raise LibraryError(self._last_message())
        self._instance = c_void_p(found)

    def initialize(self, start: float, stop: float) -> None:
        """Initialize the instance without setting any value."""
        times = (c_bool(False), c_double(0.0), c_double(start), c_bool(True), c_double(stop))
        self._call("EnterInitializationMode", *times)
        self._call("ExitInitializationMode")
        if self._event_mode:
            answers = [byref(c_bool()) for _ in range(5)]
            self._call("UpdateDiscreteStates", *answers, byref(c_double()))
            self._call("EnterStepMode")

    def step(self, time: float, size: float) -> bool:
        """Take a step; return whether it reached its end without an event to answer."""
        event, end, early = c_bool(), c_bool(), c_bool()
        flags = (byref(event), byref(end), byref(early))
        self._call("DoStep", c_double(time), c_double(size), c_bool(True), *flags, byref(c_double()))
        return not (event.value or end.value or early.value)

    def values(self, references: list[int]) -> list[float]:
        """Return the values of real variables."""
        count = len(references)
        numbers = (c_double * count)()
        self._call("GetFloat64", (c_uint32 * count)(*references), c_size_t(count), numbers, c_size_t(count))
        return list(numbers)

    def free(self) -> None:
        """End the instance."""
        self._call("Terminate")
        function = self._library.fmi3FreeInstance
        function.restype = None
        function(self._instance)

    def _call(self, name: str, *arguments: Any) -> None:
        status = getattr(self._library, f"fmi3{name}")(self._instance, *arguments)
        if status not in (OK, WARNING):
            raise LibraryError(self._last_message() or f"fmi3{name} failed")

    def _last_message(self) -> str:
        return self.messages[-1][1] if self.messages else ""


def trial(facts: dict[str, Any]) -> dict[str, Any]:
    """Return the results of a run of an instance.

    The facts are those of an `Instance`, with `start` and `stop`, s, and `intervals`, the number of equal steps.
    `references` are the value references of real variables. In the answer, `refusal` is the reason for no run, `ended`
    the reason for an end before the stop time; both may be empty. `warnings` are the logged warnings. `rows` are the
    time and the values at each communication point.
    """
    answer: dict[str, Any] = {"refusal": "", "ended": "", "warnings": [], "rows": []}
    start, stop, intervals = facts["start"], facts["stop"], facts["intervals"]
    times = [start + (stop - start) * k / intervals for k in range(intervals + 1)]
    try:
        instance = Instance(facts)
        instance.initialize(start, stop)
    except LibraryError as error:
        return answer | {"refusal": str(error)}
    answer["warnings"] = [text for level, text in instance.messages if level == WARNING]
    try:
        answer["rows"].append([start, *instance.values(facts["references"])])
        for time, end in pairwise(times):
            if not instance.step(time, end - time):
                return answer | {"ended": "a step ended early"}
            row = instance.values(facts["references"])
            if not all(map(math.isfinite, row)):
                return answer | {"ended": "a value is no finite number"}
            answer["rows"].append([end, *row])
        instance.free()
    except LibraryError as error:
        return answer | {"ended": str(error)}
    return answer

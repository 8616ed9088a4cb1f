"""The functions of an FMU elsewhere: they take the arguments of the C functions, as prebound ctypes objects.

Calls without results wait for the next call with one, and go with it. Values that were read after a batch are read
along with the next batch of the same functions. So a step with its inputs and outputs is one batch, mostly.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any

from vibroimpact.fmus.errors import ComponentFileError
from vibroimpact.orchestrator.fmi.library import Function
from vibroimpact.orchestrator.remote.protocol import SCALARS, STATE_WORDS, VALUES, Call

OK, WARNING = 0, 1
#: Functions without results besides their status, which wait for the next call.
WAITING = (
    "SetupExperiment",
    "EnterInitializationMode",
    "EnterEventMode",
    "EnterStepMode",
    "SetString",
    "SetClock",
)
STEPPING, NOT_STEPPING = ("DoStep", "EnterStepMode"), ("EnterInitializationMode", "EnterEventMode", "Reset")
Send = Callable[[list[Any]], Any]


class RemoteFunctions:
    """The functions of one instance, by FMI's names without prefix.

    Parameters
    ----------
    version : str
        `3.0` or `2.0`.
    send : callable
        Sends calls, and returns their results up to the first that failed.
    refuse : callable
        Raises the error of a call that has waited and failed, given its status and function.
    """

    def __init__(self, version: str, send: Send, refuse: Callable[[int, str], None]) -> None:
        self._values, self._scalars = VALUES[version], SCALARS[version]
        self._with_count = version == "3.0"
        self._state_word = STATE_WORDS[version]
        self._send, self._refuse = send, refuse
        self._waiting: list[Any] = []
        self._slots = 0
        self._read: dict[bytes, Any] = {}  # results of reading calls that are still valid
        self._follow: dict[tuple[str, ...], dict[bytes, Any]] = {}  # reading calls that followed a batch
        self._following: dict[bytes, Any] = {}  # those since the last batch, up to a change
        self._has_changed = False  # a call waits that may change values
        self._is_stepping = False  # neither an event nor initialization goes on, in which more can be read
        self._at_once = False
        self._texts: Any = None  # memory of the texts that were read last

    @contextmanager
    def at_once(self) -> Iterator[None]:
        """Send each call at once, so that its own status is returned."""
        self._at_once = True
        try:
            yield
        finally:
            self._at_once = False

    def named(self, name: str) -> Function:
        """Return a function; ComponentFileError if no importer here calls it."""
        if name in self._scalars:
            return partial(self._call_scalars, name, self._scalars[name][0])
        verb, rest = name[:3], name[3:]
        if rest in self._values and verb in ("Get", "Set"):
            return partial(self._get if verb == "Get" else self._set, name, self._values[rest])
        word = self._state_word
        others: dict[str, Function] = {
            "GetString": self._get_string,
            "SetString": self._set_string,
            "SetClock": self._set_clock,
            "GetClock": partial(self._ask_clock, "GetClock"),
            "GetIntervalDecimal": partial(self._ask_clock, "GetIntervalDecimal"),
            "GetShiftDecimal": partial(self._ask_clock, "GetShiftDecimal"),
            "GetDirectionalDerivative": self._derivative,
            f"Get{word}": partial(self._save, f"Get{word}"),
            f"Set{word}": partial(self._restore, f"Set{word}"),
            f"Free{word}": partial(self._free, f"Free{word}"),
        }
        if name not in others:
            raise ComponentFileError(f"{name}: expected a function that is called on a server, got another.")
        return others[name]

    # ---- sending ----

    def _later(self, call: Any) -> int:
        """Let a call wait, which may change values; returns its status if it must be known at once."""
        self._read.clear()
        self._has_changed = True
        self._waiting.append(call)
        return self._flushed([]).status if self._at_once else OK

    def _flushed(self, more: list[Any]) -> Any:
        """Send the waiting calls, perhaps another, and reading calls that will follow; return the last one's result."""
        waiting, self._waiting, self._has_changed = self._waiting, [], False
        calls = [*waiting, *more]
        batch = tuple(call.function for call in calls)
        own = more[0].SerializeToString() if more else b""
        follow = self._follow.get(batch, {}) if self._is_stepping else {}
        reads = [(key, call) for key, call in follow.items() if key != own]
        self._following = self._follow[batch] = {}
        results = self._send([*calls, *(call for _, call in reads)])
        last = len(calls) - 1
        if len(results) <= last:  # a call that has waited failed, and was the last to be made
            failed = len(results) - 1
            self._refuse(results[failed].status, calls[failed].function)
        for (key, _), result in zip(reads, results[last + 1 :], strict=False):
            self._read[key] = result
        return results[last]

    def _now(self, call: Any) -> Any:
        """Send a call that changes values, and return its result."""
        self._read.clear()
        return self._flushed([call])

    # ---- kinds of functions ----

    def _call_scalars(self, name: str, given: str, _: Any, *arguments: Any) -> int:
        call = Call(function=name, numbers=[argument.value for argument in arguments[: len(given)]])
        self._is_stepping = (self._is_stepping or name in STEPPING) and name not in NOT_STEPPING
        if name in WAITING:
            return self._later(call)
        result = self._now(call)
        return _taken(result, arguments[len(given) :])

    def _get(
        self, name: str, kind: Any, _: Any, places: Any, count: Any, address: Any, size: Any = None
    ) -> int:
        length = (count if size is None else size).value
        call = Call(function=name, references=_references(places, count), size=length)
        key = call.SerializeToString()
        if self._is_stepping and not self._has_changed:
            self._following[key] = call
        result = self._read.get(key)
        if result is None:
            result = self._read[key] = self._flushed([call])
        if result.status <= WARNING:
            _copy(address, result.values, length * ctypes.sizeof(kind))
        return int(result.status)

    def _set(
        self, name: str, kind: Any, _: Any, places: Any, count: Any, address: Any, size: Any = None
    ) -> int:
        length = (count if size is None else size).value
        values = ctypes.string_at(address.value, length * ctypes.sizeof(kind)) if length else b""
        return self._later(
            Call(function=name, references=_references(places, count), size=length, values=values)
        )

    def _set_string(self, _: Any, place: Any, count: Any, texts: Any, *size: Any) -> int:
        given = [text.decode() for text in texts]
        return self._later(
            Call(function="SetString", references=_references(place, count), size=len(given), texts=given)
        )

    def _get_string(self, _: Any, places: Any, count: Any, address: Any, size: Any = None) -> int:
        length = (count if size is None else size).value
        result = self._flushed(
            [Call(function="GetString", references=_references(places, count), size=length)]
        )
        if result.status <= WARNING:
            if len(result.texts) != length:
                raise ComponentFileError(
                    f"an answer of a server: expected {length} texts, got {len(result.texts)}."
                )
            self._texts = (ctypes.c_char_p * length)(*(text.encode() for text in result.texts))
            ctypes.memmove(address.value, self._texts, ctypes.sizeof(self._texts))
        return int(result.status)

    def _set_clock(self, _: Any, places: Any, count: Any, ticks: Any) -> int:
        return self._later(Call(function="SetClock", references=_references(places, count)))

    def _ask_clock(self, name: str, _: Any, place: Any, count: Any, *results: Any) -> int:
        result = self._flushed([Call(function=name, references=_references(place, count))])
        return _taken(result, results)

    def _derivative(
        self, _: Any, unknowns: Any, count: Any, knowns: Any, one: Any, seed: Any, *rest: Any
    ) -> int:
        places = [argument for argument in rest if isinstance(argument, ctypes.c_void_p)]
        call = Call(
            function="GetDirectionalDerivative",
            references=_references(unknowns, count),
            others=_references(knowns, one),
            numbers=[seed._obj.value],
            size=count.value,
        )
        result = self._flushed([call])
        if result.status <= WARNING:
            _copy(places[0], result.values, 8 * count.value)
        return int(result.status)

    # ---- states ----

    def _save(self, name: str, _: Any, slot: Any) -> int:
        place = slot._obj
        if not place.value:
            self._slots += 1
            place.value = self._slots
        self._waiting.append(Call(function=name, slot=place.value))  # no value changes
        return OK

    def _restore(self, name: str, _: Any, slot: Any) -> int:
        return self._later(Call(function=name, slot=slot.value or 0))

    def _free(self, name: str, _: Any, slot: Any) -> int:
        if slot._obj.value:
            self._waiting.append(Call(function=name, slot=slot._obj.value))
            slot._obj.value = None
        return OK


def _taken(result: Any, places: Sequence[Any]) -> int:
    """Write the numbers of a result to their places, and return its status; a failed call may have none."""
    numbers = list(result.numbers)
    if result.status <= WARNING or numbers:
        kinds = [type(place._obj) for place in places]
        whole = [number for kind, number in zip(kinds, numbers, strict=False) if kind is not ctypes.c_double]
        if len(numbers) != len(places) or not all(abs(number) < 2.0**31 for number in whole):
            raise ComponentFileError(f"an answer of a server: expected {len(places)} numbers, got others.")
        for kind, place, number in zip(kinds, places, numbers, strict=True):
            place._obj.value = number if kind is ctypes.c_double else int(number)
    return int(result.status)


def _references(places: Any, count: Any) -> list[int]:
    """Return value references: an array, or a ctypes reference to an array or to one of them."""
    owner = getattr(places, "_obj", places)
    return list(owner)[: count.value] if isinstance(owner, ctypes.Array) else [owner.value]


def _copy(address: Any, values: bytes, size: int) -> None:
    """Copy values into a buffer of `size` bytes; raise ComponentFileError for another number of bytes."""
    if len(values) != size:
        raise ComponentFileError(
            f"an answer of a server: expected {size} bytes of values, got {len(values)}."
        )
    if size:
        ctypes.memmove(address.value, values, size)

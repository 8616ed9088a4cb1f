"""Calls of an FMU by messages: each is checked, made, and answered."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Sequence
from ctypes import c_bool, c_char_p, c_double, c_int, c_size_t, c_uint32, c_void_p
from functools import partial
from typing import Any

from google.protobuf.message import DecodeError

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.fmus.packaging.archive import UnpackedFmu
from vibroimpact.orchestrator.fmi.instance import FATAL, WARNING, Wrapper
from vibroimpact.orchestrator.fmi.instance2 import Instance2
from vibroimpact.orchestrator.fmi.instance3 import Instance3
from vibroimpact.orchestrator.fmi.library import Function, Library
from vibroimpact.orchestrator.fmi.log import LogTail
from vibroimpact.orchestrator.fmi.rounding import is_usual, set_usual
from vibroimpact.orchestrator.remote.protocol import (
    CODES,
    INSTANTIATE,
    LARGEST_REQUEST,
    MOST_CALLS,
    MOST_VALUES,
    SCALARS,
    STATE_WORDS,
    VALUES,
    Answer,
    Batch,
    Result,
)

#: Functions after which the rounding mode is set back, as in an importer.
ROUNDING_AFTER = ("DoStep", "ExitInitializationMode")


class Refused(Exception):
    """A call that is not made; the text says why."""


class ServedInstance:
    """One instance of an FMU, called by messages.

    Parameters
    ----------
    fmu : UnpackedFmu
    log : LogTail
        Receives its log lines.
    wrap : callable
        Wraps each function of the FMU, given its name.
    """

    def __init__(self, fmu: UnpackedFmu, log: LogTail, wrap: Wrapper) -> None:
        self._fmu, self._log, self._wrap = fmu, log, wrap
        version = "3.0" if fmu.fmi_version.startswith("3") else "2.0"
        self._is_3, self._values, self._scalars = version == "3.0", VALUES[version], SCALARS[version]
        self._prefix = "fmi3" if self._is_3 else "fmi2"
        self._functions: dict[str, Function] = {}
        self._states: dict[int, c_void_p] = {}
        self._instance: Instance2 | Instance3 | None = None
        self._is_fatal = False
        word = STATE_WORDS[version]
        self._others: dict[str, Callable[[Any], Any]] = {
            INSTANTIATE: self._instantiate,
            "GetString": self._get_string,
            "SetString": self._set_string,
            "SetClock": self._set_clock,
            "GetDirectionalDerivative": self._derivative,
            f"Get{word}": self._save,
            f"Set{word}": self._restore,
            f"Free{word}": self._free_state,
        }
        if self._is_3:
            self._others["GetClock"] = partial(self._clock, (c_bool,))
            self._others["GetIntervalDecimal"] = partial(self._clock, (c_double, c_int))
            self._others["GetShiftDecimal"] = partial(self._clock, (c_double,))

    def answer(self, data: bytes) -> tuple[bytes, bool]:
        """Make the calls of a batch up to the first that fails; return the answer, and whether others may follow."""
        answer = Answer()
        try:
            self._make(_batch_in(data), answer)
        except (Refused, ComponentError) as refusal:
            answer.refusal = " ".join(str(refusal).split()).encode("utf-8", "replace").decode()
        answer.log.extend(self._log.take())
        return answer.SerializeToString(), not answer.refusal and not self._is_fatal

    def _make(self, batch: Any, answer: Any) -> None:
        if sum(call.size for call in batch.calls) > MOST_VALUES:
            raise Refused(f"expected calls for at most {MOST_VALUES} values in all, got more.")
        for call in batch.calls:
            result = self._made(call)
            answer.results.append(result)
            if call.function in ROUNDING_AFTER and not is_usual():
                set_usual()
                answer.changed_rounding = True
            self._is_fatal = self._is_fatal or result.status == FATAL
            if result.status > WARNING or result.status < 0:
                return
        if self._instance is not None and self._instance.changed_rounding:
            answer.changed_rounding = True

    def _made(self, call: Any) -> Any:
        name = call.function
        if (self._instance is None) != (name == INSTANTIATE):
            raise Refused(f"expected {INSTANTIATE} once, before all other calls, got {name[:40]!r}.")
        if name in self._scalars:
            return self._call_scalars(call, *self._scalars[name])
        if name in self._others:
            return self._others[name](call)
        kind = self._values.get(name[3:])
        if kind is not None and name[:3] == "Get":
            return self._get(call, kind)
        if kind is not None and name[:3] == "Set":
            return self._set(call, kind)
        raise Refused(f"expected a function of FMI that an importer calls, got {name[:40]!r}.")

    def _call(self, call: Any, *arguments: Any) -> int:
        name, instance = call.function, self._instance
        assert instance is not None
        function = self._functions.get(name)
        if function is None:
            bare = Library(self._fmu).function(self._prefix + name)
            function = self._functions[name] = self._wrap(self._prefix + name, bare)
        return int(function(instance.pointer, *arguments))

    # ---- kinds of functions ----

    def _instantiate(self, call: Any) -> Any:
        name = call.texts[0] if call.texts else ""
        flags = [bool(number) for number in call.numbers]
        if len(flags) != 3 or "\0" in name:
            raise Refused("expected a name and three flags for an instance, got others.")
        try:
            if self._is_3:
                self._instance = Instance3(
                    self._fmu,
                    name,
                    event_mode=flags[0],
                    early_return=flags[1],
                    updates=flags[2],
                    log=self._log,
                    wrap=self._wrap,
                )
            else:
                self._instance = Instance2(self._fmu, name, log=self._log, wrap=self._wrap)
        except ComponentError as error:
            if not error.function:  # the library itself does not load
                raise
            self._log.add(error.log)
            return Result(status=1)
        return Result()

    def _call_scalars(self, call: Any, given: str, returned: str) -> Any:
        numbers = list(call.numbers)
        whole = [number for code, number in zip(given, numbers, strict=False) if code != "d"]
        if len(numbers) != len(given) or not all(abs(number) < 2.0**31 for number in whole):
            raise Refused(f"{call.function}: expected {len(given)} numbers, got others.")
        arguments = [
            CODES[code](number if code == "d" else int(number))
            for code, number in zip(given, numbers, strict=True)
        ]
        results = [CODES[code](math.nan if code == "d" else 0) for code in returned]
        status = self._call(call, *arguments, *map(ctypes.byref, results))
        return Result(status=status, numbers=[result.value for result in results])

    def _get(self, call: Any, kind: Any) -> Any:
        values = (kind * max(1, call.size))()
        status = self._call(call, *self._places(call), values, *self._size(call))
        return Result(status=status, values=bytes(values)[: call.size * ctypes.sizeof(kind)])

    def _set(self, call: Any, kind: Any) -> Any:
        if len(call.values) != call.size * ctypes.sizeof(kind):
            raise Refused(f"{call.function}: expected {call.size} values, got {len(call.values)} bytes.")
        data = bytes(map(bool, call.values)) if kind is c_bool else call.values
        values = (kind * max(1, call.size)).from_buffer_copy(data or bytes(ctypes.sizeof(kind)))
        return Result(status=self._call(call, *self._places(call), values, *self._size(call)))

    def _places(self, call: Any) -> tuple[Any, c_size_t]:
        """Return the value references of a call and their number; a call of FMI 2.0 has as many values."""
        count = len(call.references)
        if not self._is_3 and call.size != count:
            raise Refused(f"{call.function}: expected {count} values, got {call.size}.")
        return (c_uint32 * max(1, count))(*call.references), c_size_t(count)

    def _size(self, call: Any) -> tuple[c_size_t, ...]:
        return (c_size_t(call.size),) if self._is_3 else ()

    def _set_string(self, call: Any) -> Any:
        if len(call.texts) != call.size:
            raise Refused(f"SetString: expected {call.size} texts, got {len(call.texts)}.")
        texts = (c_char_p * max(1, call.size))(*(text.encode() for text in call.texts))
        return Result(status=self._call(call, *self._places(call), texts, *self._size(call)))

    def _get_string(self, call: Any) -> Any:
        found = (c_char_p * max(1, call.size))()
        status = self._call(call, *self._places(call), found, *self._size(call))
        if not 0 <= status <= WARNING:
            return Result(status=status)
        if None in found[: call.size]:
            raise Refused(f"GetString: expected {call.size} texts of the FMU, got fewer.")
        # the FMU's memory of a text is copied at once
        return Result(status=status, texts=[text.decode("utf-8", "replace") for text in found[: call.size]])

    def _set_clock(self, call: Any) -> Any:
        count = len(call.references)
        ticks = (c_bool * max(1, count))(*[True] * count)
        places = ((c_uint32 * max(1, count))(*call.references), c_size_t(count))
        return Result(status=self._call(call, *places, ticks))

    def _clock(self, kinds: Sequence[Any], call: Any) -> Any:
        if len(call.references) != 1:
            raise Refused(f"{call.function}: expected one clock, got {len(call.references)}.")
        results = [kind(math.nan if kind is c_double else 0) for kind in kinds]
        place = ctypes.byref(c_uint32(call.references[0]))
        status = self._call(call, place, c_size_t(1), *map(ctypes.byref, results))
        return Result(status=status, numbers=[result.value for result in results])

    def _derivative(self, call: Any) -> Any:
        unknowns, knowns = len(call.references), len(call.others)
        if (knowns, len(call.numbers), call.size) != (1, 1, unknowns) or not unknowns:
            raise Refused("GetDirectionalDerivative: expected one known variable, got another number.")
        found = (c_double * unknowns)(*[math.nan] * unknowns)
        places = ((c_uint32 * unknowns)(*call.references), c_size_t(unknowns))
        known = (ctypes.byref(c_uint32(call.others[0])), c_size_t(1))
        seed = ctypes.byref(c_double(call.numbers[0]))
        last = (seed, c_size_t(1), found, c_size_t(unknowns)) if self._is_3 else (seed, found)
        return Result(status=self._call(call, *places, *known, *last), values=bytes(found))

    # ---- states ----

    def _save(self, call: Any) -> Any:
        if call.slot not in self._states and len(self._states) >= MOST_CALLS:
            raise Refused(f"{call.function}: expected at most {MOST_CALLS} saved states, got another.")
        state = self._states.setdefault(call.slot, c_void_p())
        return Result(status=self._call(call, ctypes.byref(state)))

    def _state(self, call: Any) -> c_void_p:
        state = self._states.get(call.slot)
        if not state:
            raise Refused(f"{call.function}: expected a saved state, got number {call.slot}.")
        return state

    def _restore(self, call: Any) -> Any:
        return Result(status=self._call(call, self._state(call)))

    def _free_state(self, call: Any) -> Any:
        status = self._call(call, ctypes.byref(self._state(call)))
        del self._states[call.slot]
        return Result(status=status)

    def free(self) -> None:
        """Free the saved states and the instance."""
        if self._instance is None or self._is_fatal:
            return
        free_state = Library(self._fmu).function(f"{self._prefix}Free{self._instance.state_word}")
        for state in self._states.values():
            if state:
                free_state(self._instance.pointer, ctypes.byref(state))
        self._instance.free()


def _batch_in(data: bytes) -> Any:
    """Return the batch in a message; raise Refused for other bytes."""
    try:
        batch = Batch.FromString(data)
    except DecodeError:
        raise Refused("expected a batch of calls, got bytes that are no message.") from None
    if len(data) > LARGEST_REQUEST or not 1 <= len(batch.calls) <= MOST_CALLS:
        raise Refused(f"expected 1 to {MOST_CALLS} calls in a batch, got {len(batch.calls)}.")
    return batch

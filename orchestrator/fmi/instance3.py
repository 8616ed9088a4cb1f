"""One instance of an FMI 3.0 co-simulation FMU."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from ctypes import POINTER, c_bool, c_char_p, c_double, c_int, c_size_t, c_uint32, c_void_p

from vibroimpact.fmus.archive import UnpackedFmu
from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.fmi.library import Library
from vibroimpact.orchestrator.fmi.log import LogTail
from vibroimpact.orchestrator.fmi.variables import VariableGroup, buffer_of

OK, WARNING, DISCARD, ERROR, FATAL = range(5)
STATUS_WORDS = ("ok", "warning", "discard", "error", "fatal")

LogCallback = ctypes.CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)


class Instance3:
    """An instance of an FMI 3.0 FMU, driven by prebound calls.

    Parameters
    ----------
    fmu : UnpackedFmu
        The FMU.
    name : str
        Instance name, used in messages.
    event_mode : bool
        Handle events: event mode and early return.
    early_return : bool
        Let the FMU end a step early (always so in event mode).

    Attributes
    ----------
    needs_event_mode, returned_early : bool
        What the last `step` said.
    time : float
        The time reached by the last `step`, s.

    Raises
    ------
    ComponentError
        The FMU refuses to be instantiated. All methods raise it when a call fails, with the last log lines.
    """

    fmi_version = "3.0"

    def __init__(
        self, fmu: UnpackedFmu, name: str, *, event_mode: bool = False, early_return: bool = False
    ) -> None:
        self.fmu = fmu
        self.name = name
        self.log = LogTail()
        self.time = 0.0
        self._library = Library(fmu)
        self._callback = LogCallback(lambda _, status, __, text: self.log.add(status, text))
        self._pointer = self._instantiate(event_mode, event_mode or early_return)
        self._bind_steps()
        self._bind_states()

    def _instantiate(self, event_mode: bool, early_return: bool) -> c_void_p:
        instantiate = self._library.function(
            "fmi3InstantiateCoSimulation",
            *(c_char_p, c_char_p, c_char_p, c_bool, c_bool, c_bool, c_bool),
            *(c_void_p, c_size_t, c_void_p, LogCallback, c_void_p),
            result=c_void_p,
        )
        resources = str(self.fmu.resources) + "/"
        pointer = instantiate(
            self.name.encode(), self.fmu.token.encode(), resources.encode(),
            False, False, event_mode, early_return, None, 0, None, self._callback, None,
        )  # fmt: skip
        if not pointer:
            raise ComponentError(
                f"{self.name}: fmi3InstantiateCoSimulation: {self.fmu.source} did not make an instance. "
                + " ".join(self.log.take()),
                instance=self.name,
                function="fmi3InstantiateCoSimulation",
            )
        return c_void_p(pointer)

    def _bind_steps(self) -> None:
        library, instance = self._library, c_void_p
        self._enter_initialization = library.function(
            "fmi3EnterInitializationMode", instance, c_bool, c_double, c_double, c_bool, c_double
        )
        self._exit_initialization = library.function("fmi3ExitInitializationMode", instance)
        self._enter_event_mode = library.function("fmi3EnterEventMode", instance)
        self._enter_step_mode = library.function("fmi3EnterStepMode", instance)
        self._terminate = library.function("fmi3Terminate", instance)
        self._reset = library.function("fmi3Reset", instance)
        self._free = library.function("fmi3FreeInstance", instance, result=None)
        flags = POINTER(c_bool)
        self._do_step = library.function(
            "fmi3DoStep", instance, c_double, c_double, c_bool, flags, flags, flags, POINTER(c_double)
        )
        self._update = library.function(
            "fmi3UpdateDiscreteStates", instance, flags, flags, flags, flags, flags, POINTER(c_double)
        )
        self._needs_event, self._terminates, self._early = c_bool(), c_bool(), c_bool()
        self._last_time = c_double()
        outputs = (self._needs_event, self._terminates, self._early, self._last_time)
        self._step_outputs = tuple(ctypes.pointer(o) for o in outputs)
        self._event_outputs = tuple(ctypes.pointer(c_bool()) for _ in range(5))
        self._next_event = ctypes.pointer(c_double())

    def _bind_states(self) -> None:
        library, state = self._library, POINTER(c_void_p)
        self._get_state = library.function("fmi3GetFMUState", c_void_p, state)
        self._set_state = library.function("fmi3SetFMUState", c_void_p, c_void_p)
        self._free_state = library.function("fmi3FreeFMUState", c_void_p, state)
        self._state_size = library.function(
            "fmi3SerializedFMUStateSize", c_void_p, c_void_p, POINTER(c_size_t)
        )
        self._serialize = library.function("fmi3SerializeFMUState", c_void_p, c_void_p, c_char_p, c_size_t)
        self._deserialize = library.function("fmi3DeserializeFMUState", c_void_p, c_char_p, c_size_t, state)

    def check(self, status: int, function: str) -> None:
        """Raise ComponentError when `status` is worse than a warning."""
        if status > WARNING:
            word = STATUS_WORDS[status] if 0 <= status < len(STATUS_WORDS) else f"status {status}"
            lines = self.log.take()
            reason = lines[-1] if lines else "the component logged nothing"
            raise ComponentError(
                f"{self.name}: fmi3{function} returned {word} at time {self.time:.17g}: {reason}",
                instance=self.name,
                function=f"fmi3{function}",
                time=self.time,
                log=lines,
            )

    def group(self, kind: str, references: Sequence[int], size: int | None = None) -> VariableGroup:
        """Return a group of variables of type `kind` (Float64, Int64, Int32, Boolean), moved in one call.

        `size` is the number of values when some variables are arrays.
        """
        types = (c_void_p, POINTER(c_uint32), c_size_t, c_void_p, c_size_t)
        return VariableGroup(
            kind,
            self._library.function(f"fmi3Get{kind}", *types),
            self._library.function(f"fmi3Set{kind}", *types),
            self._pointer,
            references,
            buffer_of(kind, len(references) if size is None else size),
            self.check,
            with_value_count=True,
        )

    # ---- life ----

    def enter_initialization(self, start_time: float) -> None:
        """Enter initialization mode at `start_time`, s."""
        self.time = start_time
        self.check(
            self._enter_initialization(self._pointer, False, 0.0, start_time, False, 0.0),
            "EnterInitializationMode",
        )

    def exit_initialization(self) -> None:
        """Leave initialization mode; the FMU checks its parameters here."""
        self.check(self._exit_initialization(self._pointer), "ExitInitializationMode")

    def reset(self) -> None:
        """Go back to the state after instantiation: the instance is ready for another run."""
        self.check(self._reset(self._pointer), "Reset")

    def terminate(self) -> None:
        """End the run."""
        self.check(self._terminate(self._pointer), "Terminate")

    def free(self) -> None:
        """Give the instance's memory back; it must not be used afterwards."""
        if self._pointer:
            self._free(self._pointer)
            self._pointer = c_void_p()

    # ---- steps and events ----

    def step(self, time: float, size: float) -> int:
        """Advance from `time` by `size`, s; returns the status, which is OK, WARNING or DISCARD.

        `self.time`, `self.needs_event_mode` and `self.returned_early` say what happened.
        """
        status: int = self._do_step(self._pointer, time, size, False, *self._step_outputs)
        if status > WARNING and status != DISCARD:
            self.check(status, "DoStep")
        self.time = self._last_time.value
        return status

    @property
    def needs_event_mode(self) -> bool:
        """Does the FMU ask for event mode after the last step?"""
        return self._needs_event.value

    @property
    def returned_early(self) -> bool:
        """Did the last step end before its end?"""
        return self._early.value

    @property
    def wants_to_end(self) -> bool:
        """Does the FMU ask for the end of the simulation?"""
        return self._terminates.value

    def enter_event_mode(self) -> None:
        """Enter event mode at the present time."""
        self.check(self._enter_event_mode(self._pointer), "EnterEventMode")

    def enter_step_mode(self) -> None:
        """Leave event mode."""
        self.check(self._enter_step_mode(self._pointer), "EnterStepMode")

    def update_discrete_states(self) -> bool:
        """One event iteration; returns whether the FMU needs another."""
        outputs = self._event_outputs
        status = self._update(self._pointer, *outputs, self._next_event)
        if status > WARNING:
            self.check(status, "UpdateDiscreteStates")
        return outputs[0].contents.value

    # ---- states ----

    def save(self, slot: c_void_p) -> None:
        """Save the state into `slot`, which is allocated at first use and used again later."""
        status = self._get_state(self._pointer, ctypes.byref(slot))
        if status > WARNING:
            self.check(status, "GetFMUState")

    def restore(self, slot: c_void_p) -> None:
        """Go back to a saved state."""
        status = self._set_state(self._pointer, slot)
        if status > WARNING:
            self.check(status, "SetFMUState")

    def free_state(self, slot: c_void_p) -> None:
        """Give a saved state's memory back."""
        self.check(self._free_state(self._pointer, ctypes.byref(slot)), "FreeFMUState")

    def serialize(self, slot: c_void_p) -> bytes:
        """Return a saved state as bytes, for another process."""
        size = c_size_t()
        self.check(self._state_size(self._pointer, slot, ctypes.byref(size)), "SerializedFMUStateSize")
        buffer = ctypes.create_string_buffer(size.value)
        self.check(self._serialize(self._pointer, slot, buffer, size), "SerializeFMUState")
        return buffer.raw

    def deserialize(self, data: bytes) -> c_void_p:
        """Return a saved state made from bytes of `serialize`."""
        slot = c_void_p()
        self.check(
            self._deserialize(self._pointer, data, len(data), ctypes.byref(slot)), "DeserializeFMUState"
        )
        return slot

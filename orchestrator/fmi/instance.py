"""The common interface of FMI 3.0 and FMI 2.0 instances; the importer uses it alone."""

from __future__ import annotations

import ctypes
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from ctypes import c_double, c_void_p
from functools import partial
from typing import Any, ClassVar, NoReturn, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.errors import ComponentError, ComponentFileError
from vibroimpact.fmus.packaging.archive import UnpackedFmu
from vibroimpact.orchestrator.fmi.library import Function, Library
from vibroimpact.orchestrator.fmi.log import LogTail
from vibroimpact.orchestrator.fmi.rounding import is_usual, set_usual
from vibroimpact.orchestrator.fmi.variables import DTYPES, TextGroup, VariableGroup

OK, WARNING, DISCARD, ERROR, FATAL, PENDING = range(6)
#: noSetFMUStatePriorToCurrentPoint of every step but the second half of a step on trial. An importer here restores only
#: states saved at the start of the step or later. With false, some FMUs repeat a last step that was not accepted.
NO_STATE_PRIOR_TO_POINT = True
STATUS_WORDS = ("ok", "warning", "discard", "error", "fatal", "pending")

#: Largest error of the end time that an FMU reports for a step: relative to 1 + |time|, and to the step.
TIME_ROUNDING = 1e-9
STEP_ROUNDING = 1e-6

#: Largest relative difference of a step from the one size that an FMU accepts: the rounding of long times.
SAME_SIZE = STEP_ROUNDING

#: Wraps a function of an FMU, given its name: for a guard that notes the call under way.
Wrapper = Callable[[str, Function], Function]
LogOf = Callable[[str], LogTail]
WrapOf = Callable[[str], Wrapper]
"""`LogOf` and `WrapOf` return a component's log tail, or the wrapper of its functions, by its name."""


@runtime_checkable
class CallNotes(Protocol):
    """A wrapper that only notes the call under way; C code that makes calls can note it itself.

    Attributes
    ----------
    call_address, time_address : int
        Addresses of a call's number, a 64-bit integer, and of the time of a step's start, a double.
    """

    call_address: int
    time_address: int

    def __call__(self, name: str, function: Function) -> Function:
        """Return a function that notes its calls."""

    def number_of(self, name: str) -> int:
        """Return the number that stands for a function in the notes."""


class Instance(ABC):
    """One instance of a co-simulation FMU, driven by prebound calls.

    Parameters
    ----------
    fmu : UnpackedFmu
        The FMU.
    name : str
        Instance name, used in messages.
    log : LogTail or None
        Receives its log lines; None: a tail of its own.
    wrap : callable or None
        Wraps each function of the FMU that is bound.

    Attributes
    ----------
    state_word : str
        FMI's word for a saved state in the names of its functions; the versions spell it differently.
    time : float
        The time reached by the last `step`, s.
    internal_step : float
        Declared step of the FMU's own solver, s; 0: none. The FMU's steps end at multiples of it.
    only_step : float
        The only size of its steps, s; 0: any.
    changed_rounding : bool
        The FMU has changed the rounding mode of the process, or the treatment of subnormal numbers; it was set back.
    is_fatal : bool
        A call returned fatal: no function of the FMU may be called any more.
    needs_event_mode, returned_early, wants_to_end : bool
        Flags of the last `step` (in FMI 2.0 only `wants_to_end`).
    is_flagged : bool
        Any of these three.
    no_state_prior : c_bool or c_int
        Argument of the next steps: no state saved before their start will be restored.
    """

    no_state_prior: ctypes.c_bool | ctypes.c_int
    fmi_version: ClassVar[str]
    prefix: ClassVar[str]
    state_word: ClassVar[str]
    type_names: ClassVar[Mapping[str, str]] = {}
    """Names of types in the names of functions, if they differ from FMI 3.0's."""
    runs_here: ClassVar[bool] = True
    """Its functions run in this process, so that C code can call them."""
    group_type: ClassVar[type[VariableGroup]] = VariableGroup
    lacks_states: ComponentFileError | None = None
    """The error of a binary without functions of states, None if it has them."""

    def __init__(
        self, fmu: UnpackedFmu, name: str, *, log: LogTail | None = None, wrap: Wrapper | None = None
    ) -> None:
        self.fmu = fmu
        self.name = name
        self.log = log or LogTail()
        self.time = 0.0
        self.needs_event_mode = self.returned_early = self.wants_to_end = self.is_flagged = False
        self.is_fatal = False
        self.internal_step = self.only_step = 0.0
        self.changed_rounding = False
        self._load(fmu)
        self.wrap = wrap
        self._pointer = c_void_p()
        self._step_time, self._step_size = c_double(), c_double()
        self._do_step: Callable[[], int]

    # ---- binding ----

    def _load(self, fmu: UnpackedFmu) -> None:
        self._library = Library(fmu)

    def _function(self, name: str, result: Any = ctypes.c_int) -> Function:
        found = self._library.function(self.prefix + name, result)
        return found if self.wrap is None else self.wrap(self.prefix + name, found)

    def _bound(self, name: str, *arguments: Any) -> Callable[[], int]:
        return partial(self._function(name), self._pointer, *arguments)

    @property
    def pointer(self) -> c_void_p:
        """The instance, for C code that calls the functions of its FMU itself."""
        return self._pointer

    def address_of(self, name: str) -> c_void_p:
        """Return the address of a function of the FMU, for C code that calls it."""
        function: Any = self._library.function(self.prefix + name)
        return ctypes.cast(function, c_void_p)

    def call_of(self, name: str) -> tuple[int | None, int | None]:
        """Return the address of a function and of its first argument, for C code that calls it."""
        return self.address_of(name).value, self._pointer.value

    def check(self, status: int, function: str) -> None:
        """Raise ComponentError when `status` is worse than a warning."""
        if status > WARNING or status < OK:
            self.is_fatal = self.is_fatal or status == FATAL
            word = STATUS_WORDS[status] if 0 <= status < len(STATUS_WORDS) else f"status {status}"
            if status == PENDING:
                word += ", a step that goes on by itself, without canRunAsynchronuously,"
            self.fail(function, f"returned {word} at time {self.time:.17g}")

    def fail(self, function: str, what: str, kind: type[ComponentError] = ComponentError) -> NoReturn:
        """Raise an error of a kind: the failure of a function of the FMU, and the last line that it logged."""
        lines = self.log.take()
        reason = lines[-1] if lines else "the component logged nothing"
        # our own components repeat instance and function in their messages
        reason = reason.removeprefix(f"{self.name}: {self.prefix}{function}: ")
        raise kind(
            f"{self.name}: {self.prefix}{function} {what}: {reason}",
            instance=self.name,
            function=self.prefix + function,
            time=self.time,
            log=lines,
        )

    def group(
        self,
        kind: str,
        references: Sequence[int],
        *,
        size: int | None = None,
        values: NDArray[Any] | None = None,
    ) -> VariableGroup:
        """Return a group of variables, moved in one call.

        Parameters
        ----------
        kind : str
            FMI 3.0's name of their type (Float64, Int64, Boolean, ...).
        references : sequence of int
            Value references.
        size : int or None
            Number of values, when some variables are arrays.
        values : ndarray or None
            Buffer to use; two groups may share one. None: a new one.
        """
        if values is None:
            count = len(references) if size is None else size
            values = np.zeros(count, dtype=DTYPES[self.fmi_version][kind])
        name = self.type_names.get(kind, kind)
        return self.group_type(
            name,
            (self._function("Get" + name), self._function("Set" + name)),
            self._pointer,
            references,
            values,
            self,
            with_value_count=self.fmi_version == "3.0",
        )

    def text_group(self, references: Sequence[int], size: int) -> TextGroup:
        """Return a group of variables of type String with `size` texts, read in one call."""
        functions = self._function("GetString"), self._function("SetString")
        with_value_count = self.fmi_version == "3.0"
        return TextGroup(functions, self._pointer, references, size, self, with_value_count=with_value_count)

    def set_texts(self, reference: int, texts: Sequence[str]) -> None:
        """Set a variable of type String; the FMU keeps a copy.

        Parameters
        ----------
        reference : int
            Value reference.
        texts : sequence of str
            Texts without null characters, which would end them in C: one, or one for each element of an array.
        """
        values = (ctypes.c_char_p * max(1, len(texts)))(*(text.encode() for text in texts))
        value_count = (ctypes.c_size_t(len(texts)),) if self.fmi_version == "3.0" else ()
        call = self._function("SetString")
        status = call(
            self._pointer, ctypes.byref(ctypes.c_uint32(reference)), ctypes.c_size_t(1), values, *value_count
        )
        self.check(status, "SetString")

    # ---- life ----

    def enter_configuration(self) -> None:
        """Enter configuration mode, in which FMI 3.0 sets structural parameters, before initialization."""
        self.check(self._function("EnterConfigurationMode")(self._pointer), "EnterConfigurationMode")

    def exit_configuration(self) -> None:
        """Leave configuration mode: the sizes of arrays follow the structural parameters."""
        self.check(self._function("ExitConfigurationMode")(self._pointer), "ExitConfigurationMode")

    @abstractmethod
    def enter_initialization(self, start_time: float, tolerance: float | None = None) -> None:
        """Enter initialization mode at `start_time`, s, with a relative tolerance; None: the FMU's own."""

    def exit_initialization(self) -> None:
        """Leave initialization mode; the FMU checks its parameters here."""
        status = self._exit_initialization()
        self._keep_rounding()
        self.check(status, "ExitInitializationMode")

    def _keep_rounding(self) -> None:
        """Undo a change of the rounding mode, which would change the values of other components."""
        if not is_usual():
            set_usual()
            self.changed_rounding = True

    def reset(self) -> None:
        """Go back to the state after instantiation: the instance is ready for another run."""
        self.check(self._reset(), "Reset")

    def terminate(self) -> None:
        """End the run."""
        self.check(self._terminate(), "Terminate")

    def free(self) -> None:
        """Free the instance's memory; it must not be used afterwards.

        After a fatal error FMI allows no call at all: the memory is not freed.
        """
        if self._pointer and not self.is_fatal:
            self._function("FreeInstance", None)(self._pointer)
            self._pointer.value = None

    def _bind_life(self) -> None:
        self._enter_initialization = self._function("EnterInitializationMode")
        self._exit_initialization = self._bound("ExitInitializationMode")
        self._terminate = self._bound("Terminate")
        self._reset = self._bound("Reset")

    # ---- steps ----

    def step(self, time: float, size: float) -> int:
        """Advance from `time` by `size`, s; returns OK, WARNING or DISCARD and sets `self.time`."""
        self._step_time.value = time
        self._step_size.value = size if self.only_step == 0.0 else self._one_size(time, size)
        return self.take_step(self._do_step())

    def _one_size(self, time: float, size: float) -> float:
        """Return the only step size for a step that has it up to rounding; refuse any other."""
        if abs(size - self.only_step) > SAME_SIZE * self.only_step:
            self.refuse_cut(time, size)
        return self.only_step

    def refuse_cut(self, time: float, size: float) -> NoReturn:
        """Raise the error of a step at `time` that is cut to `size`, s, for an FMU with one step size."""
        self.time = time
        raise ComponentError(
            f"{self.name}: {self.prefix}DoStep: expected steps of {self.only_step:.12g} s, since "
            f"canHandleVariableCommunicationStepSize = false, got one of {size:.12g} s at time {time:.12g}. "
            "Events of other components, samples between steps and an end between them cut steps: choose a macro_step "
            "of which they are multiples.",
            instance=self.name,
            function=f"{self.prefix}DoStep",
            time=time,
        )

    @abstractmethod
    def take_step(self, status: int) -> int:
        """Read status and flags of the step just made; returns as `step` does."""

    @abstractmethod
    def take_time(self, time: float) -> None:
        """Set the time, s, that steps made and checked by C code have reached."""

    @property
    def step_memory(self) -> dict[str, int]:
        """Addresses of the inputs and outputs of a step, for C code that makes it."""
        return {
            "step_time": ctypes.addressof(self._step_time),
            "step_size": ctypes.addressof(self._step_size),
        }

    def last_successful_time(self) -> float:
        """Return the time, s, up to which the FMU says that it made the step just discarded; NaN if it does not say."""
        return math.nan

    def step_undiscarded(self, time: float, size: float) -> None:
        """Advance from `time` by `size`, s; a discarded step is an error."""
        if self.step(time, size) == DISCARD:
            self.check(DISCARD, "DoStep")

    def _refuse_end(self, rule: str, reached: float) -> NoReturn:
        """Raise the error of a step that reports an impossible end."""
        self.time = self._step_time.value
        self.fail(
            "DoStep",
            f"said that a step of {self._step_size.value:.12g} s has ended at time {reached:.12g} "
            f"(lastSuccessfulTime), expected {rule}, at time {self.time:.17g}",
        )

    def _ends_inside(self, reached: float, end: float) -> bool:
        """Can a step to `end` have ended at this time, with or without an early return?"""
        room = self._room(end)
        return self._step_time.value - room <= reached <= end + room  # false for NaN too

    def _room(self, end: float) -> float:
        rounding = TIME_ROUNDING * (1.0 + abs(end)) + STEP_ROUNDING * self._step_size.value
        return self.internal_step * (1.0 + STEP_ROUNDING) + rounding

    @property
    def step_start(self) -> float:
        """Start of the last step, or of the step under way, s."""
        return self._step_time.value

    # ---- derivatives ----

    def directional_derivative(self, unknowns: Sequence[int], known: int) -> tuple[int, NDArray[np.float64]]:
        """Return FMI's status and the derivatives of real variables over one input, at the present values.

        Parameters
        ----------
        unknowns : sequence of int
            Value references of n variables that depend on the input.
        known : int
            Value reference of the input.

        Returns
        -------
        status : int
        derivatives : ndarray, shape (n,)
            Without meaning unless the status is OK or WARNING.
        """
        count = len(unknowns)
        found = np.full(count, np.nan)
        seed = c_double(1.0)
        sizes = (ctypes.c_size_t(1), ctypes.c_size_t(count))
        places = ((ctypes.c_uint32 * count)(*unknowns), ctypes.c_size_t(count))
        inputs = (ctypes.byref(ctypes.c_uint32(known)), ctypes.c_size_t(1))
        values = (ctypes.byref(seed), c_void_p(found.ctypes.data))
        with_sizes = (values[0], sizes[0], values[1], sizes[1])
        seeds = with_sizes if self.fmi_version == "3.0" else values
        call = self._function("GetDirectionalDerivative")
        return call(self._pointer, *places, *inputs, *seeds), found

    # ---- states ----

    def _bind_states(self) -> None:
        """Bind the functions of states, which an FMU that declares no states may lack."""
        try:
            self._get_state = self._function(f"Get{self.state_word}")
            self._set_state = self._function(f"Set{self.state_word}")
        except ComponentFileError as error:
            self.lacks_states = error
        self._free_state = f"Free{self.state_word}"

    def free_state(self, slot: c_void_p) -> None:
        """Free a saved state's memory."""
        self.check(self._function(self._free_state)(self._pointer, ctypes.byref(slot)), self._free_state)

    def save(self, slot: c_void_p) -> None:
        """Save the state into `slot`, which is allocated at first use and reused later."""
        status = self._get_state(self._pointer, ctypes.byref(slot))
        if status > WARNING:
            self.check(status, "GetFMUState")

    def restore(self, slot: c_void_p) -> None:
        """Restore a saved state."""
        status = self._set_state(self._pointer, slot)
        if status > WARNING:
            self.check(status, "SetFMUState")

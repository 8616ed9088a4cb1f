"""One instance of an FMU for model exchange, in the form of one for co-simulation: CVODE makes its steps in C."""

from __future__ import annotations

import ctypes
from abc import abstractmethod
from collections.abc import Callable, Sequence
from ctypes import c_bool, c_char_p, c_double, c_int, c_size_t, c_void_p
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.core.model_exchange import (
    Exchange,
    ExchangeCall,
    ExchangeInput,
    ExchangeReason,
    exchange_address,
    exchange_function,
)
from vibroimpact.fmus.errors import ComponentError, ComponentFileError
from vibroimpact.fmus.packaging.archive import UnpackedFmu
from vibroimpact.orchestrator.fmi.clock_calls import ClockedInstance
from vibroimpact.orchestrator.fmi.cvode import cvode
from vibroimpact.orchestrator.fmi.eventful import EventfulInstance
from vibroimpact.orchestrator.fmi.instance import OK, WARNING, CallNotes, Wrapper
from vibroimpact.orchestrator.fmi.instance2 import FMI2_CALLBACKS, Callbacks
from vibroimpact.orchestrator.fmi.library import Function
from vibroimpact.orchestrator.fmi.log import LogTail, callback
from vibroimpact.orchestrator.fmi.variables import DTYPES, FMI2_NAMES, Setter, VariableGroup
from vibroimpact.orchestrator.fmi.watched_points import WatchedPoints

#: Most steps of CVODE in one communication step.
MOST_STEPS = 2_000_000
#: Event iterations at one instant, above which a discrete input counts as never settling.
EVENT_ITERATIONS = 100
MODEL_EXCHANGE = 0
#: Error of one step over the tolerance: the errors of many steps then stay near the tolerance.
STEP_SHARE = 0.1
#: The same with a contact of the run. Errors of BDF have one sign: a swing loses energy in each of thousands of steps.
#: Impacts carry this loss on into instants. 20 impacts of a pendulum in 33 s then stay below 1e-8 at 1e-10.
CONTACT_SHARE = 0.003
#: Finest relative tolerance of one step; below it errors are rounding.
FINEST = 1e-14
#: Functions of the C code, by the names of the calls that they replace.
DRIVEN = {
    "DoStep": "step",
    "EnterEventMode": "enter",
    "UpdateDiscreteStates": "update",
    "EnterStepMode": "leave",
    "GetFMUState": "save",
    "SetFMUState": "restore",
    "FreeFMUState": "free",
}
#: Meaning of the flags of CVODE that a run can meet.
FLAGS = {
    -1: "too many steps",
    -2: "a tolerance below rounding",
    -3: "error tests that fail with the smallest step",
    -4: "corrections that do not converge with the smallest step",
    -6: "a singular Jacobian",
    -8: "a failing derivative",
    -9: "no derivative where it begins",
    -10: "derivatives that are missing again and again",
    -11: "no derivative, and no shorter step",
    -12: "failing event indicators",
    -22: "an illegal input",
    -27: "an end too close to the start",
}


@dataclass(frozen=True, slots=True)
class ExchangeFacts:
    """The description of an FMU for model exchange.

    Attributes
    ----------
    states, indicators : int
        Numbers of continuous states and event indicators; FMI 3.0 is asked for them again.
    tolerance : float
        Relative tolerance of the solver.
    needs_completed : bool
        The FMU wants to hear of each completed step.
    restorable : bool
        Its state can be kept and restored.
    discrete : frozenset of (str, int)
        Kinds and value references of the inputs that may change at events alone.
    derivatives : tuple of int
        Value references of the derivatives of the states, in the order of the states.
    gives_derivatives : bool
        It declares directional derivatives.
    """

    states: int
    indicators: int
    tolerance: float
    needs_completed: bool
    restorable: bool
    discrete: frozenset[tuple[str, int]]
    derivatives: tuple[int, ...] = ()
    gives_derivatives: bool = False


class ExchangeInstance(EventfulInstance):
    """An instance of an FMU for model exchange, integrated by CVODE between its events.

    Parameters
    ----------
    fmu : UnpackedFmu
        The FMU.
    name : str
        Instance name, used in messages.
    facts : ExchangeFacts
        Its description.
    log, wrap
        As of `Instance`.

    Raises
    ------
    ComponentError
        The FMU makes no instance, or FMPy has no CVODE for this machine.
    """

    event_mode = True
    may_return_early = True
    #: FMI's names of the functions of `ExchangeCall`; inputs are set by functions of their own.
    names: ClassVar[tuple[str, ...]] = (
        *("SetTime", "SetContinuousStates", "GetContinuousStates", "Get{derivatives}", "GetEventIndicators"),
        *("GetNominalsOfContinuousStates", "CompletedIntegratorStep", "EnterEventMode", "{update}"),
        *("EnterContinuousTimeMode", "Get{state}", "Set{state}", "Free{state}", "", "Get{real}", "Set{real}"),
    )
    own_words: ClassVar[dict[str, str]]

    def __init__(
        self,
        fmu: UnpackedFmu,
        name: str,
        facts: ExchangeFacts,
        *,
        log: LogTail | None = None,
        wrap: Wrapper | None = None,
    ) -> None:
        super().__init__(fmu, name, log=log, wrap=wrap)
        self.facts = facts
        self._exchange = Exchange()
        self._own = c_void_p(ctypes.addressof(self._exchange))
        self.points = WatchedPoints(self._exchange)
        """Its watched points, and the states between its steps."""
        self._buffers: dict[str, NDArray[np.float64]] = {}
        self.jump_ends = False
        """An event mode after a jump has asked for the end of the run."""
        self._kept: list[object] = []  # memory whose addresses C code holds
        self._cvode = cvode()
        self._instantiate()
        self._keep_rounding()
        self._bind_exchange()
        self._bind_life()
        self._bind_events()
        self._bind_states()

    @abstractmethod
    def _instantiate(self) -> None:
        """Make the instance."""

    # ---- binding ----

    def _bind_exchange(self) -> None:
        exchange, notes = self._exchange, self.wrap
        exchange.fmu, exchange.cvode = self._pointer, ctypes.pointer(self._cvode)
        exchange.version = int(self.fmi_version[0])
        exchange.most_steps, exchange.most_iterations = MOST_STEPS, EVENT_ITERATIONS
        exchange.needs_completed, exchange.restorable = self.facts.needs_completed, self.facts.restorable
        real = self.type_names.get("Float64", "Float64")
        self._words = [name.format(**self.own_words, state=self.state_word, real=real) for name in self.names]
        for place, word in enumerate(self._words):
            is_of_states = ExchangeCall.save <= place <= ExchangeCall.free
            if not word or (is_of_states and not self.facts.restorable):
                continue
            exchange.calls[place] = self.address_of(word)
            exchange.numbers[place] = (
                notes.number_of(self.prefix + word) if isinstance(notes, CallNotes) else 0
            )
        exchange.noted_call = notes.call_address if isinstance(notes, CallNotes) else None

    def _driven(self, name: str) -> str | None:
        """Return the C function that replaces a call, by its name in either version, or None."""
        return DRIVEN.get(name.replace("FMUstate", "FMUState"))

    def _bound(self, name: str, *arguments: Any) -> Callable[[], int]:
        driven = self._driven(name)
        if driven is None:
            return super()._bound(name, *arguments)
        return partial(self._core_function(name, driven), self._own, *arguments)

    def _core_function(self, name: str, driven: str) -> Function:
        function = exchange_function(driven)
        return function if self.wrap is None else self.wrap(self.prefix + name, function)

    def _bind_states(self) -> None:
        self._save, self._restore, self._free = (
            self._core_function(f"{verb}{self.state_word}", driven)
            for verb, driven in (("Get", "save"), ("Set", "restore"), ("Free", "free"))
        )

    def call_of(self, name: str) -> tuple[int | None, int | None]:
        """Return the address of a function and of its first argument, for C code that calls it."""
        driven = self._driven(name)
        return super().call_of(name) if driven is None else (exchange_address(driven).value, self._own.value)

    def group(
        self,
        kind: str,
        references: Sequence[int],
        *,
        size: int | None = None,
        values: NDArray[Any] | None = None,
    ) -> VariableGroup:
        """Return a group of variables; a changed input lets the solver begin anew, or is an event."""
        if values is None:
            count = len(references) if size is None else size
            values = np.zeros(count, dtype=DTYPES[self.fmi_version][kind])
        name = self.type_names.get(kind, kind)
        room = np.zeros_like(values)
        discrete = np.array([(kind, r) in self.facts.discrete for r in references] or [False], dtype=np.uint8)
        notes = self.wrap
        given = ExchangeInput(
            exchange=ctypes.pointer(self._exchange),
            get=self.address_of("Get" + name),
            set=self.address_of("Set" + name),
            values=room.ctypes.data,
            discrete=discrete.ctypes.data,
            size=values.itemsize,
            number=notes.number_of(f"{self.prefix}Set{name}") if isinstance(notes, CallNotes) else 0,
        )
        self._kept += [room, discrete, given]
        driven = f"set{self.fmi_version[0]}"
        return VariableGroup(
            name,
            (self._function("Get" + name), self._core_function("Set" + name, driven)),
            self._pointer,
            references,
            values,
            self,
            with_value_count=self.fmi_version == "3.0",
            setter=Setter(exchange_address(driven), c_void_p(ctypes.addressof(given))),
        )

    # ---- errors ----

    def check(self, status: int, function: str) -> None:
        """Raise ComponentError when `status` is worse than a warning, with the function of the FMU that failed."""
        if OK <= status <= WARNING:
            return
        exchange = self._exchange
        if not (self._driven(function) or function.startswith("Set")) or not exchange.has_begun:
            super().check(status, function)
            return
        self.time = exchange.time
        word = function if exchange.function == ExchangeCall.set_inputs else self._words[exchange.function]
        match ExchangeReason(exchange.reason):
            case ExchangeReason.status:
                super().check(status, word)
            case ExchangeReason.not_finite:
                self.fail(word, f"gave a number that is not finite at time {self.time:.17g}")
            case ExchangeReason.endless:
                self.fail(
                    word, f"expects further iterations after {EVENT_ITERATIONS} at time {self.time:.17g}"
                )
            case ExchangeReason.steps:
                self._solver_error(f"got {MOST_STEPS} steps without reaching it")
            case ExchangeReason.short:
                self._solver_error(f"got steps below the rounding of time{self._cause()}")
            case ExchangeReason.time:
                self.time = self._step_time.value
                self._solver_error(
                    f"got a component at time {exchange.time:.17g} that cannot go back "
                    "(canGetAndSetFMUState = false)"
                )
            case ExchangeReason.solver:
                self._solver_error(self._flag_text())

    def _flag_text(self) -> str:
        exchange = self._exchange
        meaning = FLAGS.get(exchange.solver_flag, "an error")
        return f"got {meaning} (flag {exchange.solver_flag}){self._cause()}"

    def _cause(self) -> str:
        """Return the function at whose answer the solver took shorter steps, in words."""
        cause = self._exchange.cause
        return (
            ""
            if cause < 0
            else f": {self.prefix}{self._words[cause]} gave none, or numbers that are not finite"
        )

    def _solver_error(self, got: str) -> None:
        end = self._step_time.value + self._step_size.value
        lines = self.log.take()
        said = f" {lines[-1]}" if lines else ""
        raise ComponentError(
            f"{self.name}: CVode: expected steps from time {self.time:.17g} to {end:.17g}, {got}.{said}",
            instance=self.name,
            function="CVode",
            time=self.time,
            log=lines,
        )

    # ---- life ----

    def exit_initialization(self) -> None:
        """Leave initialization mode, into event mode; numbers of states and indicators are known then."""
        super().exit_initialization()
        exchange, self.jump_ends = self._exchange, False
        exchange.state_count, exchange.indicator_count = self._counts()
        count = max(1, exchange.state_count)
        for name in ("states", "kept", "absolute", "point"):
            setattr(exchange, name, self._numbers(name, count))
        for name in ("indicators", "compared"):
            setattr(exchange, name, self._numbers(name, max(1, exchange.indicator_count)))
        self.points.begin()
        share = CONTACT_SHARE if self.points.has_contacts else STEP_SHARE
        exchange.tolerance = max(share * self.facts.tolerance, FINEST)
        exchange_function("begin")(self._own, c_double(self.time))

    def _numbers(self, name: str, count: int) -> int:
        self._buffers[name] = np.zeros(count)
        return int(self._buffers[name].ctypes.data)

    def _counts(self) -> tuple[int, int]:
        return self.facts.states, self.facts.indicators

    def reset(self) -> None:
        """Go back to the state after instantiation: the instance is ready for another run."""
        exchange_function("end")(self._own)
        super().reset()

    def free(self) -> None:
        """Free the solver and the instance; neither must be used afterwards."""
        exchange_function("end")(self._own)
        super().free()

    # ---- states ----

    @property
    def states(self) -> NDArray[np.float64]:
        """A copy of the continuous states, shape (n,)."""
        return self._buffers["states"][: int(self._exchange.state_count)].copy()

    def show(self, states: NDArray[np.float64], time: float | None = None) -> None:
        """Let the FMU have these states, shape (n,), at a time, s (None: the present time), for a reading.

        The integration stays where it is; `show(states)` brings the FMU back there.
        """
        at = c_double(self._exchange.time if time is None else time)
        status = exchange_function("show")(self._own, at, c_void_p(states.ctypes.data))
        self.check(status, self._words[ExchangeCall.set_states])

    def kept_samples(self, start: float, end: float) -> NDArray[np.float64]:
        """Return the states that the step from `start` to `end`, s, has kept, shape (instants, n).

        They are none if the last step was another one: a trial, which has been taken back.
        """
        is_last = self._step_time.value == start and abs(self._last_time.value - end) <= self._room(end)
        found = self.points.samples()
        return found if is_last else found[:0]

    def derivatives(self) -> NDArray[np.float64]:
        """Return the derivatives of the states at the present point, shape (n,)."""
        word = self._words[ExchangeCall.derivatives]
        found = np.zeros(int(self._exchange.state_count))
        call = self._function(word)
        status = call(self._pointer, c_void_p(found.ctypes.data), c_size_t(found.size))
        self.time = self._exchange.time
        super().check(status, word)
        return found

    def jump(self, states: NDArray[np.float64]) -> None:
        """Let the motion go on from these states, shape (n,): they are set, then an event mode follows.

        States are set in continuous-time mode, the only mode that allows it.
        """
        self.show(np.ascontiguousarray(states))
        self.check(self.enter_event_call(), "EnterEventMode")
        for _ in range(EVENT_ITERATIONS):
            self.check(self.update_call(), "UpdateDiscreteStates")
            self.jump_ends = self.jump_ends or self.event_wants_to_end
            if not self.needs_update.value:
                break
        else:
            self.fail(self.update_word, f"expects further iterations after {EVENT_ITERATIONS} at a jump")
        self.check(self.enter_step_call(), "EnterStepMode")

    def save(self, slot: c_void_p) -> None:
        """Save the FMU's state and that of its integration into `slot`."""
        status = self._save(self._own, ctypes.byref(slot))
        if status > WARNING:
            self.check(status, "GetFMUState")

    def restore(self, slot: c_void_p) -> None:
        """Restore a saved state; the solver begins anew."""
        status = self._restore(self._own, slot)
        if status > WARNING:
            self.check(status, "SetFMUState")

    def free_state(self, slot: c_void_p) -> None:
        """Free a saved state's memory."""
        self.check(self._free(self._own, ctypes.byref(slot)), "FreeFMUState")


class Exchange3(ExchangeInstance, ClockedInstance):
    """An instance of FMI 3.0 for model exchange."""

    fmi_version = "3.0"
    prefix = "fmi3"
    state_word = "FMUState"
    own_words: ClassVar[dict[str, str]] = {
        "derivatives": "ContinuousStateDerivatives",
        "update": "UpdateDiscreteStates",
    }

    def _instantiate(self) -> None:
        instantiate = self._function("InstantiateModelExchange", c_void_p)
        texts = (c_char_p(t.encode()) for t in (self.name, self.fmu.token, f"{self.fmu.resources}/"))
        flags = (c_bool(False), c_bool(False))
        pointer = instantiate(*texts, *flags, self.log.environment, callback("fmi3"))
        if not pointer:
            self.fail("InstantiateModelExchange", f"made no instance of {self.fmu.shown}", ComponentFileError)
        self._pointer.value = pointer

    def enter_initialization(self, start_time: float, tolerance: float | None = None) -> None:
        """Enter initialization mode at `start_time`, s, with the relative tolerance of the solver."""
        self.time = start_time
        given = (c_bool(True), c_double(tolerance or self.facts.tolerance))
        no_end = (c_bool(False), c_double(0.0))
        status = self._enter_initialization(self._pointer, *given, c_double(start_time), *no_end)
        self.check(status, "EnterInitializationMode")

    def _counts(self) -> tuple[int, int]:
        counts = c_size_t(), c_size_t()
        for name, count in zip(("ContinuousStates", "EventIndicators"), counts, strict=True):
            function = f"GetNumberOf{name}"
            self.check(self._function(function)(self._pointer, ctypes.byref(count)), function)
        return counts[0].value, counts[1].value


class Exchange2(ExchangeInstance):
    """An instance of FMI 2.0 for model exchange."""

    fmi_version = "2.0"
    prefix = "fmi2"
    state_word = "FMUstate"
    type_names = FMI2_NAMES
    update_word = "NewDiscreteStates"
    own_words: ClassVar[dict[str, str]] = {"derivatives": "Derivatives", "update": update_word}

    def _instantiate(self) -> None:
        self._callbacks = Callbacks(*map(callback, FMI2_CALLBACKS), None, self.log.environment)
        instantiate = self._function("Instantiate", c_void_p)
        pointer = instantiate(
            c_char_p(self.name.encode()),
            c_int(MODEL_EXCHANGE),
            c_char_p(self.fmu.token.encode()),
            c_char_p(self.fmu.resources.as_uri().encode()),
            ctypes.byref(self._callbacks),
            c_int(0),
            c_int(1),  # loggingOn: some FMUs report even fatal errors only with it
        )
        if not pointer:
            self.fail("Instantiate", f"made no instance of {self.fmu.shown}", ComponentFileError)
        self._pointer.value = pointer

    def enter_initialization(self, start_time: float, tolerance: float | None = None) -> None:
        """Set the experiment up and enter initialization mode, as in FMI 3.0."""
        self.time = start_time
        given = (c_int(1), c_double(tolerance or self.facts.tolerance))
        no_end = (c_int(0), c_double(0.0))
        status = self._function("SetupExperiment")(self._pointer, *given, c_double(start_time), *no_end)
        self.check(status, "SetupExperiment")
        self.check(self._enter_initialization(self._pointer), "EnterInitializationMode")

"""One instance of an FMI 3.0 co-simulation FMU."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Sequence
from ctypes import c_bool, c_char_p, c_double, c_int, c_size_t, c_uint16, c_uint32, c_void_p

from vibroimpact.fmus.errors import ComponentFileError
from vibroimpact.fmus.packaging.archive import UnpackedFmu
from vibroimpact.orchestrator.fmi.instance import DISCARD, NO_STATE_PRIOR_TO_POINT, Instance, Wrapper
from vibroimpact.orchestrator.fmi.log import LogTail, callback
from vibroimpact.orchestrator.fmi.rounding import HALF, ONE, SMALL, TINY

#: Qualifier of fmi3GetIntervalDecimal for an interval that the FMU does not know yet.
INTERVAL_NOT_YET_KNOWN = 0


class Instance3(Instance):
    """An instance of an FMI 3.0 FMU.

    Parameters
    ----------
    event_mode : bool
        Handle events: event mode and early return.
    early_return : bool
        Let the FMU end a step early (always so in event mode).

    Attributes
    ----------
    may_return_early : bool
        The FMU was allowed to end a step early.
    enter_event_call, enter_step_call, update_call : callable
        The bare calls, which return FMI's status, for code that checks it itself.
    decisions : c_uint16
        Both answers of the last `update_call` at once: 0 if the FMU needs no other event iteration and does not
        request the end.
    needs_update : c_bool
        The first answer: the FMU needs another event iteration.
    """

    fmi_version = "3.0"
    prefix = "fmi3"
    state_word = "FMUState"

    def __init__(
        self,
        fmu: UnpackedFmu,
        name: str,
        *,
        event_mode: bool = False,
        early_return: bool = False,
        log: LogTail | None = None,
        wrap: Wrapper | None = None,
    ) -> None:
        super().__init__(fmu, name, log=log, wrap=wrap)
        self.event_mode = event_mode
        self.may_return_early = early_return or event_mode
        self._instantiate()
        self._keep_rounding()
        self._bind_life()
        self._bind_events()
        self._bind_states()

    def _instantiate(self) -> None:
        instantiate = self._function("InstantiateCoSimulation", c_void_p)
        flags = (c_bool(False), c_bool(False), c_bool(self.event_mode), c_bool(self.may_return_early))
        texts = (c_char_p(t.encode()) for t in (self.name, self.fmu.token, f"{self.fmu.resources}/"))
        no_variables = (c_void_p(), c_size_t(0))
        pointer = instantiate(
            *texts, *flags, *no_variables, self.log.environment, callback("fmi3"), c_void_p()
        )
        if not pointer:
            self.fail("InstantiateCoSimulation", f"made no instance of {self.fmu.source}", ComponentFileError)
        self._pointer.value = pointer

    def _bind_events(self) -> None:
        self.enter_event_call = self._bound("EnterEventMode")
        self.enter_step_call = self._bound("EnterStepMode")
        self.decisions = c_uint16()
        self.needs_update = c_bool.from_buffer(self.decisions, 0)
        self._event_flags = (c_bool.from_buffer(self.decisions, 1), c_bool(), c_bool(), c_bool())
        self._next_event = c_double()
        flags = [ctypes.byref(flag) for flag in (self.needs_update, *self._event_flags)]
        self.update_call = self._bound("UpdateDiscreteStates", *flags, ctypes.byref(self._next_event))
        self._flags = c_uint32()  # all three flags of a step at once: mostly there is none
        self._needs_event, self._ends, self._early = (c_bool.from_buffer(self._flags, i) for i in range(3))
        self._last_time = c_double()
        outputs = [ctypes.byref(flag) for flag in (self._needs_event, self._ends, self._early)]
        outputs.append(ctypes.byref(self._last_time))
        prior = c_bool(NO_STATE_PRIOR_TO_POINT)
        self._do_step = self._bound("DoStep", self._step_time, self._step_size, prior, *outputs)

    def set_clocks(self, references: Sequence[int]) -> None:
        """Let input clocks tick, in event mode."""
        count = len(references)
        places, ticks = (c_uint32 * count)(*references), (c_bool * count)(*[True] * count)
        self.check(self._function("SetClock")(self._pointer, places, c_size_t(count), ticks), "SetClock")

    def clock_times(self, reference: int) -> tuple[float, float]:
        """Return interval and shift of a fixed input clock, s, in initialization mode; NaN if not known yet."""
        place, one = ctypes.byref(c_uint32(reference)), c_size_t(1)
        interval, shift, qualifier = c_double(math.nan), c_double(math.nan), c_int()
        get_interval, get_shift = self._function("GetIntervalDecimal"), self._function("GetShiftDecimal")
        status = get_interval(self._pointer, place, one, ctypes.byref(interval), ctypes.byref(qualifier))
        self.check(status, "GetIntervalDecimal")
        self.check(get_shift(self._pointer, place, one, ctypes.byref(shift)), "GetShiftDecimal")
        return (math.nan if qualifier.value == INTERVAL_NOT_YET_KNOWN else interval.value), shift.value

    def enter_initialization(self, start_time: float, tolerance: float | None = None) -> None:
        """Enter initialization mode at `start_time`, s, with a relative tolerance; None: the FMU's own."""
        self.time = start_time
        given = (c_bool(tolerance is not None), c_double(tolerance or 0.0))
        no_end = (c_bool(False), c_double(0.0))
        status = self._enter_initialization(self._pointer, *given, c_double(start_time), *no_end)
        self.check(status, "EnterInitializationMode")

    def take_step(self, status: int) -> int:
        """Read status and flags of the step just made; returns as `step` does."""
        if ONE + TINY != ONE - TINY or SMALL * HALF == 0.0:
            self._keep_rounding()
        if status and status != DISCARD:
            self.check(status, "DoStep")
        reached = self._last_time.value
        self.take_time(reached)
        end = self._step_time.value + self._step_size.value
        if reached != end and status != DISCARD:
            self._check_end(reached, end)
        return status

    def take_time(self, time: float) -> None:
        """Set the time, s, that steps made and checked by C code have reached."""
        self.time = time
        if self._flags.value:
            self._take_flags()
        elif self.is_flagged:
            self.returned_early = self.needs_event_mode = self.wants_to_end = self.is_flagged = False

    @property
    def step_memory(self) -> dict[str, int]:
        """Addresses of the inputs and outputs of a step, for C code that makes it."""
        answers = {"last_time": ctypes.addressof(self._last_time), "flags": ctypes.addressof(self._flags)}
        return super().step_memory | answers

    def _check_end(self, reached: float, end: float) -> None:
        """Refuse a step without the requested end, unless it has returned early or requests the end of the run.

        A solver of fixed steps may be less than one step behind its communication point; the point then counts as
        reached.
        """
        if not self._ends_inside(reached, end):
            self._refuse_end("a time of the step", reached)
        stops_short = self.returned_early or self.wants_to_end
        if reached > end or not stops_short:
            self.time = end
        if reached >= end - self._room(end):
            return
        if self.returned_early and not self.may_return_early:
            self._refuse_end("the end of the step, since early return was not allowed", reached)
        if not stops_short:
            self._refuse_end("the end of the step, since it has not returned early", reached)

    def _take_flags(self) -> None:
        self.returned_early = self._early.value
        self.needs_event_mode = self._needs_event.value
        self.wants_to_end = self._ends.value
        self.is_flagged = True

    @property
    def event_wants_to_end(self) -> bool:
        """Did the last event iteration request the end of the simulation?"""
        return self._event_flags[0].value

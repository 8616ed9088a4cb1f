"""An instance whose steps may end early, at events that event mode resolves: FMI 3.0, and model exchange."""

from __future__ import annotations

import ctypes
from ctypes import c_bool, c_double, c_uint16, c_uint32
from typing import ClassVar

from vibroimpact.orchestrator.fmi.instance import DISCARD, NO_STATE_PRIOR_TO_POINT, Instance
from vibroimpact.orchestrator.fmi.rounding import HALF, ONE, SMALL, TINY


class EventfulInstance(Instance):
    """An instance with the step and the event mode of FMI 3.0.

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

    update_word: ClassVar[str] = "UpdateDiscreteStates"
    """FMI's name of an event iteration in the version of the instance."""
    may_return_early: bool

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
        self.no_state_prior = c_bool(NO_STATE_PRIOR_TO_POINT)
        sizes = self._step_time, self._step_size
        self._do_step = self._bound("DoStep", *sizes, self.no_state_prior, *outputs)

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

    def last_successful_time(self) -> float:
        """Return the end of a discarded step: see the base class."""
        return self._last_time.value

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

"""One instance of an FMI 2.0 co-simulation FMU."""

from __future__ import annotations

import ctypes
import math
from ctypes import c_char_p, c_double, c_int, c_void_p
from pathlib import Path
from time import sleep

from vibroimpact.fmus.errors import ComponentFileError
from vibroimpact.fmus.packaging.archive import UnpackedFmu
from vibroimpact.orchestrator.fmi.instance import (
    DISCARD,
    NO_STATE_PRIOR_TO_POINT,
    OK,
    PENDING,
    WARNING,
    Instance,
    Wrapper,
)
from vibroimpact.orchestrator.fmi.log import LogTail, callback
from vibroimpact.orchestrator.fmi.rounding import HALF, ONE, SMALL, TINY
from vibroimpact.orchestrator.fmi.variables import FMI2_NAMES

CO_SIMULATION = 1
#: Kinds of status.
DO_STEP, LAST_SUCCESSFUL_TIME, TERMINATED = 0, 2, 3
#: Wall time between two questions whether a step that goes on by itself has ended, s.
PENDING_PAUSE = 1e-4


#: Callbacks of the core library, up to the first that is not given.
FMI2_CALLBACKS = ("fmi2", "allocate", "free")


class Callbacks(ctypes.Structure):
    """The callback functions of FMI 2.0."""

    _fields_ = [
        ("logger", c_void_p),
        ("allocate", c_void_p),
        ("free", c_void_p),
        ("step_finished", c_void_p),
        ("environment", c_void_p),
    ]


#: Freed instances for reuse, by the folder of their FMU and their name.
_kept: dict[tuple[Path, str], list[tuple[int, Callbacks]]] = {}


class Instance2(Instance):
    """An instance of an FMI 2.0 FMU: no event mode, so steps end at their requested end.

    Parameters
    ----------
    waits : bool
        A step may go on by itself (`canRunAsynchronuously`): its end is waited for.
    reuse : bool
        Keep the FMU's instance when this one is freed, and reset it for the next instance of this name. It is for FMUs
        that leak memory at each instantiation.
    """

    fmi_version = "2.0"
    prefix = "fmi2"
    state_word = "FMUstate"
    type_names = FMI2_NAMES
    event_mode = False

    def __init__(
        self,
        fmu: UnpackedFmu,
        name: str,
        *,
        log: LogTail | None = None,
        wrap: Wrapper | None = None,
        waits: bool = False,
        reuse: bool = False,
    ) -> None:
        super().__init__(fmu, name, log=log, wrap=wrap)
        self._waits = waits
        self._reuse = reuse
        self._callbacks = Callbacks(*map(callback, FMI2_CALLBACKS), None, self.log.environment)
        if not self._take_kept():
            self._instantiate()
        self._keep_rounding()
        self._bind_life()
        self.no_state_prior = c_int(NO_STATE_PRIOR_TO_POINT)
        self._do_step = self._bound("DoStep", self._step_time, self._step_size, self.no_state_prior)
        self._bind_states()

    def _instantiate(self) -> None:
        instantiate = self._function("Instantiate", c_void_p)
        location = self.fmu.resources.as_uri()
        pointer = instantiate(
            c_char_p(self.name.encode()),
            c_int(CO_SIMULATION),
            c_char_p(self.fmu.token.encode()),
            c_char_p(location.encode()),
            ctypes.byref(self._callbacks),
            c_int(0),
            c_int(1),  # loggingOn: some FMUs report even fatal errors only with it
        )
        if not pointer:
            self.fail("Instantiate", f"made no instance of {self.fmu.shown}", ComponentFileError)
        self._pointer.value = pointer

    def _take_kept(self) -> bool:
        """Take a kept instance, if one exists that can be reset."""
        kept = _kept.get((self.fmu.folder, self.name), []) if self._reuse else []
        while kept:
            self._pointer.value, self._callbacks = kept.pop()
            self._callbacks.environment = self.log.environment
            if self._function("Reset")(self._pointer) <= WARNING:
                return True
        self._pointer.value = None
        return False

    def free(self) -> None:
        """Free the instance's memory, or keep the instance for the next one of this name."""
        if self._reuse and self._pointer and not self.is_fatal:
            place = (self.fmu.folder, self.name)
            _kept.setdefault(place, []).append((self._pointer.value or 0, self._callbacks))
            self._pointer.value = None
        super().free()

    def enter_initialization(self, start_time: float, tolerance: float | None = None) -> None:
        """Set the experiment up and enter initialization mode: see the abstract method."""
        self.time = start_time
        given = (c_int(tolerance is not None), c_double(tolerance or 0.0))
        no_end = (c_int(0), c_double(0.0))
        status = self._function("SetupExperiment")(self._pointer, *given, c_double(start_time), *no_end)
        self.check(status, "SetupExperiment")
        self.check(self._enter_initialization(self._pointer), "EnterInitializationMode")

    def take_step(self, status: int) -> int:
        """Read status and flags of the step just made; returns as `step` does."""
        end = self._step_time.value + self._step_size.value
        if status == PENDING and self._waits:
            status = self._awaited()
        if ONE + TINY != ONE - TINY or SMALL * HALF == 0.0:
            self._keep_rounding()
        self.wants_to_end = self.is_flagged = False
        if status > WARNING:
            if status != DISCARD:
                self.check(status, "DoStep")
            if not self._wants_to_end():
                return status
            self.wants_to_end = self.is_flagged = True
            self.time = self._reported_end(end)
            return OK
        self.time = end
        return status

    def _awaited(self) -> int:
        """Wait for the end of a step that goes on by itself; return its status."""
        ask, found = self._function("GetStatus"), c_int(PENDING)
        while found.value == PENDING:
            sleep(PENDING_PAUSE)
            status = ask(self._pointer, c_int(DO_STEP), ctypes.byref(found))
            if status != DISCARD:  # a question without an answer
                self.check(status, "GetStatus")
        return found.value

    def take_time(self, time: float) -> None:
        """Set the time, s, that steps made and checked by C code have reached."""
        self.time = time
        self.wants_to_end = self.is_flagged = False

    def _wants_to_end(self) -> bool:
        """Does the FMU request the end of the simulation by a discarded step?"""
        terminated = c_int(0)
        status = self._function("GetBooleanStatus")(
            self._pointer, c_int(TERMINATED), ctypes.byref(terminated)
        )
        return status == OK and bool(terminated.value)

    def last_successful_time(self) -> float:
        """Return the end of a discarded step: see the base class."""
        status, reached = self._end_of_discarded()
        return reached if status == OK else math.nan

    def _end_of_discarded(self) -> tuple[int, float]:
        """Return FMI's status of the question, and the answer, s."""
        reached = c_double(math.nan)
        kind = c_int(LAST_SUCCESSFUL_TIME)
        status = self._function("GetRealStatus")(self._pointer, kind, ctypes.byref(reached))
        return status, reached.value

    def _reported_end(self, end: float) -> float:
        """Return the end of a discarded step to `end`, s."""
        status, reached = self._end_of_discarded()
        self.check(status, "GetRealStatus")
        if not self._ends_inside(reached, end):
            self._refuse_end("a time of the step", reached)
        return min(reached, end)

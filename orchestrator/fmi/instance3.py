"""One instance of an FMI 3.0 co-simulation FMU."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Sequence
from ctypes import c_bool, c_char_p, c_double, c_int, c_size_t, c_uint32, c_void_p

from vibroimpact.fmus.errors import ComponentFileError
from vibroimpact.fmus.packaging.archive import UnpackedFmu
from vibroimpact.orchestrator.fmi.eventful import EventfulInstance
from vibroimpact.orchestrator.fmi.instance import Wrapper
from vibroimpact.orchestrator.fmi.log import LogTail, callback

#: Qualifier of fmi3GetIntervalDecimal for an interval that the FMU does not know yet.
INTERVAL_NOT_YET_KNOWN = 0


class Instance3(EventfulInstance):
    """An instance of an FMI 3.0 FMU.

    Parameters
    ----------
    event_mode : bool
        Handle events: event mode and early return.
    early_return : bool
        Let the FMU end a step early (always so in event mode).
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
            self.fail("InstantiateCoSimulation", f"made no instance of {self.fmu.shown}", ComponentFileError)
        self._pointer.value = pointer

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

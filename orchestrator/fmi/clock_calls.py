"""The calls of FMI 3.0 that concern clocks, for both kinds of FMU."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Sequence
from ctypes import c_bool, c_double, c_int, c_size_t, c_uint32
from enum import IntEnum

from vibroimpact.orchestrator.fmi.eventful import EventfulInstance


class Interval(IntEnum):
    """Qualifier of an interval (`fmi3IntervalQualifier`)."""

    not_yet_known = 0
    unchanged = 1
    changed = 2


class ClockedInstance(EventfulInstance):
    """An instance of FMI 3.0, whose clocks tick in event mode."""

    def set_clocks(self, references: Sequence[int]) -> None:
        """Let input clocks tick, in event mode."""
        count = len(references)
        places, ticks = (c_uint32 * count)(*references), (c_bool * count)(*[True] * count)
        self.check(self._function("SetClock")(self._pointer, places, c_size_t(count), ticks), "SetClock")

    def has_ticked(self, reference: int) -> bool:
        """Does an output clock tick at this moment of event mode?"""
        tick, place = c_bool(), ctypes.byref(c_uint32(reference))
        status = self._function("GetClock")(self._pointer, place, c_size_t(1), ctypes.byref(tick))
        self.check(status, "GetClock")
        return tick.value

    def clock_interval(self, reference: int) -> tuple[float, Interval]:
        """Return the interval of a timed clock, s, in initialization or event mode, with its qualifier.

        ComponentError: the FMU gives a qualifier that FMI does not have.
        """
        interval, qualifier, place = c_double(math.nan), c_int(), ctypes.byref(c_uint32(reference))
        call = self._function("GetIntervalDecimal")
        status = call(self._pointer, place, c_size_t(1), ctypes.byref(interval), ctypes.byref(qualifier))
        self.check(status, "GetIntervalDecimal")
        if qualifier.value not in list(Interval):
            self.fail("GetIntervalDecimal", f"gave the qualifier {qualifier.value}, expected 0, 1 or 2")
        return interval.value, Interval(qualifier.value)

    def clock_shift(self, reference: int) -> float:
        """Return the time from the start of a run to the first tick of a periodic clock, s, in initialization mode."""
        shift, place = c_double(math.nan), ctypes.byref(c_uint32(reference))
        call = self._function("GetShiftDecimal")
        self.check(call(self._pointer, place, c_size_t(1), ctypes.byref(shift)), "GetShiftDecimal")
        return shift.value

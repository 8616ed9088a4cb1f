"""Coupled components between two moments that are an importer's: the loop over their steps and events, in C."""

from __future__ import annotations

from ctypes import POINTER, Structure, c_double, c_int32, c_int64, c_size_t, c_void_p
from enum import IntEnum
from functools import cache
from typing import Any

from vibroimpact.fmus.core.library import core_library


class CouplingEnd(IntEnum):
    """Why `advance_coupled` has returned; `door/coupling.h` says more."""

    done = 0
    listen = 1
    stepped = 2
    reached = 3
    failed = 4
    endless = 5
    cut = 6


class CallKind(IntEnum):
    """What a call is."""

    plain = 0
    move3 = 1
    move2 = 2
    update = 3
    scale = 4
    save = 5
    restore = 6
    step3 = 7
    step2 = 8


class CouplingCall(Structure):
    """A call of an FMU with its arguments; `door/coupling.h` says what each field is."""

    _fields_ = [
        *((name, c_void_p) for name in ("function", "instance", "references")),
        ("count", c_size_t),
        ("values", c_void_p),
        ("value_count", c_size_t),
        ("from", c_void_p),
        ("gains", c_void_p),
        ("note", c_int64),
        ("kind", c_int32),
        ("place", c_int32),
    ]


class CouplingCalls(Structure):
    """Calls that are made one after the other."""

    _fields_ = [("calls", POINTER(CouplingCall)), ("count", c_size_t)]


class CouplingComponent(Structure):
    """A component, by its calls; `door/coupling.h` says what each field is."""

    _fields_ = [
        ("step", CouplingCall),
        *((name, CouplingCalls) for name in ("inputs", "save", "restore", "event_times")),
        *((name, c_int32) for name in ("event_mode", "may_return_early", "number")),
        *((name, c_double) for name in ("internal_step", "only_step")),
        *((name, c_void_p) for name in ("step_time", "step_size", "last_time", "flags")),
        ("time", c_double),
    ]


class CouplingPlan(Structure):
    """What is done in all runs; `door/coupling.h` says what each field is."""

    _fields_ = [
        ("components", POINTER(CouplingComponent)),
        ("count", c_int32),
        ("saves", c_int32),
        *((name, CouplingCalls) for name in ("start", "begin", "again", "leave")),
        ("decisions", POINTER(c_void_p)),
        *((name, c_int32) for name in ("deciding", "most_iterations", "no_state_prior")),
        *((name, c_double) for name in ("same_instant", "time_rounding", "step_rounding")),
        *((name, c_void_p) for name in ("noted_call", "noted_time")),
    ]


class CouplingProgress(Structure):
    """How far a run is; times in s.

    Attributes
    ----------
    time : float
        Time reached.
    grid_start, next_point, grid_index
        The start of the grid of communication points, the next of them, and its index.
    event_time, event_index
        Time of the last event, and its index among those at that time.
    standstill, steps, repeated_steps : int
        Communication steps made without progress, all that were made, and how many were repeated.
    """

    _fields_ = [
        *((name, c_double) for name in ("time", "grid_start", "next_point", "event_time")),
        *((name, c_int64) for name in ("grid_index", "event_index", "standstill", "steps", "repeated_steps")),
    ]


class CouplingRun(Structure):
    """One call of the loop; `door/coupling.h` says what each field is."""

    _fields_ = [
        *((name, c_double) for name in ("end", "macro_step", "most_seconds")),
        ("events", c_void_p),
        *((name, c_int64) for name in ("events_room", "events_used")),
        *((name, c_int32) for name in ("hears_pauses", "wants_to_end")),
        *((name, c_double) for name in ("start", "target", "goal", "reached")),
        ("at_event", POINTER(c_int32)),
        *((name, c_int32) for name in ("arrived", "at", "status")),
    ]


@cache
def _function() -> Any:
    function = core_library().vi_door_coupling
    function.argtypes = [POINTER(CouplingPlan), POINTER(CouplingProgress), POINTER(CouplingRun)]
    return function


def advance_coupled(plan: CouplingPlan, progress: CouplingProgress, run: CouplingRun) -> CouplingEnd:
    """Advance components to `run.end` by their own functions, without Python in between; other threads go on meanwhile.

    Parameters
    ----------
    plan : CouplingPlan
        The components, and what is done with them.
    progress : CouplingProgress
        It is brought up to where they came.
    run : CouplingRun

    Returns
    -------
    CouplingEnd
        `listen`: it has taken `most_seconds`; after `stepped` and `reached` the caller finishes the step; `failed`: a
        call has; `endless`: the events do not settle; `cut`: a component takes steps of another size.
    """
    return CouplingEnd(_function()(plan, progress, run))

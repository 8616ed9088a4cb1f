"""Coupled components between two actions of an importer: the loop over their steps and events, in C."""

from __future__ import annotations

from ctypes import POINTER, Structure, c_double, c_int32, c_int64, c_size_t, c_void_p
from enum import IntEnum
from functools import cache
from typing import Any

from vibroimpact.fmus.core.library import core_library


class CouplingEnd(IntEnum):
    """Reason why `advance_coupled` has returned; see `door/coupling.h`."""

    done = 0
    listen = 1
    stepped = 2
    reached = 3
    failed = 4
    endless = 5
    cut = 6


class CallKind(IntEnum):
    """Kind of a call of an FMU."""

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
    """A call of an FMU with its arguments; the fields are explained in `door/coupling.h`."""

    _fields_ = [
        *((name, c_void_p) for name in ("function", "instance", "references")),
        ("count", c_size_t),
        ("values", c_void_p),
        ("value_count", c_size_t),
        ("from", c_void_p),
        ("gains", c_void_p),
        ("offsets", c_void_p),
        ("note", c_int64),
        ("kind", c_int32),
        ("place", c_int32),
    ]


class CouplingCalls(Structure):
    """Calls that are made one after the other."""

    _fields_ = [("calls", POINTER(CouplingCall)), ("count", c_size_t)]


class CouplingComponent(Structure):
    """A component, by its calls; the fields are explained in `door/coupling.h`."""

    _fields_ = [
        ("step", CouplingCall),
        *((name, CouplingCalls) for name in ("inputs", "save", "restore", "event_times")),
        *((name, c_int32) for name in ("event_mode", "may_return_early", "number")),
        *((name, c_double) for name in ("internal_step", "only_step")),
        *((name, c_void_p) for name in ("step_time", "step_size", "last_time", "flags")),
        ("time", c_double),
    ]


class CouplingPlan(Structure):
    """The plan, common to all runs; the fields are explained in `door/coupling.h`."""

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
    """Progress of a run; times in s.

    Attributes
    ----------
    time : float
        Time reached.
    grid_start, next_point, grid_index
        Start of the grid of communication points, the next point of the grid, and its index.
    event_time, event_index
        Time of the last event, and its index among the events of this time.
    standstill, steps, repeated_steps : int
        Numbers of communication steps: without progress, in total, and repeated.
    """

    _fields_ = [
        *((name, c_double) for name in ("time", "grid_start", "next_point", "event_time")),
        *((name, c_int64) for name in ("grid_index", "event_index", "standstill", "steps", "repeated_steps")),
    ]


class CouplingRun(Structure):
    """One call of the loop; the fields are explained in `door/coupling.h`."""

    _fields_ = [
        *((name, c_double) for name in ("end", "macro_step", "most_seconds")),
        ("events", c_void_p),
        *((name, c_int64) for name in ("events_room", "events_used")),
        *((name, c_int32) for name in ("hears_pauses", "wants_to_end")),
        *((name, c_double) for name in ("start", "target", "goal", "reached")),
        ("at_event", POINTER(c_int32)),
        *((name, c_int32) for name in ("arrived", "at", "status")),
    ]


class ChosenStep(Structure):
    """A step on trial with its estimate; the fields are explained in `door/chosen_step.h`."""

    _fields_ = [
        ("trial", POINTER(CouplingComponent)),
        *((name, CouplingCalls) for name in ("moves", "read", "save_end", "restore_end")),
        *((name, c_void_p) for name in ("at_event", "kept_times", "kept_flags")),
        *((name, c_int64) for name in ("count", "units")),
        *((name, c_void_p) for name in ("unit", "known", "since", "rounding", "all_known", "largest")),
        *((name, c_void_p) for name in ("whole", "before", "halves")),
        *(
            (name, c_double)
            for name in ("window", "tolerance", "share", "rounding_part", "steady", "smallest")
        ),
        *((name, c_double) for name in ("shortest", "first_size")),
        ("worst", c_int64),
        ("error", c_double),
    ]


@cache
def _chosen_step() -> Any:
    function = core_library().vi_door_chosen_step
    function.argtypes = [
        POINTER(CouplingPlan),
        POINTER(ChosenStep),
        POINTER(CouplingProgress),
        POINTER(CouplingRun),
    ]
    return function


def try_chosen_step(
    plan: CouplingPlan, chosen: ChosenStep, progress: CouplingProgress, run: CouplingRun
) -> CouplingEnd:
    """Make the step of a run from `start` to `target`, s, and estimate its error by two half steps.

    Parameters
    ----------
    plan : CouplingPlan
        The components and their calls; all have saved states.
    chosen : ChosenStep
        Receives the error over the tolerance.
    progress : CouplingProgress
        Counts repeated steps.
    run : CouplingRun

    Returns
    -------
    CouplingEnd
        `reached`: the step can be accepted or taken back. `listen`: all are back at the start, and the caller makes the
        step. `stepped`, `failed`: a call has returned a bad status.
    """
    return CouplingEnd(_chosen_step()(plan, chosen, progress, run))


@cache
def _function() -> Any:
    function = core_library().vi_door_coupling
    function.argtypes = [POINTER(CouplingPlan), POINTER(CouplingProgress), POINTER(CouplingRun)]
    return function


def advance_coupled(plan: CouplingPlan, progress: CouplingProgress, run: CouplingRun) -> CouplingEnd:
    """Advance components to `run.end` by their own functions, without Python in between; other threads may run then.

    Parameters
    ----------
    plan : CouplingPlan
        The components and their calls.
    progress : CouplingProgress
        Progress of the run, which the call updates.
    run : CouplingRun

    Returns
    -------
    CouplingEnd
        `listen`: `most_seconds` have passed. `stepped`, `reached`: the caller finishes the step. `failed`: a call
        failed. `endless`: the events do not settle. `cut`: a component takes steps of another size.
    """
    return CouplingEnd(_function()(plan, progress, run))

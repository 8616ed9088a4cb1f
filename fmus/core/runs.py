"""Many runs of one body in one call: the loop over the points of a chunk, in C."""

from __future__ import annotations

import ctypes
from ctypes import POINTER, Structure, c_double, c_int32, c_int64, c_uint32, c_void_p
from enum import IntEnum
from functools import cache
from typing import Any

from vibroimpact.fmus.core.library import core_library


class RunsEnd(IntEnum):
    """Reason why `run_points` has returned."""

    done = 0
    listen = 1
    full = 2
    refused = 3


class RunsFmu(Structure):
    """Addresses of the FMI 3.0 functions of one instance; `log` is the address of its `LogTail`."""

    FUNCTIONS = (
        "Reset", "EnterInitializationMode", "ExitInitializationMode", "DoStep", "SetFloat64", "GetFloat64",
        "SetInt64", "GetInt64", "SetBoolean", "GetBoolean",
    )  # fmt: skip
    _fields_ = [(name, c_void_p) for name in ("instance", *FUNCTIONS, "log")]


class RunsVariables(Structure):
    """Variables of one type, by their value references."""

    _fields_ = [("references", c_void_p), ("count", ctypes.c_size_t)]


class RunsPlan(Structure):
    """The plan, common to all points; the fields are explained in `door/runs.h`."""

    _fields_ = [
        *((name, RunsVariables) for name in ("parameters", "integers", "booleans")),
        ("columns", c_int32),
        ("places", c_void_p),
        ("elements", c_void_p),
        ("size", ctypes.c_size_t),
        ("integer_values", c_void_p),
        ("boolean_values", c_void_p),
        ("switches", RunsVariables),
        ("switch_values", c_void_p),
        *((name, RunsVariables) for name in ("finals", "flags")),
        ("finals_size", ctypes.c_size_t),
        *((name, c_uint32) for name in ("record_count", "record_taken", "record_rows")),
        *((name, c_int32) for name in ("row_capacity", "chained", "displacement", "velocity", "phase", "stops")),
        ("stop_position", c_void_p),
        ("stop_direction", c_void_p),
    ]  # fmt: skip


class RunsPoints(Structure):
    """The points and their progress; the fields are explained in `door/runs.h`."""

    ARRAYS = (
        "values", "begin", "end", "first", "outcome", "reached", "seconds", "finals", "flags", "rows_of", "rows",
    )  # fmt: skip
    _fields_ = [
        ("count", c_int64),
        *((name, c_void_p) for name in ARRAYS),
        *((name, c_int64) for name in ("rows_room", "rows_used")),
        ("carried", c_double * 2),
        *((name, c_int32) for name in ("has_carried", "give_up")),
        ("most_seconds", c_double),
        ("at", c_int64),
        ("stage", c_int32),
        *((name, c_double) for name in ("time", "spent")),
    ]


@cache
def _function() -> Any:
    function = core_library().vi_door_runs
    function.argtypes = [POINTER(RunsFmu), POINTER(RunsPlan), POINTER(RunsPoints)]
    return function


def run_points(fmu: RunsFmu, plan: RunsPlan, points: RunsPoints) -> RunsEnd:
    """Run the remaining points, without Python in between; other threads can run meanwhile.

    Parameters
    ----------
    fmu : RunsFmu
        The instance; each of its runs begins with a reset.
    plan : RunsPlan
    points : RunsPoints
        Filled as far as the runs came.

    Returns
    -------
    RunsEnd
        `listen`: `most_seconds` have passed. `full`: there is no room for more rows. `refused`: the caller must handle
        the point `at`. After each of these another call continues.
    """
    return RunsEnd(_function()(fmu, plan, points))

"""Many runs of one body by one call: the loop over the points of a chunk, in C."""

from __future__ import annotations

import ctypes
from ctypes import POINTER, Structure, c_double, c_int32, c_int64, c_uint32, c_void_p
from enum import IntEnum
from functools import cache
from typing import Any

from numpy.typing import NDArray

from vibroimpact.fmus.core.library import core_library


class RunsEnd(IntEnum):
    """Why `run_points` has returned."""

    done = 0
    listen = 1
    full = 2
    refused = 3


class RunsFmu(Structure):
    """The functions of FMI 3.0 of one instance, as addresses; `log` is that of its `LogTail`."""

    FUNCTIONS = (
        "Reset", "EnterInitializationMode", "ExitInitializationMode", "DoStep", "SetFloat64", "GetFloat64",
        "SetInt64", "GetInt64", "SetBoolean", "GetBoolean",
    )  # fmt: skip
    _fields_ = [(name, c_void_p) for name in ("instance", *FUNCTIONS, "log")]


class RunsVariables(Structure):
    """Variables of one type, by their value references."""

    _fields_ = [("references", c_void_p), ("count", ctypes.c_size_t)]


class RunsPlan(Structure):
    """What all points have in common; `door/runs.h` says what each field is."""

    _fields_ = [
        *((name, RunsVariables) for name in ("parameters", "integers", "booleans")),
        ("integer_values", c_void_p),
        ("boolean_values", c_void_p),
        ("switches", RunsVariables),
        ("switch_values", c_void_p),
        *((name, RunsVariables) for name in ("finals", "flags")),
        *((name, c_uint32) for name in ("record_count", "record_taken", "record_rows")),
        *((name, c_int32) for name in ("row_capacity", "chained", "displacement", "velocity", "phase", "stops")),
        ("stop_position", c_void_p),
        ("stop_direction", c_void_p),
    ]  # fmt: skip


class RunsPoints(Structure):
    """The points, and how far they are; `door/runs.h` says what each field is."""

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


def address(array: NDArray[Any]) -> int:
    """Return where the values of a contiguous array are."""
    if not array.flags.c_contiguous:
        raise ValueError("address: expected a contiguous array")
    return int(array.ctypes.data)


@cache
def _function() -> Any:
    function = core_library().vi_door_runs
    function.argtypes = [POINTER(RunsFmu), POINTER(RunsPlan), POINTER(RunsPoints)]
    return function


def run_points(fmu: RunsFmu, plan: RunsPlan, points: RunsPoints) -> RunsEnd:
    """Run what is left of the points, without Python in between; other threads go on meanwhile.

    Parameters
    ----------
    fmu : RunsFmu
        The instance; each of its runs begins with a reset.
    plan : RunsPlan
    points : RunsPoints
        They are filled as far as the runs came.

    Returns
    -------
    RunsEnd
        `listen`: it has taken `most_seconds`; `full`: there is no room for more rows; `refused`: the point `at` is for
        the caller. After each of them another call goes on.
    """
    return RunsEnd(_function()(fmu, plan, points))

"""A block of samples of one body in one call, with its input held or linear between samples: the loop, in C."""

from __future__ import annotations

from ctypes import POINTER, Structure, c_double, c_int32, c_int64, c_uint32, c_void_p
from enum import IntEnum
from functools import cache
from typing import Any

from vibroimpact.fmus.core.library import core_library
from vibroimpact.fmus.core.runs import RunsFmu, RunsVariables


class HoldEnd(IntEnum):
    """Reason why `hold_samples` has returned."""

    done = 0
    refused = 1
    limit = 2
    again = 3
    touches = 4
    ends = 5


class Magnet(Structure):
    """An exciter that turns a voltage into a force; the fields are explained in `measuring/magnet.h`."""

    _fields_ = [*((name, c_double) for name in ("gain", "offset", "distance")), ("side", c_int32)]


class HoldPlan(Structure):
    """The plan, common to all blocks; the fields are explained in `door/stepping.h`."""

    _fields_ = [
        ("input", c_uint32),
        ("input_rate", c_uint32),
        ("outputs", RunsVariables),
        ("reads_begin", c_int32),
        ("magnet", POINTER(Magnet)),
        *((name, c_uint32) for name in ("displacement", "record_count", "record_taken", "record_rows")),
        ("row_capacity", c_int32),
    ]


class HoldBlock(Structure):
    """The samples and their progress; the fields are explained in `door/stepping.h`."""

    _fields_ = [
        ("count", c_int64),
        *((name, c_void_p) for name in ("ends", "inputs", "rates", "renewed", "samples")),
        ("at", c_int64),
        ("time", c_double),
        ("begun", c_int32),
        ("rows", c_void_p),
        *((name, c_int64) for name in ("rows_room", "rows_used")),
    ]


@cache
def _function() -> Any:
    function = core_library().vi_door_hold
    function.argtypes = [POINTER(RunsFmu), POINTER(HoldPlan), POINTER(HoldBlock)]
    return function


def hold_samples(fmu: RunsFmu, plan: HoldPlan, block: HoldBlock) -> HoldEnd:
    """Take the samples of a block, without Python in between; other threads can run meanwhile.

    Parameters
    ----------
    fmu : RunsFmu
        The instance; it does not record, or the plan says where.
    plan : HoldPlan
    block : HoldBlock
        Filled as far as the body came.

    Returns
    -------
    HoldEnd
        `refused`: the body failed in the step to the sample `at`. `limit`: it reached its limit of impacts there.
        `touches`: it touches its exciter. `again`: take the rows of the block, set `rows_used` to 0, and call again.
    """
    return HoldEnd(_function()(fmu, plan, block))

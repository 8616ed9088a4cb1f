"""A block of samples of one body by one call, its force held between them: the loop over the samples, in C."""

from __future__ import annotations

from ctypes import POINTER, Structure, c_double, c_int64, c_uint32, c_void_p
from enum import IntEnum
from functools import cache
from typing import Any

from vibroimpact.fmus.core.library import core_library
from vibroimpact.fmus.core.runs import RunsFmu, RunsVariables


class HoldEnd(IntEnum):
    """Why `hold_samples` has returned."""

    done = 0
    refused = 1
    limit = 2


class HoldPlan(Structure):
    """What all blocks have in common; `door/stepping.h` says what each field is."""

    _fields_ = [("force", c_uint32), ("force_rate", c_uint32), ("outputs", RunsVariables)]


class HoldBlock(Structure):
    """The samples, and how far they are; `door/stepping.h` says what each field is."""

    _fields_ = [
        ("count", c_int64),
        *((name, c_void_p) for name in ("ends", "forces", "samples")),
        ("at", c_int64),
        ("time", c_double),
    ]


@cache
def _function() -> Any:
    function = core_library().vi_door_hold
    function.argtypes = [POINTER(RunsFmu), POINTER(HoldPlan), POINTER(HoldBlock)]
    return function


def hold_samples(fmu: RunsFmu, plan: HoldPlan, block: HoldBlock) -> HoldEnd:
    """Take the samples of a block, without Python in between; other threads go on meanwhile.

    Parameters
    ----------
    fmu : RunsFmu
        The instance; it does not record.
    plan : HoldPlan
    block : HoldBlock
        It is filled as far as the body came.

    Returns
    -------
    HoldEnd
        `refused`: the body failed in the step to the sample `at`; `limit`: it met its limit of impacts there.
    """
    return HoldEnd(_function()(fmu, plan, block))

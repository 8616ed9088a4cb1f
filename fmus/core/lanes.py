"""Many points at once: runs of one body in the lanes of the vector registers, in C."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Sequence
from ctypes import POINTER, Structure, c_double, c_int32, c_int64, c_size_t, c_void_p
from enum import IntEnum
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.core.library import core_library
from vibroimpact.fmus.errors import UsageError

MOST_MODES = 8
MOST_CONTACTS = 4
MOST_SINES = 8
IMPACT_WIDTH = 8
PERIOD_WIDTH = 5
"""Numbers of columns of an impact and of a period, see `lanes/lane_points.h`."""

CHOICE = "VIBROIMPACT_INSTRUCTIONS"


class LanesEnd(IntEnum):
    """Reason why `run_lanes` has returned; see `lanes/lanes.h`."""

    done = 0
    listen = 1
    full = 2
    left = 3


class PointState(IntEnum):
    """Progress of a point."""

    waits = 0
    runs = 1
    has_run = 2
    is_left = 3
    is_answered = 4


class Instructions(IntEnum):
    """Instruction sets that the lanes are compiled for; `best` is the best one of the machine."""

    best = 0
    baseline = 1
    avx2 = 2
    avx512 = 3


class LanesPlan(Structure):
    """The plan, common to all points; the fields are explained in `lanes/lanes.h`."""

    _fields_ = [
        *(
            (name, c_int32)
            for name in (
                *("modes", "contacts", "impacts", "extrema", "periods", "each_period", "instructions"),
                *("coupled", "further"),
            )
        ),
        ("impact_limit", c_int64),
        ("yielding", c_int64),
        ("sampled", c_int64),
        ("rate", c_double),
    ]


class LanesPoints(Structure):
    """The points and their results; the fields are explained in `lanes/lanes.h`."""

    GIVEN = (
        "stiffness", "decay", "force", "held", "angular_frequency", "phase",
        "further_force", "further_frequency", "further_phase", "shape", "impulse", "coupling", "observed",
        "position", "direction", "restitution", "yield_velocity", "contact_stiffness", "contact_damping",
        "start_q", "start_p", "begin", "end", "first",
    )  # fmt: skip
    RESULTS = (
        "state", "outcome", "reached", "displacement", "velocity", "final_q", "final_p", "periods", "periods_of",
    )  # fmt: skip
    OF_ROWS = ("rows_of", "rows", "owner")
    _fields_ = [
        ("count", c_int64),
        *((name, c_void_p) for name in (*GIVEN, *RESULTS)),
        ("most_periods", c_int64),
        ("samples", c_void_p),
        ("samples_of", c_void_p),
        ("most_samples", c_int64),
        *((name, c_void_p) for name in OF_ROWS),
        *((name, c_int64) for name in ("rows_room", "rows_used", "begun_below", "finished")),
        ("most_seconds", c_double),
    ]


@cache
def _functions() -> tuple[Any, Any, Any, Any]:
    library = core_library()
    run, memory, instructions, impacts = (
        getattr(library, f"vi_door_lanes{name}") for name in ("", "_memory", "_instructions", "_impacts")
    )
    run.argtypes = [POINTER(LanesPlan), POINTER(LanesPoints), c_void_p]
    memory.argtypes, memory.restype = [POINTER(LanesPlan)], c_size_t
    instructions.argtypes = [ctypes.c_int]
    impacts.argtypes = [c_void_p, c_void_p, c_int64, c_void_p, c_int64, c_void_p]
    impacts.restype = None
    return run, memory, instructions, impacts


def instructions() -> Instructions:
    """Return the instruction set of the lanes: `$VIBROIMPACT_INSTRUCTIONS`, by default the best of this machine.

    Raises
    ------
    UsageError
        The variable names an unknown instruction set, or one that this machine lacks.
    """
    chosen = os.environ.get(CHOICE) or "best"
    instruction_set = Instructions.__members__.get(chosen)
    found = 0 if instruction_set is None else _functions()[2](instruction_set)
    if not found:
        has = [name for name, each in Instructions.__members__.items() if each and _functions()[2](each)]
        raise UsageError(f"{CHOICE}: expected one that this machine has ({', '.join(has)}), got {chosen!r}.")
    return Instructions(found)


def lanes_memory(plan: LanesPlan) -> NDArray[np.uint8]:
    """Return memory for runs in progress between two calls, for points that have not begun.

    Raises
    ------
    UsageError
        The plan has too many modes or contacts, or an instruction set that this machine lacks.
    """
    size = _functions()[1](plan)
    if size == 0:
        raise UsageError(
            f"lanes: expected 1 to {MOST_MODES} modes, 0 to {MOST_CONTACTS} contacts and instructions "
            f"that this machine has, got {plan.modes}, {plan.contacts} and {plan.instructions}."
        )
    return np.zeros(size, dtype=np.uint8)


def run_lanes(plan: LanesPlan, points: LanesPoints, memory: NDArray[np.uint8]) -> LanesEnd:
    """Run the remaining points, without Python in between; other threads can run meanwhile.

    Parameters
    ----------
    plan : LanesPlan
    points : LanesPoints
        Filled as far as the runs came.
    memory : ndarray of uint8
        Memory from `lanes_memory`, kept with these points from their first call to their last.

    Returns
    -------
    LanesEnd
        `listen`: `most_seconds` have passed. `full`: there is no room for more rows. `left`: the points that have not
        run need the scalar engine, or wait for such a point of their branch. After each of these another call
        continues.
    """
    return LanesEnd(_functions()[0](plan, points, memory.ctypes.data))


def impacts_by_point(
    blocks: Sequence[tuple[NDArray[np.float64], NDArray[np.int64]]], count: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return the impacts of the points, point by point, shape (impact, `IMPACT_WIDTH`); each column is contiguous.

    Parameters
    ----------
    blocks : sequence of tuple of ndarray
        Rows of impacts, and the point of each, in the order in which C wrote them.
    count : ndarray of int64, shape (point,)
        Number of impacts of each point; 0 for a point whose impacts are left out.
    """
    total = int(count.sum())
    places = np.where(count > 0, np.cumsum(count) - count, -1)
    columns = np.empty((IMPACT_WIDTH, total))
    for rows, owner in blocks:
        _functions()[3](
            rows.ctypes.data, owner.ctypes.data, len(owner), places.ctypes.data, total, columns.ctypes.data
        )
    return columns.T

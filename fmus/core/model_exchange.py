"""An FMU for model exchange with its solver, in C: the memory that C and Python share, and the functions."""

from __future__ import annotations

import ctypes
from ctypes import POINTER, Structure, c_double, c_int32, c_int64, c_void_p
from enum import IntEnum
from typing import Any

from vibroimpact.fmus.core.library import core_library


class ExchangeCall(IntEnum):
    """A function of the FMU; see `door/model_exchange.h`."""

    set_time = 0
    set_states = 1
    get_states = 2
    derivatives = 3
    indicators = 4
    nominals = 5
    completed = 6
    enter_event = 7
    update = 8
    enter_continuous = 9
    save = 10
    restore = 11
    free = 12
    set_inputs = 13
    get_watched = 14
    set_forces = 15


class ExchangeReason(IntEnum):
    """Reason of an error."""

    status = 0
    not_finite = 1
    solver = 2
    steps = 3
    time = 4
    endless = 5
    short = 6


class CVode(Structure):
    """Addresses of CVODE's functions, in the order of `door/cvode.h`."""

    _fields_ = [
        (name, c_void_p)
        for name in (
            *("create_context", "free_context", "clear_messages", "push_message"),
            *("make_vector", "vector_data", "free_vector", "make_matrix", "free_matrix"),
            *("make_linear", "free_linear", "create", "free", "init", "begin_anew"),
            *("set_weights", "set_roots", "set_directions", "roots_found", "motion"),
            *("set_linear", "set_user", "set_stop", "set_longest"),
            *("no_root_warning", "set_warnings", "current_time", "advance"),
        )
    ]


class WatchedLaw(Structure):
    """The contact law of a watched stop; the fields are explained in `contact/contact_law.h`."""

    _fields_ = [
        ("law", c_int64),
        *((name, c_double) for name in ("restitution", "yield_velocity", "stiffness", "damping", "exponent")),
    ]


class ExchangeWatch(Structure):
    """A watched point of an FMU; the fields are explained in `door/model_exchange.h`."""

    _fields_ = [
        *((name, c_double) for name in ("factor", "offset", "room", "level")),
        *((name, c_double) for name in ("start", "start_rate", "end", "end_rate")),
        *((name, c_int32) for name in ("value", "rate", "direction", "is_armed")),
        *((name, c_int32) for name in ("is_pressed", "was_pressed", "force")),
        ("law", WatchedLaw),
        *((name, c_double) for name in ("impulse", "largest")),
    ]


class Exchange(Structure):
    """An FMU with its solver; the fields are explained in `door/model_exchange.h`."""

    _fields_ = [
        ("fmu", c_void_p),
        ("cvode", POINTER(CVode)),
        ("calls", c_void_p * len(ExchangeCall)),
        ("noted_call", c_void_p),
        ("numbers", c_int64 * len(ExchangeCall)),
        *((name, c_void_p) for name in ("states", "kept", "absolute", "indicators", "compared")),
        *((name, c_void_p) for name in ("watches", "watched", "values", "roots", "directions")),
        *((name, c_void_p) for name in ("forces", "given", "point", "instants", "samples")),
        *((name, c_int64) for name in ("state_count", "indicator_count", "most_steps")),
        *((name, c_int64) for name in ("watch_count", "watched_count", "force_count")),
        *((name, c_int64) for name in ("instant_count", "sample_count")),
        *((name, c_int32) for name in ("most_iterations", "version", "needs_completed", "restorable")),
        *((name, c_double) for name in ("tolerance", "time", "next_event")),
        *((name, c_void_p) for name in ("context", "solver", "vector", "matrix", "linear")),
        ("point_vector", c_void_p),
        *((name, c_int32) for name in ("has_begun", "in_event_mode", "ends", "begins_anew")),
        *((name, c_int32) for name in ("inputs_changed", "nominals_changed")),
        *((name, c_int32) for name in ("gives_forces", "meets")),
        *((name, c_int32) for name in ("function", "reason", "solver_flag", "cause", "failure")),
        *((name, c_int64) for name in ("derivative_calls", "solver_steps", "first_step")),
    ]


class ExchangeInput(Structure):
    """Inputs that are set together; the fields are explained in `door/model_exchange.h`."""

    _fields_ = [
        ("exchange", POINTER(Exchange)),
        *((name, c_void_p) for name in ("get", "set", "values", "discrete")),
        *((name, c_int64) for name in ("size", "number")),
    ]


def exchange_function(name: str) -> Any:
    """Return the function `vi_door_exchange_NAME`; it has no argument types, so it takes ready-made objects only."""
    return core_library()[f"vi_door_exchange_{name}"]


def exchange_address(name: str) -> c_void_p:
    """Return the address of the function `vi_door_exchange_NAME`."""
    return ctypes.cast(exchange_function(name), c_void_p)

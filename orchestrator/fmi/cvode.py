"""CVODE of SUNDIALS 7, as FMPy carries it: loaded once, and handed to C code as addresses."""

from __future__ import annotations

import ctypes
import importlib.util
import platform
import sys
from functools import cache
from pathlib import Path

from vibroimpact.fmus.core.model_exchange import CVode
from vibroimpact.fmus.errors import ComponentError

#: The only major version whose functions have the forms that `door/cvode.h` declares.
MAJOR_VERSION = 7
#: Libraries in the order in which they need each other.
LIBRARIES = ("core", "nvecserial", "sunmatrixdense", "sunlinsoldense", "cvode")
#: CVODE's names of the fields of `CVode`.
FUNCTIONS = {
    "create_context": "SUNContext_Create",
    "free_context": "SUNContext_Free",
    "clear_messages": "SUNContext_ClearErrHandlers",
    "push_message": "SUNContext_PushErrHandler",
    "make_vector": "N_VMake_Serial",
    "vector_data": "N_VGetArrayPointer",
    "free_vector": "N_VDestroy",
    "make_matrix": "SUNDenseMatrix",
    "free_matrix": "SUNMatDestroy",
    "make_linear": "SUNLinSol_Dense",
    "free_linear": "SUNLinSolFree",
    "create": "CVodeCreate",
    "free": "CVodeFree",
    "init": "CVodeInit",
    "begin_anew": "CVodeReInit",
    "set_weights": "CVodeWFtolerances",
    "set_roots": "CVodeRootInit",
    "set_directions": "CVodeSetRootDirection",
    "roots_found": "CVodeGetRootInfo",
    "motion": "CVodeGetDky",
    "set_linear": "CVodeSetLinearSolver",
    "set_user": "CVodeSetUserData",
    "set_stop": "CVodeSetStopTime",
    "set_longest": "CVodeSetMaxStep",
    "no_root_warning": "CVodeSetNoInactiveRootWarn",
    "set_warnings": "CVodeSetMaxHnilWarns",
    "current_time": "CVodeGetCurrentTime",
    "advance": "CVode",
}


def platform_folder() -> str:
    """Return FMPy's name of the folder of libraries for this machine, such as `x86_64-linux`."""
    system = {"win32": "windows", "darwin": "darwin"}.get(sys.platform, sys.platform)
    machine = platform.machine().lower()
    names = {"amd64": "x86_64", "arm64": "aarch64"}
    return f"{names.get(machine, machine)}-{system}"


def _folder() -> Path:
    spec = importlib.util.find_spec("fmpy")
    places = spec.submodule_search_locations if spec is not None else None
    return Path(next(iter(places or ()), "")) / "sundials" / platform_folder()


@cache
def cvode() -> CVode:
    """Return the addresses of CVODE's functions.

    Raises
    ------
    ComponentError
        FMPy has no library for this machine, or one of another version.
    """
    suffix = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
    files = [_folder() / f"sundials_{name}{suffix}" for name in LIBRARIES]
    try:
        libraries = [ctypes.CDLL(str(file)) for file in files]
        found = {field: _address(libraries, name) for field, name in FUNCTIONS.items()}
        major = _major_version(libraries[0])
    except (OSError, AttributeError) as error:
        raise ComponentError(
            f"model exchange: expected CVODE of SUNDIALS {MAJOR_VERSION} for this machine in FMPy "
            f"(fmpy/sundials/{platform_folder()}), got: {error}. FMPy carries it for x86_64-linux, x86_64-windows and "
            'aarch64-darwin; elsewhere an FMU runs with run_as = "co_simulation".'
        ) from error
    if major != MAJOR_VERSION:
        raise ComponentError(
            f"model exchange: expected CVODE of SUNDIALS {MAJOR_VERSION} in FMPy, got SUNDIALS {major}."
        )
    return CVode(**found)


def _address(libraries: list[ctypes.CDLL], name: str) -> int | None:
    """Return the address of a function of the first library that has it; AttributeError without one."""
    for library in libraries:
        if hasattr(library, name):
            return ctypes.cast(getattr(library, name), ctypes.c_void_p).value
    raise AttributeError(f"no function {name}")


def _major_version(library: ctypes.CDLL) -> int:
    numbers = [ctypes.c_int() for _ in range(3)]
    label = ctypes.create_string_buffer(24)
    library.SUNDIALSGetVersionNumber(*map(ctypes.byref, numbers), label, ctypes.c_int(len(label)))
    return numbers[0].value

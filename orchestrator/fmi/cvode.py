"""CVODE of SUNDIALS 7, as FMPy or scikit-sundae carries it: loaded once, and handed to C code as addresses."""

from __future__ import annotations

import ctypes
import importlib.util
import platform
import re
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


def package_folder(name: str) -> Path | None:
    """Return the folder of an installed package, which is not imported."""
    spec = importlib.util.find_spec(name)
    places = spec.submodule_search_locations if spec is not None else None
    return Path(next(iter(places))) if places else None


def _files() -> list[Path]:
    """Return the libraries in the order of their names: FMPy's, or where it has none those of scikit-sundae's wheel."""
    suffix = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
    fmpy, sundae = (package_folder(name) for name in ("fmpy", "sksundae"))
    own = (fmpy or Path()) / "sundials" / platform_folder()
    if own.is_dir() or sundae is None:
        return [own / f"sundials_{name}{suffix}" for name in LIBRARIES]
    # wheels put a mark behind the names of the libraries that they carry
    places = (sundae.parent / "scikit_sundae.libs", sundae / ".dylibs")
    carried = [file for place in places if place.is_dir() for file in sorted(place.iterdir())]
    return [
        next((file for file in carried if re.match(rf"(lib)?sundials_{name}[-.]", file.name)), own / name)
        for name in LIBRARIES
    ]


@cache
def cvode() -> CVode:
    """Return the addresses of CVODE's functions.

    Raises
    ------
    ComponentError
        Neither FMPy nor scikit-sundae has a library for this machine, or it has another version.
    """
    files = _files()
    try:
        libraries = [ctypes.CDLL(str(file)) for file in files]
        found = {field: _address(libraries, name) for field, name in FUNCTIONS.items()}
        major = _major_version(libraries[0])
    except (OSError, AttributeError) as error:
        raise ComponentError(
            f"model exchange: expected CVODE of SUNDIALS {MAJOR_VERSION} for this machine in FMPy "
            f"(fmpy/sundials/{platform_folder()}), got: {error}. FMPy carries it for x86_64-linux, x86_64-windows and "
            "aarch64-darwin; elsewhere install scikit-sundae (extra cvode), or run the FMU with "
            'run_as = "co_simulation".'
        ) from error
    if major != MAJOR_VERSION:
        raise ComponentError(
            f"model exchange: expected CVODE of SUNDIALS {MAJOR_VERSION} in {files[0].parent}, got SUNDIALS {major}."
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

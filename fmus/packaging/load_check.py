"""Check of an FMU's binary by loading it.

It runs in a separate process, since the code of a broken FMU may do anything.
"""

from __future__ import annotations

import ctypes
import re
import sys
from collections.abc import Iterator
from ctypes import CDLL, CFUNCTYPE, POINTER, Structure, c_bool, c_char_p, c_int, c_size_t, c_void_p
from pathlib import Path
from typing import Any

from vibroimpact.fmus.packaging.build import fmi_headers

EXPORTED = {"2": r"FMI2_Export\s+fmi2\w+TYPE\s+(fmi2\w+);", "3": r"FMI3_Export\s+fmi3\w+TYPE\s+(fmi3\w+);"}
#: Parts of FMI 2.0's header: FMI 2.0 requires only the functions of the FMU's interfaces, FMI 3.0 requires all.
MODEL_EXCHANGE = re.compile(
    r"(?s)Functions for FMI2 for Model Exchange.*?Functions for FMI2 for Co-Simulation"
)
CO_SIMULATION = re.compile(r"(?s)Functions for FMI2 for Co-Simulation.*")
WRONG_TOKEN = "{not the token of any model}"
#: Functions, without their prefix, that this package's importer needs for an instance for co-simulation.
NEEDED = {
    *("Instantiate", "InstantiateCoSimulation", "FreeInstance", "SetupExperiment", "EnterInitializationMode"),
    *("ExitInitializationMode", "Terminate", "Reset", "DoStep", "EnterEventMode", "EnterStepMode"),
    "UpdateDiscreteStates",
}
#: Functions that it needs for an FMU with canGetAndSetFMUState.
NEEDED_FOR_STATES = {"GetFMUstate", "SetFMUstate", "GetFMUState", "SetFMUState"}
CO_SIMULATION_INTERFACE = "CoSimulation"
REFUSED, REMARK = "refused", "remark"

Found = tuple[str, str]

Logger = CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)
Allocate = CFUNCTYPE(c_void_p, c_size_t, c_size_t)
Free = CFUNCTYPE(None, c_void_p)
StepFinished = CFUNCTYPE(None, c_void_p, c_int)


class Fmi2Callbacks(Structure):
    """FMI 2.0's fmi2CallbackFunctions."""

    _fields_ = (
        ("logger", Logger),
        ("allocateMemory", Allocate),
        ("freeMemory", Free),
        ("stepFinished", StepFinished),
        ("componentEnvironment", c_void_p),
    )


def problems_of(facts: dict[str, Any]) -> list[Found]:
    """Return the problems of a binary, each with the name of its grade and a line.

    The facts are `binary`, `fmi_version`, `token`, `interfaces` (CoSimulation, ...) and `resources` (a folder). Three
    are truth values: `restorable` (canGetAndSetFMUState), `event_mode` (hasEventMode), and `any_token`: the binary is
    known to accept every token.
    """
    name = Path(facts["binary"]).name
    try:
        library = CDLL(facts["binary"])
    except OSError as error:
        said = str(error).replace(facts["binary"], name)
        return [(REFUSED, f"{name}: expected a library that loads, got: {said}.")]
    return [
        found
        for interface in facts["interfaces"]
        for found in _problems_of_interface(library, {**facts, "interface": interface})
    ]


def _problems_of_interface(library: CDLL, facts: dict[str, Any]) -> Iterator[Found]:
    name = Path(facts["binary"]).name
    runs = facts["interface"] == CO_SIMULATION_INTERFACE or CO_SIMULATION_INTERFACE not in facts["interfaces"]
    required = required_functions(facts["fmi_version"], facts["interface"])
    missing = [function for function in required if not hasattr(library, function)]
    if missing:
        version = facts["fmi_version"]
        # an FMU runs without functions that this importer never calls
        called = NEEDED | (NEEDED_FOR_STATES if facts["restorable"] else set())
        needed = runs and any(function[len("fmi2") :] in called for function in missing)
        text = f"{name}: expected all functions of FMI {version}, got none called {', '.join(missing)}."
        yield REFUSED if needed else REMARK, text
        if needed or not hasattr(library, instantiating_function(facts)):
            return
    if not _opens(library, facts, facts["token"]):
        text = f"{name}: expected an instance for the token of the description, got none."
        yield REFUSED if runs else REMARK, text
    if not facts["any_token"] and _opens(library, facts, WRONG_TOKEN):
        yield REMARK, f"{name}: expected no instance for a wrong token, got one: its token is not checked."


def instantiating_function(facts: dict[str, Any]) -> str:
    """Return the function that makes an instance of an interface."""
    return f"fmi3Instantiate{facts['interface']}" if facts["fmi_version"][0] == "3" else "fmi2Instantiate"


def required_functions(fmi_version: str, interface: str) -> list[str]:
    """Return the functions that FMI's own header declares for an interface."""
    major = fmi_version[0]
    text = (fmi_headers() / f"fmi{major}Functions.h").read_text(encoding="utf-8", errors="replace")
    _, _, declared = text.rpartition("Common Functions")
    if major == "2":
        other = MODEL_EXCHANGE if interface == "CoSimulation" else CO_SIMULATION
        declared = other.sub("", declared)
    return re.findall(EXPORTED[major], declared)


def _opens(library: CDLL, facts: dict[str, Any], token: str) -> bool:
    major = facts["fmi_version"][0]
    instance = (instance3 if major == "3" else instance2)(library, facts, token.encode())
    if not instance and facts["event_mode"]:  # it may make none without
        instance = instance3(library, facts, token.encode(), event_mode=True)
    if not instance:
        return False
    if not hasattr(library, f"fmi{major}FreeInstance"):
        return True
    free = library[f"fmi{major}FreeInstance"]
    free.argtypes, free.restype = [c_void_p], None
    free(instance)
    return True


def instance3(library: CDLL, facts: dict[str, Any], token: bytes, *, event_mode: bool = False) -> Any:
    """Return the address of an instance of FMI 3.0; None or 0 without one."""
    function = library[instantiating_function(facts)]
    function.restype = c_void_p
    log = CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)(lambda *_: None)
    # an absolute path that ends with a separator
    resources = c_char_p(facts["resources"].encode() + b"/")
    head = (c_char_p(b"check"), c_char_p(token), resources, c_bool(False), c_bool(False))
    if facts["interface"] == "CoSimulation":
        # no early return, no intermediate variables, no intermediate update
        events = (c_bool(event_mode), c_bool(False), POINTER(ctypes.c_uint32)(), c_size_t(0))
        return function(*head, *events, c_void_p(), log, c_void_p())
    rest = (c_void_p(), c_void_p(), c_void_p()) if facts["interface"] == "ScheduledExecution" else ()
    return function(*head, c_void_p(), log, *rest)


def instance2(library: CDLL, facts: dict[str, Any], token: bytes) -> Any:
    """Return the address of an instance of FMI 2.0; None or 0 without one."""
    function = library["fmi2Instantiate"]
    function.restype = c_void_p
    kind = c_int(0 if facts["interface"] == "ModelExchange" else 1)
    location = c_char_p(Path(facts["resources"]).as_uri().encode())
    # FMI 2.0 keeps a pointer to the callbacks while the instance lives: until this process ends
    runtime = ctypes.cdll.msvcrt if sys.platform == "win32" else CDLL(None)
    allocate, free = Allocate(("calloc", runtime)), Free(("free", runtime))
    _kept.append(Fmi2Callbacks(Logger(lambda *_: None), allocate, free, StepFinished(), None))
    pointer = ctypes.byref(_kept[-1])
    return function(c_char_p(b"check"), kind, c_char_p(token), location, pointer, c_int(0), c_int(0))


_kept: list[Fmi2Callbacks] = []

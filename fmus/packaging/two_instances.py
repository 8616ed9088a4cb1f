"""Trial of two instances of an FMU in one process: a step of one must not change the outputs of the other.

It runs in a separate process. An FMU that refuses any call of the trial gives no verdict.
"""

from __future__ import annotations

from ctypes import CDLL, byref, c_bool, c_double, c_int, c_size_t, c_uint32, c_void_p
from typing import Any

from vibroimpact.fmus.packaging import load_check

ROUNDS = 4
"""Steps of the moving instance; the outputs of the other must change in two of them."""


def changed_outputs(facts: dict[str, Any]) -> list[int]:
    """Return the places of the outputs of an idle instance that change while another one steps.

    The facts are those of `load_check.problems_of`, `start` and `step` in s, and `references`: the value references
    of the outputs. Outputs that change by themselves, from one reading to the next, end the trial.
    """
    library = CDLL(facts["binary"])
    moving, idle = (_begun(library, facts) for _ in range(2))
    if moving is None or idle is None:
        return []
    changes: list[int] = []
    rounds, time = 0, facts["start"]
    for _ in range(ROUNDS):
        before = [_outputs(library, facts, idle) for _ in range(2)]
        if before[0] != before[1] or not _steps(library, facts, moving, time):
            return []
        time += facts["step"]
        after = [_outputs(library, facts, idle) for _ in range(2)]
        if after[0] != after[1]:
            return []
        found = [
            place for place, (old, new) in enumerate(zip(before[0], after[0], strict=True)) if old != new
        ]
        rounds += bool(found)
        changes += [place for place in found if place not in changes]
    return sorted(changes) if rounds > 1 else []


def _begun(library: CDLL, facts: dict[str, Any]) -> c_void_p | None:
    """Return an initialized instance; None if it refuses a call."""
    start, no_end = c_double(facts["start"]), c_double(0.0)
    if facts["fmi_version"][0] == "3":
        instance = c_void_p(load_check.instance3(library, facts, facts["token"].encode()))
        given = [c_bool(False), c_double(0.0), start, c_bool(False), no_end]
        calls = [("fmi3EnterInitializationMode", given), ("fmi3ExitInitializationMode", [])]
    else:
        instance = c_void_p(load_check.instance2(library, facts, facts["token"].encode()))
        given = [c_int(0), c_double(0.0), start, c_int(0), no_end]
        calls = [("fmi2SetupExperiment", given), ("fmi2EnterInitializationMode", [])]
        calls.append(("fmi2ExitInitializationMode", []))
    if not instance:
        return None
    return instance if all(library[name](instance, *words) == 0 for name, words in calls) else None


def _steps(library: CDLL, facts: dict[str, Any], instance: c_void_p, time: float) -> bool:
    at, size = c_double(time), c_double(facts["step"])
    if facts["fmi_version"][0] == "2":
        return bool(library["fmi2DoStep"](instance, at, size, c_int(1)) == 0)
    flags, end = [c_bool() for _ in range(3)], c_double()
    answers = (*map(byref, flags), byref(end))
    return bool(library["fmi3DoStep"](instance, at, size, c_bool(True), *answers) == 0)


def _outputs(library: CDLL, facts: dict[str, Any], instance: c_void_p) -> list[bytes]:
    """Return the bits of the outputs: a NaN equals itself."""
    count = len(facts["references"])
    references, values = (c_uint32 * count)(*facts["references"]), (c_double * count)()
    size = c_size_t(count)
    if facts["fmi_version"][0] == "2":
        library["fmi2GetReal"](instance, references, size, values)
    else:
        library["fmi3GetFloat64"](instance, references, size, values, size)
    return [bytes(values)[place : place + 8] for place in range(0, 8 * count, 8)]

"""One FMU for model exchange in each tool that integrates. Runs in the Python with the tool."""

from __future__ import annotations

import glob
import math
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from exchange._single import Request, Rows, columns, run_program

TOLERANCES = (1e-6, 1e-9, 1e-11)
#: Bodies to integrate, and their numbers of steps.
STEPS = {
    "oscillator": 2000,
    "chain of 3": 2000,
    "beam of 4 modes with a stop": 500,
    "oscillator, shaken base": 4000,
    "chain, shaken base": 4000,
    "beam, shaken base": 500,
    "chatter": 10_000,
}
#: Largest error of a smooth output over the tolerance: errors of single steps pass, a motion with other impacts fails.
ALLOWED = 1e6
#: The tools' usual tolerance: errors at it are listed, not judged. Chatter comes to rest too early there.
USUAL = 1e-6
#: Versions of FMI that each tool integrates.
VERSIONS = {
    "FMPy": ("2.0", "3.0"),
    "PyFMI": ("2.0", "3.0"),
    "fmusim": ("2.0", "3.0"),
    "OMSimulator": ("2.0", "3.0"),
}
#: Distance from the end of a step, in steps, within which a row counts as that end.
NEAR = 1e-7


def fmpy(request: Request) -> Rows:
    """Integrate the FMU by FMPy's CVode."""
    from fmpy import simulate_fmu

    step = request["step"]
    done = simulate_fmu(
        request["fmu"],
        fmi_type="ModelExchange",
        solver="CVode",
        relative_tolerance=request["tolerance"],
        output=request["names"],
        output_interval=step,
        stop_time=step * request["count"],
    )
    rows = ([float(row["time"]), *(float(row[name]) for name in request["names"])] for row in done)
    return list(_at_steps(rows, request))


def pyfmi(request: Request) -> Rows:
    """Integrate the FMU by PyFMI's CVode."""
    from pyfmi import load_fmu

    model = load_fmu(request["fmu"], kind="me")
    options = model.simulate_options()
    options["ncp"] = request["count"]
    options["CVode_options"] |= {"rtol": request["tolerance"], "verbosity": 50}
    options["filter"] = [glob.escape(name) for name in request["names"]]
    found = model.simulate(final_time=request["step"] * request["count"], options=options)
    rows = zip(found["time"], *(found[name] for name in request["names"]), strict=True)
    return list(_at_steps(([float(value) for value in row] for row in rows), request))


def fmusim(request: Request) -> Rows:
    """Integrate the FMU by fmusim's CVode."""
    step = request["step"]
    options = ["--interface-type", "me", "--solver", "cvode", "--tolerance", repr(request["tolerance"])]
    options += ["--stop-time", repr(step * request["count"]), "--output-interval", repr(step)]
    for name in request["names"]:
        options += ["--output-variable", name]
    run_program(request, *options, "--output-file", "f.csv", "--logging-on", request["fmu"])
    return list(_at_steps(columns(Path("f.csv"), ["time", *request["names"]]), request))


def omsimulator(request: Request) -> Rows:
    """Integrate the FMU by OMSimulator's CVode."""
    step = request["step"]
    options = ["--mode=me", "--solver=cvode", f"--tolerance={request['tolerance']!r}"]
    options += [f"--stopTime={step * request['count']!r}", f"--stepSize={step!r}", "--resultFile=r.csv"]
    run_program(request, *options, request["fmu"])
    return list(_at_steps(columns(Path("r.csv"), ["time", *request["names"]]), request))


def _at_steps(rows: Iterable[list[float]], request: Request) -> Iterator[list[float]]:
    """Yield the rows at the ends of steps; other rows belong to events.

    A row is NaN if the tool has none: fmusim takes an event within 1e-5 s of the end of a step for that end.
    """
    at: dict[int, list[float]] = {}
    for time, *row in rows:
        steps = time / request["step"]
        if abs(steps - round(steps)) < NEAR:
            at[round(steps)] = row
    none = [math.nan] * len(request["names"])
    for k in range(1, request["count"] + 1):
        yield at.get(k, none)


DRIVERS: dict[str, Callable[[Request], Rows]] = {
    "FMPy": fmpy,
    "PyFMI": pyfmi,
    "fmusim": fmusim,
    "OMSimulator": omsimulator,
}

"""One FMU in each tool: its outputs after each step. Runs in the Python with the tool."""

from __future__ import annotations

import csv
import ctypes
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

Request = dict[str, Any]
Rows = list[list[float]]


def fmpy(request: Request) -> Rows:
    """Run the FMU by FMPy."""
    from fmpy import simulate_fmu

    step, count = request["step"], request["count"]
    done = simulate_fmu(
        request["fmu"],
        output=request["names"],
        step_size=step,
        output_interval=step,
        stop_time=step * count,
    )
    return [[float(row[name]) for name in request["names"]] for row in done[1:]]


def libcosim(request: Request) -> Rows:
    """Run the FMU by libcosim, which knows variables by reference."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    execution = CosimExecution.from_step_size(round(request["step"] * 1e9))
    slave = CosimLocalSlave(request["fmu"], "body")
    index = execution.add_local_slave(slave)
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    read = libcosim_reader(observer, [(index, request["fmu"], name) for name in request["names"]])
    rows = []
    for _ in range(request["count"]):
        execution.step()
        rows.append(read())
    return rows


def libcosim_reader(observer: Any, outputs: Sequence[tuple[int, str, str]]) -> Callable[[], list[float]]:
    """Return the function that reads outputs, each given by its slave, its FMU and its name."""
    readers = {
        "real": observer.last_real_values,
        "integer": observer.last_integer_values,
        "boolean": observer.last_boolean_values,
    }
    described_by = {fmu: described(fmu) for fmu in {fmu for _, fmu, _ in outputs}}
    kinds, references = [], {}
    for slave, fmu, name in outputs:
        reference, kind = described_by[fmu][name]
        kinds.append((slave, kind))
        references.setdefault((slave, kind), []).append(reference)

    def read() -> list[float]:
        found = {(s, kind): iter(readers[kind](s, there)) for (s, kind), there in references.items()}
        return [float(next(found[key])) for key in kinds]

    return read


KINDS = {"Float64": "real", "Real": "real", "Int64": "integer", "Integer": "integer", "Boolean": "boolean"}


def described(fmu: str) -> dict[str, tuple[int, str]]:
    """Return the reference and the kind (real, integer or boolean) of an FMU's variables; others are left out."""
    from fmpy import read_model_description

    variables = read_model_description(fmu).modelVariables
    return {v.name: (v.valueReference, KINDS[v.type]) for v in variables if v.type in KINDS}


def value_references(fmu: str) -> dict[str, int]:
    """Return the references of an FMU's variables."""
    return {name: reference for name, (reference, _) in described(fmu).items()}


def ecos(request: Request) -> Rows:
    """Run the FMU by Ecos."""
    load_tbb()
    from ecospy import EcosSimulation, EcosSimulationStructure

    rows = []
    with EcosSimulationStructure() as structure:
        structure.add_model("body", request["fmu"])
        with EcosSimulation(structure=structure, step_size=request["step"]) as simulation:
            simulation.init()
            read = ecos_reader(simulation, [("body", request["fmu"], name) for name in request["names"]])
            for _ in range(request["count"]):
                simulation.step()
                rows.append(read())
    return rows


def ecos_reader(simulation: Any, outputs: Sequence[tuple[str, str, str]]) -> Callable[[], list[float]]:
    """Return the function that reads outputs, each given by its component, its FMU and its name."""
    readers = {
        "real": simulation.get_real,
        "integer": simulation.get_integer,
        "boolean": simulation.get_bool,
    }
    described_by = {fmu: described(fmu) for fmu in {fmu for _, fmu, _ in outputs}}
    named = [(readers[described_by[fmu][name][1]], f"{one}::{name}") for one, fmu, name in outputs]
    return lambda: [float(read(name)) for read, name in named]


def load_tbb() -> None:
    """Load the library of the package tbb; the library of Ecos needs it and does not find it by itself."""
    for library in Path(sys.prefix, "lib").glob("libtbb.so.*"):
        ctypes.CDLL(str(library), ctypes.RTLD_GLOBAL)
        break


def pyfmi(request: Request) -> Rows:
    """Run the FMU by PyFMI."""
    from pyfmi import load_fmu

    step, count = request["step"], request["count"]
    model = load_fmu(request["fmu"], kind="cs")
    model.setup_experiment(start_time=0.0, stop_time=step * count)
    model.initialize()
    rows = []
    for index in range(count):
        if status := model.do_step(index * step, step):
            raise RuntimeError(f"PyFMI: do_step gave {status}")
        rows.append([float(model.get(name)[0]) for name in request["names"]])
    return rows


def fmusim(request: Request) -> Rows:
    """Run the FMU by fmusim of the Reference-FMUs."""
    step, count = request["step"], request["count"]
    options = ["--interface-type", "cs", "--stop-time", repr(step * count), "--output-file", "f.csv"]
    options += ["--output-interval", repr(step), "--logging-on"]
    for name in request["names"]:
        options += ["--output-variable", name]
    run_program(request, *options, request["fmu"])
    return list(columns(Path("f.csv"), request["names"]))[1:]


def omsimulator(request: Request) -> Rows:
    """Run the FMU by OMSimulator."""
    step = request["step"]
    options = ["--mode=cs", f"--stopTime={step * request['count']!r}", f"--stepSize={step!r}"]
    run_program(request, *options, "--resultFile=r.csv", request["fmu"])
    return list(columns(Path("r.csv"), request["names"]))[1:]


def compliance_checker(request: Request) -> Rows:
    """Run the FMU by the FMU Compliance Checker, and pass on its verdict on the description."""
    step = request["step"]
    options = ["-k", "cs", "-h", repr(step), "-s", repr(step * request["count"]), "-o", "c.csv", "-n", "0"]
    run_program(request, *options, request["fmu"])
    return list(columns(Path("c.csv"), request["names"]))[1:]


def run_program(request: Request, *arguments: str) -> None:
    """Run the tool's program with this process's output streams; exit if it fails."""
    if code := subprocess.run([request["program"], *arguments]).returncode:
        raise SystemExit(f"exit code {code}")


def columns(path: Path, names: Sequence[str]) -> Iterator[list[float]]:
    """Yield the rows of named columns of a CSV file, one for each time: the last row at that time."""
    with path.open(newline="") as file:
        header, *lines = csv.reader(file, skipinitialspace=True)
        places = [header.index(name) for name in names]
        last_at = {float(line[0]): line for line in lines if line}
    for line in last_at.values():
        yield [float(line[place]) for place in places]


DRIVERS: dict[str, Callable[[Request], Rows]] = {
    "FMPy": fmpy,
    "libcosim": libcosim,
    "Ecos": ecos,
    "PyFMI": pyfmi,
    "fmusim": fmusim,
    "OMSimulator": omsimulator,
    "FMU Compliance Checker": compliance_checker,
}

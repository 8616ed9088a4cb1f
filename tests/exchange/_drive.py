"""Drives one tool with one FMU and writes what its outputs are after each step: `python _drive.py REQUEST`."""

from __future__ import annotations

import csv
import ctypes
import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

Request = dict[str, Any]
Rows = list[list[float]]


def fmpy(asked: Request) -> Rows:
    """Run it by FMPy."""
    from fmpy import simulate_fmu

    step, count = asked["step"], asked["count"]
    done = simulate_fmu(
        asked["fmu"],
        output=asked["names"],
        step_size=step,
        output_interval=step,
        stop_time=step * count,
    )
    return [[float(row[name]) for name in asked["names"]] for row in done[1:]]


def libcosim(asked: Request) -> Rows:
    """Run it by libcosim, which knows variables by reference."""
    from fmpy import read_model_description
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    references = {v.name: v.valueReference for v in read_model_description(asked["fmu"]).modelVariables}
    execution = CosimExecution.from_step_size(round(asked["step"] * 1e9))
    slave = CosimLocalSlave(asked["fmu"], "body")
    index = execution.add_local_slave(slave)
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    wanted = [references[name] for name in asked["names"]]
    rows = []
    for _ in range(asked["count"]):
        execution.step()
        rows.append([float(value) for value in observer.last_real_values(index, wanted)])
    return rows


def ecos(asked: Request) -> Rows:
    """Run it by Ecos, whose library needs that of the package tbb."""
    for library in Path(sys.prefix, "lib").glob("libtbb.so.*"):
        ctypes.CDLL(str(library), ctypes.RTLD_GLOBAL)
        break
    from ecospy import EcosSimulation, EcosSimulationStructure

    rows = []
    with EcosSimulationStructure() as structure:
        structure.add_model("body", asked["fmu"])
        with EcosSimulation(structure=structure, step_size=asked["step"]) as simulation:
            simulation.init()
            for _ in range(asked["count"]):
                simulation.step()
                rows.append([float(simulation.get_real(f"body::{name}")) for name in asked["names"]])
    return rows


def fmusim(asked: Request) -> Rows:
    """Run it by the program of the Reference-FMUs."""
    step = asked["step"]
    options = [
        "--interface-type",
        "cs",
        "--stop-time",
        repr(step * asked["count"]),
        "--output-file",
        "fmusim.csv",
    ]
    options += ["--output-interval", repr(step), "--fmi-log-file", "fmusim.log"]
    for name in asked["names"]:
        options += ["--output-variable", name]
    subprocess.run([asked["program"], *options, asked["fmu"]], check=True)
    return list(_columns(Path("fmusim.csv"), asked["names"]))[1:]


def omsimulator(asked: Request) -> Rows:
    """Run it by OMSimulator."""
    step = asked["step"]
    options = [
        "--mode=cs",
        f"--stopTime={step * asked['count']!r}",
        f"--interval={step!r}",
        "--resultFile=oms.csv",
    ]
    subprocess.run([asked["program"], *options, asked["fmu"]], check=True)
    rows = list(_columns(Path("oms.csv"), asked["names"]))
    return rows[-asked["count"] :]


def _columns(path: Path, names: list[str]) -> Iterator[list[float]]:
    with path.open(newline="") as file:
        for row in csv.DictReader(file):
            by_name = {key.strip().rpartition(".root.")[2]: value for key, value in row.items()}
            yield [float(by_name[name]) for name in names]


DRIVERS: dict[str, Callable[[Request], Rows]] = {
    "FMPy": fmpy,
    "libcosim": libcosim,
    "Ecos": ecos,
    "fmusim": fmusim,
    "OMSimulator": omsimulator,
}

if __name__ == "__main__":
    request = json.loads(sys.argv[1])
    Path(request["answer"]).write_text(json.dumps(DRIVERS[request["tool"]](request)))

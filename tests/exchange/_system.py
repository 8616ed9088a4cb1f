"""A system (SSP) of this package in each tool that reads systems: its outputs after each step."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from exchange._single import Request, Rows, columns, ecos_reader, libcosim_reader, load_tbb, run_program


def libcosim(request: Request) -> Rows:
    """Run the system by libcosim, with the step that the archive proposes."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimObserver import CosimObserver

    execution = CosimExecution.from_ssp_file(request["system"])
    slaves = {info.name.decode(): info.index for info in execution.slave_infos()}
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    outputs = [name.split(".", 1) for name in request["names"]]
    read = libcosim_reader(observer, [(slaves[a], request["fmus"][a], v) for a, v in outputs])
    rows = []
    for _ in range(request["count"]):
        execution.step()
        rows.append(read())
    return rows


def ecos(request: Request) -> Rows:
    """Run the system by Ecos; the start values are those of the FMUs."""
    load_tbb()
    from ecospy import EcosSimulation

    rows = []
    with EcosSimulation(ssp_path=request["system"], step_size=request["step"]) as simulation:
        simulation.init()
        outputs = [name.split(".", 1) for name in request["names"]]
        read = ecos_reader(simulation, [(a, request["fmus"][a], v) for a, v in outputs])
        for _ in range(request["count"]):
            simulation.step()
            rows.append(read())
    return rows


def omsimulator(request: Request) -> Rows:
    """Run the system by OMSimulator, with the step that the archive proposes."""
    stop = request["step"] * request["count"]
    run_program(request, f"--stopTime={stop!r}", "--resultFile=r.csv", request["system"])
    names = [f"{request['model']}.system.{name}" for name in request["names"]]
    return list(columns(Path("r.csv"), names))[1:]


DRIVERS: dict[str, Callable[[Request], Rows]] = {
    "libcosim": libcosim,
    "Ecos": ecos,
    "OMSimulator": omsimulator,
}

"""A system (SSP) of this package in each tool that reads systems: its outputs after each step."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from exchange._single import Request, Rows, columns, ecos_reader, libcosim_reader, load_tbb, run_program


def libcosim(asked: Request) -> Rows:
    """Run the system by libcosim, with the step that the archive proposes."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimObserver import CosimObserver

    execution = CosimExecution.from_ssp_file(asked["system"])
    slaves = {info.name.decode(): info.index for info in execution.slave_infos()}
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    wanted = [name.split(".", 1) for name in asked["names"]]
    read = libcosim_reader(observer, [(slaves[a], asked["fmus"][a], v) for a, v in wanted])
    rows = []
    for _ in range(asked["count"]):
        execution.step()
        rows.append(read())
    return rows


def ecos(asked: Request) -> Rows:
    """Run the system by Ecos; the start values are those of the FMUs."""
    load_tbb()
    from ecospy import EcosSimulation

    rows = []
    with EcosSimulation(ssp_path=asked["system"], step_size=asked["step"]) as simulation:
        simulation.init()
        wanted = [name.split(".", 1) for name in asked["names"]]
        read = ecos_reader(simulation, [(a, asked["fmus"][a], v) for a, v in wanted])
        for _ in range(asked["count"]):
            simulation.step()
            rows.append(read())
    return rows


def omsimulator(asked: Request) -> Rows:
    """Run the system by OMSimulator, with the step that the archive proposes."""
    stop = asked["step"] * asked["count"]
    run_program(asked, f"--stopTime={stop!r}", "--resultFile=r.csv", asked["system"])
    names = [f"{asked['model']}.system.{name}" for name in asked["names"]]
    return list(columns(Path("r.csv"), names))[1:]


DRIVERS: dict[str, Callable[[Request], Rows]] = {
    "libcosim": libcosim,
    "Ecos": ecos,
    "OMSimulator": omsimulator,
}

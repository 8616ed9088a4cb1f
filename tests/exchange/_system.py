"""A system (SSP) of this package in each tool that takes one: its outputs after each step."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from exchange._single import Request, Rows, columns, load_tbb, run_program, value_references


def libcosim(asked: Request) -> Rows:
    """Run it by libcosim, with the step that the archive proposes."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimObserver import CosimObserver

    execution = CosimExecution.from_ssp_file(asked["system"])
    slaves = {info.name.decode(): info.index for info in execution.slave_infos()}
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    references = {name: value_references(fmu) for name, fmu in asked["fmus"].items()}
    wanted = [name.split(".", 1) for name in asked["names"]]
    rows = []
    for _ in range(asked["count"]):
        execution.step()
        rows.append([observer.last_real_values(slaves[a], [references[a][v]])[0] for a, v in wanted])
    return rows


def ecos(asked: Request) -> Rows:
    """Run it by Ecos; its start values are those that its FMUs have."""
    load_tbb()
    from ecospy import EcosSimulation

    rows = []
    with EcosSimulation(ssp_path=asked["system"], step_size=asked["step"]) as simulation:
        simulation.init()
        for _ in range(asked["count"]):
            simulation.step()
            rows.append([float(simulation.get_real(name.replace(".", "::", 1))) for name in asked["names"]])
    return rows


def omsimulator(asked: Request) -> Rows:
    """Run it by OMSimulator, with the step that the archive proposes."""
    stop = asked["step"] * asked["count"]
    run_program(asked, f"--stopTime={stop!r}", "--resultFile=r.csv", asked["system"])
    names = [f"{asked['model']}.system.{name}" for name in asked["names"]]
    return list(columns(Path("r.csv"), names))[1:]


DRIVERS: dict[str, Callable[[Request], Rows]] = {
    "libcosim": libcosim,
    "Ecos": ecos,
    "OMSimulator": omsimulator,
}

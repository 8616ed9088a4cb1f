"""Two FMUs in each tool that couples FMUs: their outputs after each step. Runs in the Python with the tool."""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement, tostring

from exchange._single import (
    Request,
    Rows,
    columns,
    described,
    ecos_reader,
    libcosim_reader,
    load_tbb,
    run_program,
    value_references,
)

NAMESPACES = {
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "oms": "https://openmodelica.org/SSP",
}


def fmpy(request: Request) -> Rows:
    """Couple the FMUs by FMPy's simulation of an SSP."""
    from fmpy.ssp.simulation import simulate_ssp

    step, count = request["step"], request["count"]
    # FMPy steps while the sum of its steps is less than the stop time
    done = simulate_ssp(str(_ssp(request)), stop_time=step * (count - 0.5), step_size=step)
    return [[float(row[name]) for name in request["names"]] for row in done]


def libcosim(request: Request) -> Rows:
    """Couple the FMUs by libcosim's connections."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    execution = CosimExecution.from_step_size(round(request["step"] * 1e9))
    references = {name: value_references(fmu) for name, fmu in request["fmus"].items()}
    slaves = {name: CosimLocalSlave(fmu, name) for name, fmu in request["fmus"].items()}
    indices = {name: execution.add_local_slave(slave) for name, slave in slaves.items()}
    for source, sink in request["connections"]:
        (a, output), (b, into) = (end.split(".", 1) for end in (source, sink))
        execution.connect_real_variables(indices[a], references[a][output], indices[b], references[b][into])
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    outputs = [name.split(".", 1) for name in request["names"]]
    read = libcosim_reader(observer, [(indices[a], request["fmus"][a], v) for a, v in outputs])
    rows = []
    for _ in range(request["count"]):
        execution.step()
        rows.append(read())
    return rows


def ecos(request: Request) -> Rows:
    """Couple the FMUs by Ecos' connections."""
    load_tbb()
    from ecospy import EcosSimulation, EcosSimulationStructure

    rows = []
    with EcosSimulationStructure() as structure:
        for name, fmu in request["fmus"].items():
            structure.add_model(name, fmu)
        for source, sink in request["connections"]:
            structure.make_real_connection(source.replace(".", "::", 1), sink.replace(".", "::", 1))
        with EcosSimulation(structure=structure, step_size=request["step"]) as simulation:
            simulation.init()
            outputs = [name.split(".", 1) for name in request["names"]]
            read = ecos_reader(simulation, [(a, request["fmus"][a], v) for a, v in outputs])
            for _ in range(request["count"]):
                simulation.step()
                rows.append(read())
    return rows


def pyfmi(request: Request) -> Rows:
    """Couple the FMUs by PyFMI's master."""
    from pyfmi import load_fmu
    from pyfmi.master import Master

    step, count = request["step"], request["count"]
    models = {name: load_fmu(fmu, kind="cs") for name, fmu in request["fmus"].items()}
    ends = [[*source.split(".", 1), *sink.split(".", 1)] for source, sink in request["connections"]]
    master = Master(
        list(models.values()), [(models[a], output, models[b], into) for a, output, b, into in ends]
    )
    options = master.simulate_options()
    options["step_size"] = step
    options["result_handling"] = "memory"
    done = master.simulate(start_time=0.0, final_time=step * count, options=options)
    outputs = [name.split(".", 1) for name in request["names"]]
    return [list(map(float, row)) for row in zip(*(done[models[a]][v] for a, v in outputs), strict=True)][1:]


def omsimulator(request: Request) -> Rows:
    """Couple the FMUs by OMSimulator, from an SSP."""
    stop = request["step"] * request["count"]
    options = [f"--stopTime={stop!r}", f"--stepSize={request['step']!r}", "--resultFile=r.csv"]
    run_program(request, *options, str(_ssp(request)))
    return list(columns(Path("r.csv"), [f"pair.pair.{name}" for name in request["names"]]))[1:]


def _ssp(request: Request) -> Path:
    """Write both FMUs and their connections as an SSP."""
    path = Path("pair.ssp").resolve()
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(
            "SystemStructure.ssd", tostring(_structure(request), encoding="utf-8", xml_declaration=True)
        )
        for name, fmu in request["fmus"].items():
            archive.write(fmu, f"resources/{name}.fmu")
    return path


def _structure(request: Request) -> Element:
    spaces = {f"xmlns:{prefix}": space for prefix, space in NAMESPACES.items()}
    root = Element("ssd:SystemStructureDescription", {**spaces, "name": "pair", "version": "1.0"})
    system = SubElement(root, "ssd:System", name="pair")
    elements = SubElement(system, "ssd:Elements")
    ports = {(name, "output") for name in request["names"]}
    ports |= {
        (end, kind)
        for pair in request["connections"]
        for end, kind in zip(pair, ("output", "input"), strict=True)
    }
    for component, fmu in request["fmus"].items():
        kinds = {name: kind for name, (_, kind) in described(fmu).items()}
        _add_component(elements, component, sorted(ports), kinds)
    connections = SubElement(system, "ssd:Connections")
    for source, sink in request["connections"]:
        (a, output), (b, into) = source.split(".", 1), sink.split(".", 1)
        ends = {"startElement": a, "startConnector": output, "endElement": b, "endConnector": into}
        SubElement(connections, "ssd:Connection", ends)
    _add_master_of_omsimulator(system, request["step"])
    return root


def _add_component(
    elements: Element, name: str, ports: Sequence[tuple[str, str]], kinds: Mapping[str, str]
) -> None:
    kind = {"type": "application/x-fmu-sharedlibrary", "implementation": "CoSimulation"}
    element = SubElement(elements, "ssd:Component", {"name": name, "source": f"resources/{name}.fmu", **kind})
    connectors = SubElement(element, "ssd:Connectors")
    for port, way in ports:
        component, variable = port.split(".", 1)
        if component == name:
            connector = SubElement(connectors, "ssd:Connector", name=variable, kind=way)
            SubElement(connector, f"ssc:{kinds[variable].capitalize()}")


def _add_master_of_omsimulator(system: Element, step: float) -> None:
    """Add the annotation for OMSimulator's program that steps are fixed."""
    annotations = SubElement(system, "ssd:Annotations")
    own = SubElement(annotations, "ssc:Annotation", type="org.openmodelica")
    about = SubElement(SubElement(own, "oms:Annotations"), "oms:SimulationInformation")
    master = {"description": "oms-ma", "stepSize": repr(step)}
    SubElement(
        about, "oms:FixedStepMaster", {**master, "absoluteTolerance": "1e-6", "relativeTolerance": "1e-6"}
    )


DRIVERS: dict[str, Callable[[dict[str, Any]], Rows]] = {
    "FMPy": fmpy,
    "libcosim": libcosim,
    "Ecos": ecos,
    "PyFMI": pyfmi,
    "OMSimulator": omsimulator,
}

"""Check of an FMU: its description, graded as by every reader here, and its binaries, which are loaded.

Every declared binary must exist, and the one for this machine is loaded: all functions resolve, and only the
described token opens it.
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from vibroimpact.fmus.errors import ComponentFileError
from vibroimpact.fmus.packaging.archive import INTERFACES, UnpackedFmu, binary_path, platforms, unpack
from vibroimpact.fmus.packaging.fmpy_door import reading_of, schema_folder
from vibroimpact.fmus.packaging.model_description import Finding, Grade, build_problems
from vibroimpact.fmus.packaging.platform_names import FMI2_SYSTEMS, SUFFIXES
from vibroimpact.fmus.processes.call import call
from vibroimpact.fmus.safe_xml import root_of

#: Longest time for loading and instantiating an FMU, s.
LOADING_LIMIT = 60.0
#: Longest time for a trial of two instances, s; steps of an experiment that proposes none; outputs named.
TRIAL_LIMIT, STEPS, SHOWN = 10.0, 500, 3
ONLY_ONCE = "canBeInstantiatedOnlyOncePerProcess"
#: Names of the interfaces, for people.
KINDS = {
    "CoSimulation": "co-simulation",
    "ModelExchange": "model exchange",
    "ScheduledExecution": "scheduled execution",
}
BUILD_DESCRIPTION = "sources/buildDescription.xml"
SYSTEM_OF_PREFIX = {prefix: system for system, prefix in FMI2_SYSTEMS.items()}


def check_fmu(path: Path) -> tuple[Finding, ...]:
    """Return everything that is wrong with an FMU, graded, one line each; empty if nothing is wrong.

    The FMU's code runs in a separate process: a crash there is one more problem here.
    """
    try:
        fmu = unpack(path)
    except ComponentFileError as error:
        return (Finding(Grade.refused, str(error).removeprefix(f"{path}: ")),)
    # a fault that two interfaces share is reported once
    found = dict.fromkeys(
        (
            *_description_findings(path),
            *_archive_remarks(path, fmu),
            *_missing_binaries(fmu),
            *_loading_findings(fmu),
        )
    )
    runs = all(one.grade is not Grade.refused for one in found)
    return (*found, *(_shared_memory(fmu) if runs else ()))


def kinds_of(path: Path) -> str:
    """Return the uses of an FMU in words: `FMI 3.0: co-simulation, model exchange`."""
    fmu = unpack(path)
    root = _description(fmu)
    found = [KINDS[tag] for tag in INTERFACES if root.find(tag) is not None]
    return f"FMI {fmu.fmi_version}: {', '.join(found)}"


def _description_findings(path: Path) -> tuple[Finding, ...]:
    try:
        return reading_of(path).findings
    except ComponentFileError as error:
        lines = str(error).splitlines()
        return tuple(Finding(Grade.refused, line.removeprefix(f"{path}: ")) for line in lines)


def _archive_remarks(path: Path, fmu: UnpackedFmu) -> Iterator[Finding]:
    """Yield the faults of members that no run uses."""
    with zipfile.ZipFile(path) as archive:
        members = [member.orig_filename for member in archive.filelist]
    for name in members:
        if "\\" in name:
            yield Finding(Grade.remark, f"{name[:200]}: expected / between the folders of a member, got \\.")
    build = fmu.folder / BUILD_DESCRIPTION
    if fmu.fmi_version.startswith("3") and build.is_file():
        for problem in build_problems(build.read_bytes(), schema_folder()):
            yield Finding(Grade.remark, f"{BUILD_DESCRIPTION}: {problem}")


def _description(fmu: UnpackedFmu) -> ElementTree.Element:
    content = (fmu.folder / "modelDescription.xml").read_bytes()
    return root_of(content, f"{fmu.source}: modelDescription.xml")


def _missing_binaries(fmu: UnpackedFmu) -> Iterator[Finding]:
    """Yield the libraries that other machines would miss; this machine's library is loaded instead."""
    for platform in platforms(fmu):
        for identifier in dict.fromkeys(fmu.identifiers):
            binary = fmu.folder / "binaries" / platform / f"{identifier}{_suffix(platform)}"
            if not binary.is_file():
                name = binary.relative_to(fmu.folder).as_posix()
                text = f"{name}: expected this file, which the description names, got none."
                yield Finding(Grade.remark, text)


def _suffix(platform: str) -> str:
    # FMI 3.0 names end with the system (x86_64-linux), FMI 2.0 names begin with it (linux64)
    system = platform.rpartition("-")[2].rstrip("0123456789")
    return SUFFIXES.get(SYSTEM_OF_PREFIX.get(system, system), "")


def _loading_findings(fmu: UnpackedFmu) -> tuple[Finding, ...]:
    try:
        binary = binary_path(fmu)
    except ComponentFileError as error:
        return (Finding(Grade.refused, str(error).removeprefix(f"{fmu.source}: ")),)
    root = _description(fmu)
    facts = {
        **_facts_of(fmu, binary),
        "interfaces": [
            tag
            for tag in INTERFACES
            # interfaces of other libraries than the loaded one are not checked
            for interface in root.findall(tag)
            if interface.get("modelIdentifier") == fmu.identifiers[0]
        ],
        "event_mode": any(one.get("hasEventMode") in ("true", "1") for one in root.findall("CoSimulation")),
        "restorable": any(
            interface.get(f"canGetAndSetFMU{word}") in ("true", "1")
            for tag in INTERFACES
            for interface in root.findall(tag)
            for word in ("state", "State")
        ),
        # PythonFMU's binary is the same for all its FMUs, and ignores the token
        "any_token": root.get("generationTool", "").startswith("PythonFMU"),
    }
    done = call("vibroimpact.fmus.packaging.load_check:problems_of", facts, seconds=LOADING_LIMIT)
    if done.is_late:
        text = f"expected to load and instantiate within {LOADING_LIMIT:g} s, got no answer."
        return (Finding(Grade.refused, f"{binary.name}: {text}"),)
    if done.answer is None or done.code != 0:
        text = (
            f"expected to load and instantiate, got exit code {done.code}: {done.last_line or 'no message'}"
        )
        return (Finding(Grade.refused, f"{binary.name}: {text}"),)
    return tuple(Finding(Grade[grade], text) for grade, text in done.answer)


def _facts_of(fmu: UnpackedFmu, binary: Path) -> dict[str, Any]:
    """Return the facts that an instance needs."""
    return {
        "binary": str(binary),
        "fmi_version": fmu.fmi_version,
        "token": fmu.token,
        "resources": str(fmu.resources),
    }


def _shared_memory(fmu: UnpackedFmu) -> Iterator[Finding]:
    """Yield the doubt that instances of one process share memory, by a trial of two for co-simulation."""
    description = reading_of(fmu.source).description
    simulation, experiment = description.coSimulation, description.defaultExperiment
    outputs = [
        v
        for v in description.modelVariables
        if v.causality == "output" and v.type in ("Real", "Float64") and not v.dimensions and not v.clocks
    ]
    if simulation is None or simulation.canBeInstantiatedOnlyOncePerProcess or not outputs:
        return
    start, stop, step = (
        float(getattr(experiment, name, None) or 0.0) for name in ("startTime", "stopTime", "stepSize")
    )
    facts = {
        **_facts_of(fmu, binary_path(fmu)),
        "interface": "CoSimulation",
        "start": start,
        "step": float(simulation.fixedInternalStepSize or 0.0)
        or step
        or (stop - start) / STEPS
        or 1.0 / STEPS,
        "references": [v.valueReference for v in outputs],
    }
    done = call("vibroimpact.fmus.packaging.two_instances:changed_outputs", facts, seconds=TRIAL_LIMIT)
    if done.code == 0 and done.answer:
        names = ", ".join(outputs[place].name for place in done.answer[:SHOWN])
        yield Finding(
            Grade.doubt,
            f"expected instances without common memory, or {ONLY_ONCE} = true; a step of one instance changes {names} "
            "of another in the same process.",
        )

"""Checks an FMU: what FMPy validates, and what that misses.

Missed there: the schema lets the attributes of an interface pass whatever their spelling, and nobody looks
into the binaries. Here every attribute is compared with the schema's own list, every declared binary must
exist, and the one for this machine is loaded: all functions resolve, and only the described token opens it.
"""

from __future__ import annotations

import difflib
import json
import subprocess
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

from vibroimpact.fmus.errors import ComponentFileError
from vibroimpact.fmus.packaging.archive import INTERFACES, UnpackedFmu, binary_path, platforms, unpack
from vibroimpact.fmus.packaging.fmpy_door import schema_folder, validate
from vibroimpact.fmus.packaging.platform_names import FMI2_SYSTEMS, SUFFIXES
from vibroimpact.fmus.python_child import python_command
from vibroimpact.fmus.safe_xml import root_of

#: Longest time that loading and instantiating an FMU may take, s.
LOADING_LIMIT = 60.0
#: What the interfaces are called.
KINDS = {
    "CoSimulation": "co-simulation",
    "ModelExchange": "model exchange",
    "ScheduledExecution": "scheduled execution",
}
DECLARATION = "{http://www.w3.org/2001/XMLSchema}attribute"
SYSTEM_OF_PREFIX = {prefix: system for system, prefix in FMI2_SYSTEMS.items()}


def check_fmu(path: Path) -> tuple[str, ...]:
    """Return everything that is wrong with an FMU, one line each; empty if nothing is.

    Its code is run, in a process of its own: a crash there is one more problem here.
    """
    try:
        fmu = unpack(path)
    except ComponentFileError as error:
        return (str(error).removeprefix(f"{path}: "),)
    # what two interfaces have in common is wrong with each of them
    return tuple(
        dict.fromkeys(
            (
                *validate(path),
                *_spelling_problems(fmu),
                *_missing_binaries(fmu),
                *_loading_problems(fmu),
            )
        )
    )


def kinds_of(path: Path) -> str:
    """Return in words what an FMU is for: `FMI 3.0: co-simulation, model exchange`."""
    fmu = unpack(path)
    root = _description(fmu)
    found = [KINDS[tag] for tag in INTERFACES if root.find(tag) is not None]
    return f"FMI {fmu.fmi_version}: {', '.join(found)}"


def _spelling_problems(fmu: UnpackedFmu) -> Iterator[str]:
    schemas = (schema_folder() / f"fmi{fmu.fmi_version[0]}").glob("*.xsd")
    known = {e.get("name", "") for path in schemas for e in ElementTree.parse(path).iter(DECLARATION)}
    for element in _description(fmu).iter():
        for name in element.attrib.keys() - known:
            near = difflib.get_close_matches(name, known, n=1)
            hint = f" Did you mean {near[0]}?" if near else ""
            yield f"{element.tag}: expected an attribute of FMI {fmu.fmi_version}'s schema, got {name}.{hint}"


def _description(fmu: UnpackedFmu) -> ElementTree.Element:
    content = (fmu.folder / "modelDescription.xml").read_bytes()
    return root_of(content, f"{fmu.source}: modelDescription.xml")


def _missing_binaries(fmu: UnpackedFmu) -> Iterator[str]:
    present = platforms(fmu)
    if not present:
        yield "binaries: expected at least one platform, got none."
    for platform in present:
        for identifier in dict.fromkeys(fmu.identifiers):
            binary = fmu.folder / "binaries" / platform / f"{identifier}{_suffix(platform)}"
            if not binary.is_file():
                name = binary.relative_to(fmu.folder).as_posix()
                yield f"{name}: expected this file, which the description names, got none."


def _suffix(platform: str) -> str:
    # FMI 3.0 ends with the system (x86_64-linux), FMI 2.0 begins with it (linux64)
    system = platform.rpartition("-")[2].rstrip("0123456789")
    return SUFFIXES.get(SYSTEM_OF_PREFIX.get(system, system), "")


def _loading_problems(fmu: UnpackedFmu) -> tuple[str, ...]:
    try:
        binary = binary_path(fmu)
    except ComponentFileError as error:
        return (str(error).removeprefix(f"{fmu.source}: "),)
    root = _description(fmu)
    facts = {
        "binary": str(binary),
        "fmi_version": fmu.fmi_version,
        "token": fmu.token,
        "interfaces": [tag for tag in INTERFACES if root.find(tag) is not None],
        "resources": str(fmu.resources),
        # PythonFMU's binary is the same for all its FMUs, and looks at no token
        "any_token": root.get("generationTool", "").startswith("PythonFMU"),
    }
    command = python_command("-m", "vibroimpact.fmus.packaging.load_check", json.dumps(facts))
    try:
        result = subprocess.run(command, capture_output=True, text=True, timeout=LOADING_LIMIT)
    except subprocess.TimeoutExpired:
        return (
            f"{binary.name}: expected to load and instantiate within {LOADING_LIMIT:g} s, got no answer.",
        )
    if result.returncode != 0:
        last = result.stderr.strip().splitlines()[-1:] or ["no message"]
        return (
            f"{binary.name}: expected to load and instantiate, got exit code {result.returncode}: {last[0]}",
        )
    # the FMU may print too: the answer is the last line
    return tuple(json.loads(result.stdout.splitlines()[-1]))

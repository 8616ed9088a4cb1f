"""FMUs made of Python code; only this module calls pythonfmu.

pythonfmu builds in a separate process, since it runs the slave's file and leaves that file's folder on the module path.
This module then completes its model description, as FMI's rules and this package's connections require. It adds
units, initial unknowns, dependencies, and a token that depends on the contents alone.
"""

from __future__ import annotations

import hashlib
import importlib.util
import json
import shutil
import tempfile
import uuid
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from vibroimpact.fmus.errors import ComponentError, ComponentFileError, UsageError
from vibroimpact.fmus.packaging.description import UnitDefinition, unit_definitions
from vibroimpact.fmus.packaging.fmu_zip import write_fmu
from vibroimpact.fmus.processes.call import call
from vibroimpact.fmus.units import Unit

SOURCES = Path(__file__).parents[1] / "python"
USER_CONTACT_LAW = SOURCES / "user_contact_law"
ORBIT_CONTROLLER = SOURCES / "orbit_controller"
#: Name of the user's file inside the FMU.
LAW_FILE = "contact_law.py"
DESCRIPTION = "modelDescription.xml"
#: Name of an orbit controller's plan inside the FMU.
PLAN_FILE = "plan.json"
#: Longest time for pythonfmu, which runs the user's file, s.
BUILD_LIMIT = 120.0
UNITS = {
    "displacement": Unit({"m": 1}),
    "velocity": Unit({"m": 1, "s": -1}),
    "applied_force": Unit({"N": 1}),
}
CONTROLLER_UNITS = {
    "last_time": Unit({"s": 1}),
    "last_phase": Unit({"rad": 1}),
    "last_velocity": Unit({"m": 1, "s": -1}),
    "tolerance": Unit({"m": 1, "s": -1}),
    "forcing_amplitude": Unit({"N": 1}),
    "forcing_angular_frequency": Unit({"rad": 1, "s": -1}),
    "correction": Unit({"N": 1}),
    "limit": Unit({"N": 1}),
}


@dataclass(frozen=True, slots=True)
class PythonFmu:
    """Ingredients of an FMU."""

    script: Path
    """The file with the slave's class, in a folder of its own to which files may be added."""
    extras: tuple[Path, ...]
    """Files and folders that go into the resources with it."""
    readme: Path
    """Text of the FMU's documentation."""
    units: Mapping[str, Unit]
    """Units of the variables that have a unit."""
    blamed: str
    """Beginning of the messages of a failed build: the user's file."""


def build_user_contact_law(law: Path | str, output: Path | str) -> Path:
    """Make an FMU (FMI 2.0) that answers contacts by a Python function.

    Parameters
    ----------
    law : path
        A Python file with `contact_law(displacement, velocity) -> restitution`: displacement of the contact
        point in m, speed of approach in m/s (>= 0), coefficient of restitution from 0 to 1.
    output : path
        The FMU file to write. Equal laws give equal bytes.

    Returns
    -------
    Path
        The written file.

    Raises
    ------
    ComponentError
        pythonfmu is not installed.
    ComponentFileError
        The law has a mistake; the message names the line.
    UsageError
        A file cannot be read or written, or the FMU would overwrite the law.
    """
    law, output = Path(law), Path(output)
    if output.exists() and law.exists() and output.samefile(law):
        raise UsageError(f"{output}: expected a new file, got one that is read. Choose another name.")
    require_pythonfmu()
    with tempfile.TemporaryDirectory() as folder:
        script, law_file = Path(folder, "user_contact_law.py"), Path(folder, LAW_FILE)
        _copy(USER_CONTACT_LAW / "user_contact_law.py", script)
        _copy(law, law_file)
        return make_fmu(
            PythonFmu(script, (law_file,), USER_CONTACT_LAW / "README.md", UNITS, str(law)), output
        )


def build_orbit_controller(plan: Mapping[str, Any], output: Path | str) -> Path:
    """Make an FMU (FMI 2.0) that keeps an orbit by the forcing amplitude, impact by impact.

    Parameters
    ----------
    plan : mapping
        Plan in the form of the README of fmus/python/orbit_controller: numbers that JSON can hold.
    output : path
        The FMU file to write. Equal plans give equal bytes.

    Returns
    -------
    Path
        The written file.

    Raises
    ------
    ComponentError
        pythonfmu is not installed.
    UsageError
        The file cannot be written.
    """
    output = Path(output)
    require_pythonfmu()
    with tempfile.TemporaryDirectory() as folder:
        script, plan_file = Path(folder, "orbit_controller.py"), Path(folder, PLAN_FILE)
        _copy(ORBIT_CONTROLLER / "orbit_controller.py", script)
        plan_file.write_text(json.dumps(plan), encoding="utf-8")
        readme = ORBIT_CONTROLLER / "README.md"
        return make_fmu(PythonFmu(script, (plan_file,), readme, CONTROLLER_UNITS, PLAN_FILE), output)


def make_fmu(parts: PythonFmu, output: Path) -> Path:
    """Let pythonfmu make an FMU, complete its description and write it; equal parts give equal bytes.

    Raise ComponentFileError if the slave cannot be instantiated, UsageError if the file cannot be written.
    """
    members = _built(parts)
    members["documentation/README.md"] = parts.readme.read_bytes()
    members[DESCRIPTION] = _completed(members, parts.units)
    write_fmu(output, members)
    return output


def require_pythonfmu() -> None:
    """Raise ComponentError if pythonfmu is not installed."""
    if importlib.util.find_spec("pythonfmu") is None:
        raise ComponentError(
            "pythonfmu: expected this package, which makes FMUs of Python code, got none. "
            "Run `pip install 'vibroimpact[python-fmus]'`."
        )


def _copy(source: Path, target: Path) -> None:
    try:
        shutil.copyfile(source, target)
    except OSError as error:
        raise UsageError(f"{source}: expected a Python file, got: {error.strerror}.") from error


def _built(parts: PythonFmu) -> dict[str, bytes]:
    with tempfile.TemporaryDirectory() as output:
        _build("-f", str(parts.script), "-d", output, *map(str, parts.extras), parts=parts)
        (path,) = Path(output).glob("*.fmu")
        with zipfile.ZipFile(path) as archive:
            return {name: archive.read(name) for name in archive.namelist()}


def _build(*words: str, parts: PythonFmu) -> None:
    done = call("pythonfmu", "build", *words, seconds=BUILD_LIMIT, folder=parts.script.parent)
    if done.is_late:
        raise ComponentFileError(f"{parts.blamed}: expected to run within {BUILD_LIMIT:g} s, got no answer.")
    if done.code != 0:
        raise ComponentFileError(f"{parts.blamed}: {_last_message(done.stderr)}")


def _last_message(errors: str) -> str:
    lines = [line for line in errors.splitlines() if line.strip()]
    last = lines[-1] if lines else "pythonfmu failed without a message"
    # messages inside an FMU are formats
    return last.removeprefix("ValueError: ").replace("%%", "%")


def _completed(members: Mapping[str, bytes], units: Mapping[str, Unit]) -> bytes:
    root = ElementTree.fromstring(members[DESCRIPTION])
    root.attrib.pop("generationDateAndTime", None)
    _add_units(root, units)
    _add_dependencies(root)
    root.set("guid", _token(members, root))
    ElementTree.indent(root)
    text: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return text


def _add_units(root: ElementTree.Element, units: Mapping[str, Unit]) -> None:
    named = {unit.name: unit for unit in units.values() if unit.name}
    if named:
        # the schema requires them right after the interface
        interface = root.find("CoSimulation")
        place = 0 if interface is None else list(root).index(interface) + 1
        declared = [UnitDefinition(name, u.exponents, u.factor, u.offset) for name, u in named.items()]
        root.insert(place, unit_definitions(declared))
    for variable in root.iter("ScalarVariable"):
        real, found = variable.find("Real"), units.get(variable.get("name", ""))
        if real is not None and found is not None and found.name:
            real.set("unit", found.name)


def _add_dependencies(root: ElementTree.Element) -> None:
    def indices(*causalities: str) -> str:
        variables = enumerate(root.iter("ScalarVariable"), 1)
        return " ".join(str(index) for index, v in variables if v.get("causality") in causalities)

    inputs, given = indices("input"), indices("input", "parameter")
    structure = root.find("ModelStructure")
    outputs = root.find("ModelStructure/Outputs")
    if structure is None or outputs is None:
        raise ComponentFileError(f"{DESCRIPTION}: expected outputs, got none from pythonfmu.")
    initial = ElementTree.SubElement(structure, "InitialUnknowns")
    for unknown in outputs:
        unknown.set("dependencies", inputs)
        # at the start of a run the outputs also depend on the parameters
        ElementTree.SubElement(initial, "Unknown", {**unknown.attrib, "dependencies": given})


def _token(members: Mapping[str, bytes], root: ElementTree.Element) -> str:
    # pythonfmu's own token differs each time, and its binary ignores it
    root.set("guid", "")
    contents = {**members, DESCRIPTION: ElementTree.tostring(root)}
    digest = hashlib.sha256()
    for name in sorted(contents):
        digest.update(name.encode() + b"\0" + hashlib.sha256(contents[name]).digest())
    return f"{{{uuid.uuid5(uuid.NAMESPACE_DNS, digest.hexdigest())}}}"

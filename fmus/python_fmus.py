"""Makes FMUs of Python functions; the one place that calls pythonfmu.

pythonfmu builds in a process of its own, since it runs the user's file and leaves that file's folder on the
module path. Its model description is then completed (units, initial unknowns, dependencies, a token that
depends on the contents alone), which FMI's rules and this package's connections need.
"""

from __future__ import annotations

import hashlib
import importlib.util
import shutil
import subprocess
import sys
import tempfile
import uuid
import zipfile
from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

from vibroimpact.fmus.errors import ComponentError, ComponentFileError, UsageError
from vibroimpact.fmus.fmu_zip import write_fmu

SOURCES = Path(__file__).with_name("python")
USER_CONTACT_LAW = SOURCES / "user_contact_law"
#: What the user's file is called inside the FMU.
LAW_FILE = "contact_law.py"
DESCRIPTION = "modelDescription.xml"
#: Longest time that pythonfmu, which runs the user's file, may take, s.
BUILD_LIMIT = 120.0
UNITS = {"displacement": "m", "velocity": "m/s", "applied_force": "N"}
BASE_UNITS = {"m": {"m": 1}, "m/s": {"m": 1, "s": -1}, "N": {"kg": 1, "m": 1, "s": -2}}


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
        The FMU.

    Raises
    ------
    ComponentError
        pythonfmu is not installed.
    ComponentFileError
        The law has a mistake; the message has the line.
    UsageError
        A file cannot be read or written.
    """
    law, output = Path(law), Path(output)
    _require_pythonfmu()
    with tempfile.TemporaryDirectory() as folder:
        sources = Path(folder, "sources")
        sources.mkdir()
        _copy(USER_CONTACT_LAW / "user_contact_law.py", sources / "user_contact_law.py")
        _copy(law, sources / LAW_FILE)
        members = _built(sources, law)
    members["documentation/README.md"] = (USER_CONTACT_LAW / "README.md").read_bytes()
    members[DESCRIPTION] = _completed(members)
    try:
        write_fmu(output, members)
    except OSError as error:
        raise UsageError(f"{output}: expected a file that can be written, got: {error.strerror}.") from error
    return output


def _require_pythonfmu() -> None:
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


def _built(sources: Path, law: Path) -> dict[str, bytes]:
    output = sources.parent / "output"
    script, law_file = sources / "user_contact_law.py", sources / LAW_FILE
    command = [
        sys.executable,
        "-m",
        "pythonfmu",
        "build",
        "-f",
        str(script),
        "-d",
        str(output),
        str(law_file),
    ]
    try:
        result = subprocess.run(
            command, capture_output=True, text=True, timeout=BUILD_LIMIT, cwd=sources.parent
        )
    except subprocess.TimeoutExpired as error:
        raise ComponentFileError(
            f"{law}: expected to run within {BUILD_LIMIT:g} s, got no answer."
        ) from error
    if result.returncode != 0:
        raise ComponentFileError(f"{law}: {_last_message(result.stderr)}")
    (path,) = output.glob("*.fmu")
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def _last_message(errors: str) -> str:
    lines = [line for line in errors.splitlines() if line.strip()]
    last = lines[-1] if lines else "pythonfmu failed without a message"
    # inside an FMU the messages are formats
    return last.removeprefix("ValueError: ").replace("%%", "%")


def _completed(members: Mapping[str, bytes]) -> bytes:
    root = ElementTree.fromstring(members[DESCRIPTION])
    root.attrib.pop("generationDateAndTime", None)
    _add_units(root)
    _add_dependencies(root)
    root.set("guid", _token(members, root))
    ElementTree.indent(root)
    text: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return text


def _add_units(root: ElementTree.Element) -> None:
    definitions = ElementTree.Element("UnitDefinitions")
    for name, exponents in BASE_UNITS.items():
        unit = ElementTree.SubElement(definitions, "Unit", name=name)
        ElementTree.SubElement(unit, "BaseUnit", {key: str(value) for key, value in exponents.items()})
    # the schema wants them just after the interface
    interface = root.find("CoSimulation")
    root.insert(0 if interface is None else list(root).index(interface) + 1, definitions)
    for variable in root.iter("ScalarVariable"):
        real = variable.find("Real")
        if real is not None and variable.get("name") in UNITS:
            real.set("unit", UNITS[variable.get("name", "")])


def _add_dependencies(root: ElementTree.Element) -> None:
    variables = list(root.iter("ScalarVariable"))
    inputs = [str(index) for index, v in enumerate(variables, 1) if v.get("causality") == "input"]
    structure = root.find("ModelStructure")
    outputs = root.find("ModelStructure/Outputs")
    if structure is None or outputs is None:
        raise ComponentFileError(f"{DESCRIPTION}: expected outputs, got none from pythonfmu.")
    initial = ElementTree.SubElement(structure, "InitialUnknowns")
    for unknown in outputs:
        unknown.set("dependencies", " ".join(inputs))
        ElementTree.SubElement(initial, "Unknown", dict(unknown.attrib))


def _token(members: Mapping[str, bytes], root: ElementTree.Element) -> str:
    # pythonfmu's own token is another one each time, and its binary does not look at it
    root.set("guid", "")
    contents = {**members, DESCRIPTION: ElementTree.tostring(root)}
    digest = hashlib.sha256()
    for name in sorted(contents):
        digest.update(name.encode() + b"\0" + hashlib.sha256(contents[name]).digest())
    return f"{{{uuid.uuid5(uuid.NAMESPACE_DNS, digest.hexdigest())}}}"

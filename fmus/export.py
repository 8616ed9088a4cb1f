"""Writes an FMU with just as many contacts as wanted; needs no compiler.

The binary is the one that was built: it knows its maximum of contacts, and those that no description
mentions keep the law `none`. Value references stay as they are.
"""

from __future__ import annotations

import zipfile
from pathlib import Path

from vibroimpact.fmus import component_name, fmu_path
from vibroimpact.fmus.build import read_components
from vibroimpact.fmus.description import Component, fmi2_xml, fmi3_xml
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.fmu_zip import write_fmu

#: The member that says how many contacts the description has.
CONTACTS_MEMBER = "resources/contacts.txt"


def export_fmu(name: str, output: Path, *, contacts: int | None = None, fmi: str = "3.0") -> Path:
    """Write an FMU of a component of the package.

    Parameters
    ----------
    name : str
        The component.
    output : Path
        File to write.
    contacts : int, optional
        Number of contacts in its description; all that were compiled in when absent.
    fmi : str
        `3.0` or `2.0`.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    ComponentFileError
        There is no such component or it was not built.
    UsageError
        More contacts than were compiled in, or a file that cannot be written.
    """
    component = _with_contacts(_component(component_name(name)), contacts)
    description = fmi3_xml(component) if fmi == "3.0" else fmi2_xml(component)
    with zipfile.ZipFile(fmu_path(name, fmi)) as archive:
        members = {member: archive.read(member) for member in archive.namelist()}
    members["modelDescription.xml"] = description.encode("utf-8")
    if "contact" in component.repeats:
        members[CONTACTS_MEMBER] = f"{component.repeats['contact']}\n".encode("ascii")
    try:
        write_fmu(output, members)
    except OSError as error:
        raise UsageError(f"{output}: expected a file that can be written, got: {error.strerror}.") from error
    return output


def _component(name: str) -> Component:
    return next(component for component in read_components() if component.name == name)


def _with_contacts(component: Component, contacts: int | None) -> Component:
    if contacts is None:
        return component
    most = component.repeats.get("contact", 0)
    if not 0 <= contacts <= most:
        raise UsageError(f"{component.name}: contacts: expected 0 to {most}, got {contacts}.")
    return component.with_repeats({"contact": contacts})

"""Writes an FMU with just as many contacts, modes, masses and sensors as wanted; needs no compiler.

The binary is the one that was built: it knows its maxima, and reads from the FMU's resources how many its
description has. Contacts that no description mentions keep the law `none`. Value references stay as they are.
"""

from __future__ import annotations

import os
import zipfile
from collections.abc import Mapping
from pathlib import Path

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.packaging.build import read_components
from vibroimpact.fmus.packaging.description import ComponentDescription, fmi2_xml, fmi3_xml, plural
from vibroimpact.fmus.packaging.fmu_zip import write_fmu
from vibroimpact.fmus.shipped import component_name, fmu_path

#: The member that says how many of each repeated block the description has: lines such as `modes 8`.
SIZES_MEMBER = "resources/sizes.txt"


def export_fmu(
    name: str,
    output: str | os.PathLike[str],
    *,
    contacts: int | None = None,
    modes: int | None = None,
    masses: int | None = None,
    sensors: int | None = None,
    fmi: str = "3.0",
) -> Path:
    """Write an FMU of a component of the package.

    Parameters
    ----------
    name : str
        The component.
    output : path
        File to write.
    contacts, modes, masses, sensors : int, optional
        How many its description has; all that were compiled in when absent. `modes` of a Beam and `masses` of a
        Chain start with this number.
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
        More of them than were compiled in, a component that has none, or a file that cannot be written.
    """
    target = Path(output)
    asked = {"contact": contacts, "mode": modes, "mass": masses, "sensor": sensors}
    counts = {block: count for block, count in asked.items() if count is not None}
    component = _component(component_name(name))
    _check_counts(component, counts)
    component = component.with_repeats(counts)
    description = fmi3_xml(component) if fmi == "3.0" else fmi2_xml(component)
    with zipfile.ZipFile(fmu_path(name, fmi)) as archive:
        members = {member: archive.read(member) for member in archive.namelist()}
    members["modelDescription.xml"] = description.encode("utf-8")
    if counts:
        lines = (f"{plural(block)} {count}\n" for block, count in counts.items())
        members[SIZES_MEMBER] = "".join(lines).encode("ascii")
    try:
        write_fmu(target, members)
    except OSError as error:
        raise UsageError(f"{target}: expected a file that can be written, got: {error.strerror}.") from error
    return target


def _component(name: str) -> ComponentDescription:
    return next(component for component in read_components() if component.name == name)


def _check_counts(component: ComponentDescription, counts: Mapping[str, int]) -> None:
    problems = []
    for block, count in counts.items():
        if block not in component.repeats:
            known = ", ".join(map(plural, component.repeats)) or "nothing"
            problems.append(
                f"{component.name}: {plural(block)}: expected no number of them, since this component repeats "
                f"{known}, got {count}. Leave the option out."
            )
            continue
        # a body of no modes is none: what counts the block says the least
        least = max((int(v.minimum or 0) for v in component.variables if v.counts == block), default=0)
        most = component.repeats[block]
        if not isinstance(count, int) or not least <= count <= most:
            problems.append(f"{component.name}: {plural(block)}: expected {least} to {most}, got {count}.")
    if problems:
        raise UsageError("\n".join(problems))

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
from vibroimpact.fmus.packaging.description import ComponentDescription, model_description, plural
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
    full_name = component_name(name)
    component = next(component for component in read_components() if component.name == full_name)
    _check_counts(component, counts)
    component = component.with_repeats(counts)
    with zipfile.ZipFile(fmu_path(name, fmi)) as archive:
        members = {member: archive.read(member) for member in archive.namelist()}
    members["modelDescription.xml"] = model_description(component, fmi).encode("utf-8")
    if counts:
        lines = (f"{plural(block)} {count}\n" for block, count in counts.items())
        members[SIZES_MEMBER] = "".join(lines).encode("ascii")
    write_fmu(target, members)
    return target


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
        # the variable that counts the blocks has the least number as its minimum
        least = max((int(v.minimum or 0) for v in component.variables if v.counts == block), default=0)
        most = component.repeats[block]
        if not isinstance(count, int) or not least <= count <= most:
            problems.append(f"{component.name}: {plural(block)}: expected {least} to {most}, got {count}.")
    if problems:
        raise UsageError("\n".join(problems))

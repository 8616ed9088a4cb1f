"""Writes FMU archives that are equal, byte for byte, when their contents are."""

from __future__ import annotations

import os
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path

#: The earliest time a zip file can hold: contents alone decide the bytes of an archive.
TIMESTAMP = (1980, 1, 1, 0, 0, 0)


def write_fmu(path: Path, members: Mapping[str, bytes]) -> None:
    """Write an FMU in one step: other processes see the old file or the new one, never a part.

    Parameters
    ----------
    path : Path
        The file; its folder is made.
    members : mapping of str to bytes
        Contents by member name, `/` between folders.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    temporary = Path(name)
    try:
        with os.fdopen(handle, "wb") as file, zipfile.ZipFile(file, "w") as archive:
            for member in sorted(members, key=_description_first):
                archive.writestr(_info(member), members[member], zipfile.ZIP_DEFLATED, 9)
        temporary.chmod(0o644)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def _description_first(member: str) -> tuple[bool, str]:
    return member != "modelDescription.xml", member


def _info(member: str) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(member, TIMESTAMP)
    info.create_system = 3  # Unix, on every machine: the field below holds its file mode
    info.external_attr = (0o100755 if member.startswith("binaries/") else 0o100644) << 16
    return info

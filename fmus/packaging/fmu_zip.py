"""Writing of FMU archives: equal contents give equal bytes."""

from __future__ import annotations

import os
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path

from vibroimpact.fmus.errors import UsageError

#: Earliest time that a zip file can hold, used for all members: only contents decide the bytes of an archive.
TIMESTAMP = (1980, 1, 1, 0, 0, 0)


def write_fmu(path: Path, members: Mapping[str, bytes]) -> None:
    """Write an FMU in one step: other processes see the old file or the new one, never a part.

    Parameters
    ----------
    path : Path
        File to write; its folder is made.
    members : mapping of str to bytes
        Contents by member name, `/` between folders.

    Raises
    ------
    UsageError
        The file cannot be written.
    """
    try:
        _write(path, members)
    except OSError as error:
        raise UsageError(f"{path}: expected a file that can be written, got: {error.strerror}.") from error


def _write(path: Path, members: Mapping[str, bytes]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    temporary = Path(name)
    try:
        with os.fdopen(handle, "wb") as file, zipfile.ZipFile(file, "w") as archive:
            # the description is the first member
            for member in sorted(members, key=lambda name: (name != "modelDescription.xml", name)):
                archive.writestr(_info(member), members[member], zipfile.ZIP_DEFLATED, 9)
        temporary.chmod(0o644)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def _info(member: str) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(member, TIMESTAMP)
    info.create_system = 3  # Unix, on every machine: the field below holds its file mode
    info.external_attr = (0o100755 if member.startswith("binaries/") else 0o100644) << 16
    return info

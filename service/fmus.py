"""The FMUs that scenes may name: those of the package, and those that were uploaded into the folder of the service."""

from __future__ import annotations

import threading
from pathlib import Path

from vibroimpact.analysis.files.folder_lock import make_folder
from vibroimpact.fmus.errors import ComponentFileError, UsageError
from vibroimpact.fmus.packaging.archive import refuse_broken_description, unpack
from vibroimpact.service.recordings import refuse_device

DESCRIPTION_SECONDS = 3.0
"""Processor time of reading a description, s, as scenes of the service do: one that takes more is not taken."""
MOST_FMUS = 100
"""FMUs that a service keeps."""
NAME = r"^[A-Za-z0-9_][A-Za-z0-9_.+\-]{0,99}\.fmu$"
"""What an uploaded FMU may be called: the same on every system, never a path, nor the name of a shipped component."""


class FmuStore:
    """The FMUs of the folder of a service, `fmus` in it, made when absent.

    Others may add to it if it takes uploads: an FMU is native code, which runs with the rights of the service.
    """

    def __init__(self, folder: Path, takes_uploads: bool) -> None:
        self.folder, self.takes_uploads = folder, takes_uploads
        self._lock = threading.Lock()
        make_folder(folder)
        for part in folder.glob(".*"):  # of uploads that a kill has cut off
            part.unlink()

    def names(self) -> list[str]:
        """Return the names of the FMUs that are there."""
        return sorted(path.name for path in self.folder.glob("*.fmu"))

    def find(self, name: str) -> Path | None:
        """Return the file of an FMU; None where there is none of this name."""
        return self.folder / name if name in self.names() else None

    def add(self, file: Path, name: str) -> Path:
        """Take an FMU that was uploaded: moved to its place once its archive and its description are in order.

        Nothing of it is loaded, and its description is read by a process of its own. UsageError: it is no FMU, there
        are too many, or another one has its name.
        """
        refuse_device(name)
        try:
            refuse_broken_description(unpack(file), DESCRIPTION_SECONDS)
        except ComponentFileError as error:
            raise UsageError(str(error).replace(str(file), name)) from None
        target = self.folder / name
        with self._lock:
            if target.exists() and target.read_bytes() != file.read_bytes():
                raise UsageError(f"name: expected a new name, got {name}, which another FMU has.")
            if len(self.names()) >= MOST_FMUS:
                raise UsageError(f"expected fewer than {MOST_FMUS} FMUs, got no room.")
            file.replace(target)
        return target

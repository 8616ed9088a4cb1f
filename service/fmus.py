"""The FMUs that scenes may name: those of the package, and those uploaded into the folder of the service."""

from __future__ import annotations

import threading
from pathlib import Path

from vibroimpact.analysis.files.folder_lock import make_folder
from vibroimpact.fmus.errors import ComponentFileError, UsageError
from vibroimpact.fmus.packaging.archive import refuse_broken_description, unpack
from vibroimpact.service.recordings import refuse_device

DESCRIPTION_SECONDS = 3.0
"""Limit of the processor time for reading a description, s; an FMU that takes longer is refused."""
MOST_FMUS = 100
"""Largest number of FMUs that a service keeps."""
NAME = r"^[A-Za-z0-9_][A-Za-z0-9_.+\-]{0,99}\.fmu$"
"""Valid name of an uploaded FMU: the same on every system, never a path, nor the name of a shipped component."""


class FmuStore:
    """The FMUs in the folder `fmus` of a service, which is made when absent.

    Clients may add FMUs if uploads are allowed: an FMU is native code, which runs with the rights of the service.
    """

    def __init__(self, folder: Path, takes_uploads: bool) -> None:
        self.folder, self.takes_uploads = folder, takes_uploads
        self._lock = threading.Lock()
        make_folder(folder)
        for part in folder.glob(".*"):  # left by uploads that a kill interrupted
            part.unlink()

    def names(self) -> list[str]:
        """Return the names of the present FMUs."""
        return sorted(path.name for path in self.folder.glob("*.fmu"))

    def find(self, name: str) -> Path | None:
        """Return the file of an FMU; None for an unknown name."""
        return self.folder / name if name in self.names() else None

    def add(self, file: Path, name: str) -> Path:
        """Accept an uploaded FMU: move it to its place once its archive and its description are valid.

        Its code is not loaded, and a separate process reads its description. Raise UsageError if it is no FMU, if there
        are too many, or if another FMU has its name.
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

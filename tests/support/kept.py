"""Files made by tests once for each content of their inputs; `make clean` removes them with `build/`."""

from __future__ import annotations

import hashlib
import os
import subprocess
import threading
import time
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path

from support.places import ROOT

FOLDER = ROOT / "build" / "tests"
#: Time after which an unused file is removed, s; no run is still at work after so long.
UNUSED = 3600.0


def digest(*parts: str | bytes) -> str:
    """Return the SHA-256 of some parts; the borders between parts count."""
    whole = hashlib.sha256()
    for part in parts:
        data = part.encode() if isinstance(part, str) else part
        whole.update(len(data).to_bytes(8, "little") + data)
    return whole.hexdigest()


def content_of(files: Iterable[Path]) -> str:
    """Return the digest of files, including their paths."""
    return digest(*(part for path in sorted(files) for part in (path.as_posix(), path.read_bytes())))


@cache
def compiler_identity(compiler: tuple[str, ...]) -> str:
    """Return the command of a compiler and the text of its version."""
    said = subprocess.run([*compiler, "--version"], capture_output=True, text=True, check=True)
    return digest(*compiler, said.stdout)


def kept(name: str, key: str, make: Callable[[Path], None], folder: Path = FOLDER) -> Path:
    """Return a file; it is made unless an earlier run has left it.

    Parameters
    ----------
    name : str
        Its name in the folder, after the key.
    key : str
        Digest of everything that goes into the file.
    make : callable
        Function that writes the file to a given path. An error leaves no file; two runs may make it at once.
    folder : Path

    Returns
    -------
    Path
        Its modification time is that of the last run that used it.
    """
    path = folder / f"{key[:24]}-{name}"
    try:
        os.utime(path)
    except FileNotFoundError:
        folder.mkdir(parents=True, exist_ok=True)
        unfinished = folder / f"{os.getpid()}-{threading.get_ident()}-{path.name}"
        try:
            make(unfinished)
            unfinished.replace(path)
        finally:
            unfinished.unlink(missing_ok=True)
    return path


def remove_unused(folder: Path = FOLDER, unused: float = UNUSED) -> None:
    """Remove files without a use in the last `unused` seconds, and half-made files of a killed run."""
    for path in folder.iterdir():
        if time.time() - path.stat().st_mtime > unused:
            path.unlink(missing_ok=True)

"""From files to modes: read, reduced, and kept by content."""

from __future__ import annotations

from pathlib import Path

from vibroimpact.orchestrator.structures.modes import Modes
from vibroimpact.orchestrator.structures.request import Request


def find_modes(request: Request) -> Modes:
    """Return the modes that a body by matrices asks for.

    Raises
    ------
    UsageError
        A file cannot be read, or the matrices are none of a structure: `expected ..., got ...`.
    """
    raise NotImplementedError


def modes_of_file(path: Path) -> Modes:
    """Return the modes of a file.

    Raises
    ------
    UsageError
        The file cannot be read, or holds no modes: `expected ..., got ...`.
    """
    raise NotImplementedError
